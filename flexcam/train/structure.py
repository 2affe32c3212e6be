"""Matrices of the structure: beams, masses, springs and rockers of a model."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from flexcam import fem
from flexcam.checks import did_you_mean, refuse
from flexcam.fem import Beams, DofMap, along, mass_at
from flexcam.linalg import FloatArray, Triplets
from flexcam.train.model import MassAt, Model, Spring

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

    Examples
    --------
    `build_structure` makes one.
    """

    model: Model
    beams: Beams
    dofs: DofMap
    mass: Triplets
    stiffness: Triplets
    dampers: Triplets
    free: FloatArray

    def row(self, point: str, direction: FloatArray, where: str = "point") -> FloatArray:
        """Return the row that picks the motion of a named point, shape (n,).

        Parameters
        ----------
        point
            A named node, or the point of a rocker.
        direction
            Shape (6,), global axes. A rocker's point moves along the rocker's direction only: the given one counts with
            its share of that; zeros stand for the rocker's own.
        where
            The place, for the message.

        Returns
        -------
        ndarray
            Shape (n,).

        Raises
        ------
        InputError
            If there is no such point.
        """
        rocker = self.model.rocker_at(point)
        if rocker is not None:
            along = float(direction @ rocker.direction) if direction.any() else 1.0
            if abs(along) < _ACROSS:
                allowed = f"a direction along {[round(float(x), 6) for x in rocker.direction[:3]]}"
                raise refuse(
                    where, "a direction across the motion of a rocker's point", allowed, "it moves only along it"
                )
            return along * rocker.ratio * self.row(rocker.start, rocker.direction)
        return self.dofs.vector(find_node(self.model, point, where), direction)


def find_node(model: Model, point: str, where: str) -> int:
    """Return the node of a named point.

    Parameters
    ----------
    model
        The model.
    point
        Its name.
    where
        The place, for the message.

    Returns
    -------
    int
        Node number.

    Raises
    ------
    InputError
        If neither the mesh nor a rocker defines it.
    """
    if point not in model.mesh.points:
        known = [*model.mesh.points, *(r.point for r in model.rockers.values())]
        raise refuse(where, repr(point), f"a point: {', '.join(known)}", remedy=did_you_mean(point, known))
    return model.mesh.node(point, where)


def build_structure(model: Model) -> Structure:
    """Assemble the passive part of a model.

    Parameters
    ----------
    model
        The model.

    Returns
    -------
    Structure
        Its matrices.

    Raises
    ------
    InputError
        If a part is attached to something that does not exist.
    """
    beams = fem.beams(model.mesh, model.members)
    dofs = fem.dof_map(model.mesh, model.supports.items())
    nothing = Triplets.zeros(dofs.size)
    bare = Structure(model, beams, dofs, nothing, nothing, nothing, np.zeros((dofs.size, 0)))
    mass, stiffness, dampers = fem.mass(beams, dofs), fem.stiffness(beams, dofs), nothing
    for name, part in model.masses.items():
        mass = mass + _mass(bare, name, part)
    for rocker in model.rockers.values():
        mass = mass + along(bare.row(rocker.start, rocker.direction), rocker.inertia / rocker.arms[0] ** 2)
    stretched: list[FloatArray] = []
    for name, spring in model.springs.items():
        row = spring_row(bare, name, spring)
        stiffness, dampers = stiffness + along(row, spring.stiffness), dampers + along(row, spring.damping)
        stretched += [row] if spring.stiffness > 0.0 else []
    return Structure(model, beams, dofs, mass, stiffness, dampers, fem.free_motions(model.mesh, dofs, stretched))


def spring_row(structure: Structure, name: str, spring: Spring) -> FloatArray:
    """Return the row of a spring's stretch: motion at its point less that at its other end, shape (n,).

    Parameters
    ----------
    structure
        The structure.
    name
        Of the spring, for the message.
    spring
        The spring.

    Returns
    -------
    ndarray
        Shape (n,).
    """
    row = structure.row(spring.at, spring.direction, f"springs.{name}.at")
    if spring.to is not None:
        row = row - structure.row(spring.to, spring.direction, f"springs.{name}.to")
    return row


def _mass(structure: Structure, name: str, part: MassAt) -> Triplets:
    if structure.model.rocker_at(part.at) is not None:
        if any(part.body.inertia) or any(part.body.offset):
            why = "a lumped rocker moves its point along one line"
            raise refuse(
                f"masses.{name}", "inertia or offset at a rocker's point", "a mass alone", why, "leave them out"
            )
        return along(structure.row(part.at, np.zeros(6)), part.body.mass)
    return mass_at(find_node(structure.model, part.at, f"masses.{name}.at"), part.body, structure.dofs)


def member_masses(model: Model) -> dict[str, float]:
    """Return the mass of every member.

    Parameters
    ----------
    model
        The model.

    Returns
    -------
    dict
        Member name to rho A L, kg.
    """
    beams = fem.beams(model.mesh, model.members)
    return {n: float((beams.rho_A * beams.length)[part].sum()) for n, part in model.mesh.element_ranges().items()}


def valve_ratio(model: Model, cam: str) -> float:
    """Return how far the valve moves per lift of a cam, by the rocker on the train of its follower.

    Parameters
    ----------
    model
        The model.
    cam
        Name of the cam.

    Returns
    -------
    float
        1 where there is no rocker or no contact.
    """
    for contact in model.contacts.values():
        if contact.cam == cam:
            train = model.mesh.connected(find_node(model, contact.follower, "follower"))
            ratios = [r.ratio for r in model.rockers.values() if find_node(model, r.start, "from") in train]
            return ratios[0] if ratios else 1.0
    return 1.0
