"""The structure of a model: its matrices, and the rows that pick motions of its points."""

from __future__ import annotations

from dataclasses import dataclass

from flexcam.checks import did_you_mean, refuse
from flexcam.fem import Beams, DofMap
from flexcam.linalg import FloatArray, Triplets
from flexcam.train.model import Lever, Model, Rocker, path_name, tip_name

_ACROSS = 1e-6
"""Cosine below which a direction has nothing to do with another."""


@dataclass(frozen=True, eq=False)
class Structure:
    """The passive part of a model as matrices.

    Parameters
    ----------
    model
        What it was made from.
    beams, dofs
        Elements and unknowns.
    mass, stiffness, dampers
        n x n, SI; `dampers` holds the discrete dampers only.
    free
        Motions that cost no strain energy, shape (n, k).
    """

    model: Model
    beams: Beams
    dofs: DofMap
    mass: Triplets
    stiffness: Triplets
    dampers: Triplets
    free: FloatArray

    def row(self, point: str, direction: FloatArray, where: str = "point") -> FloatArray:
        """Return the row that picks the motion of a named point, shape (n,)."""
        rocker = self.model.rocker_at(point)
        if rocker is not None:
            along = float(direction @ rocker.direction) if direction.any() else 1.0
            if abs(along) < _ACROSS:
                allowed = f"a direction along {[round(float(x), 6) for x in rocker.direction[:3]]}"
                raise refuse(
                    where, "a direction across the motion of a rocker's point", allowed, "it moves only along it"
                )
            if point in self.model.loose_points:
                return along * self.dofs.unit(point)
            return along * self.reach(rocker)
        return self.dofs.vector(find_node(self.model, point, where), direction)

    def is_node(self, point: str) -> bool:
        """Tell whether a point is a node of the mesh, which can move and turn in every direction."""
        return self.model.rocker_at(point) is None

    def path(self, rocker: Rocker) -> FloatArray:
        """Return the row of the motion of a rocker's driven end, shape (n,): for a lever its path."""
        if isinstance(rocker, Lever) and not rocker.finger:
            return self.dofs.unit(path_name(self.name_of(rocker)))
        return self.row(rocker.start, rocker.direction)

    def reach(self, rocker: Rocker) -> FloatArray:
        """Return the row of a rocker's end at its point, shape (n,): ratio times its driven end, or a lever's tip."""
        if not isinstance(rocker, Lever):
            return rocker.ratio * self.path(rocker)
        tip = tip_name(self.name_of(rocker))
        return self.dofs.unit(tip if tip in self.dofs.names else rocker.point)

    def name_of(self, rocker: Rocker) -> str:
        """Return the name of a rocker of the model."""
        return next(name for name, one in self.model.rockers.items() if one is rocker)


def lever_ends(structure: Structure, lever: Lever) -> dict[int, tuple[FloatArray, FloatArray]]:
    """Return, per elastic end of a lever, the rows of its path and of what moves there, shape (n,) each."""
    path = structure.path(lever)
    ends = {1: (path, structure.reach(lever))}
    if not lever.finger:
        ends[0] = path, structure.row(lever.start, lever.direction)
    return ends


def find_node(model: Model, point: str, where: str) -> int:
    """Return the node of a named point."""
    if point not in model.mesh.points:
        known = [*model.mesh.points, *(r.point for r in model.rockers.values())]
        raise refuse(where, repr(point), f"a point: {', '.join(known)}", remedy=did_you_mean(point, known))
    return model.mesh.node(point, where)
