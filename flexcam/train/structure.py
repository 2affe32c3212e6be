"""Matrices of the structure: beams, masses, springs and rockers of a model."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from functools import lru_cache
from itertools import pairwise

import numpy as np

from flexcam import fem
from flexcam.checks import did_you_mean, refuse
from flexcam.fem import Beams, DofMap, along, mass_at
from flexcam.linalg import FloatArray, Triplets
from flexcam.train.model import Lever, MassAt, Model, Rocker, Spring, path_name, tip_name

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
            return self.dofs.unit(path_name(self._name(rocker)))
        return self.row(rocker.start, rocker.direction)

    def reach(self, rocker: Rocker) -> FloatArray:
        """Return the row of a rocker's end at its point, shape (n,): ratio times its driven end, or a lever's tip."""
        if not isinstance(rocker, Lever):
            return rocker.ratio * self.path(rocker)
        tip = tip_name(self._name(rocker))
        return self.dofs.unit(tip if tip in self.dofs.names else rocker.point)

    def _shares(self, rocker: Rocker) -> dict[str, float]:
        """Return what the unknowns of a rocker move per motion of its driven end, as installed, no play being open."""
        own = {rocker.point: rocker.ratio}
        if isinstance(rocker, Lever):
            name = self._name(rocker)
            own |= {path_name(name): 1.0 / math.cos(rocker.angles[0]), tip_name(name): rocker.ratio}
        return {name: share for name, share in own.items() if name in self.dofs.names}

    def _name(self, rocker: Rocker) -> str:
        return next(name for name, one in self.model.rockers.items() if one is rocker)

    def shifted(self, node: int, direction: FloatArray) -> FloatArray:
        """Return the unit motion of everything that members connect to a node, shape (n,)."""
        motion = np.zeros(self.dofs.size)
        numbers = self.dofs.numbers[self.model.mesh.connected(node)]
        motion[numbers[numbers >= 0]] = np.broadcast_to(direction, numbers.shape)[numbers >= 0]
        return motion

    def _pushed_on(self, motion: FloatArray) -> FloatArray:
        """Return a motion with what plays between nodes push along, no play being open."""
        moved = motion.copy()
        for play in self.model.plays:
            driven, pushed = (float(self.row(end, play.direction) @ moved) for end in play.ends)
            if driven != 0.0 and pushed == 0.0:
                moved += driven * self.shifted(self.model.mesh.node(play.ends[1]), play.direction)
        return moved

    def completed(self, motion: FloatArray) -> FloatArray:
        """Return a motion of nodes with points and springs following: no play is open, springs stretch evenly.

        Parameters
        ----------
        motion
            Shape (n,).

        Returns
        -------
        ndarray
            Shape (n,).
        """
        moved = self._linked(self._pushed_on(motion))
        for rocker in self.model.rockers.values():
            driven = float(self.row(rocker.start, rocker.direction) @ moved)
            for name, share in self._shares(rocker).items():
                moved += self.dofs.unit(name) * share * driven
        return self.with_springs(self._linked(moved))

    def _linked(self, motion: FloatArray) -> FloatArray:
        """Return a motion with the points that follow through springs that stand for parts of the train."""
        moved = motion.copy()
        links = [(one.direction, (one.at, one.to)) for one in self.model.springs.values() if one.link and one.to]
        for _ in links:  # each pass goes on by one link at least
            for direction, ends in links:
                drawn = [float(self.row(end, direction) @ moved) for end in ends]
                for still, (other, end) in enumerate(zip(reversed(drawn), ends, strict=True)):
                    if drawn[still] == 0.0 and other != 0.0 and self.is_node(end):
                        moved += other * self.shifted(self.model.mesh.node(end), direction)
        return moved

    def with_springs(self, motion: FloatArray) -> FloatArray:
        """Return a motion with the inner parts of springs evenly between their ends, shape (n,)."""
        moved = motion.copy()
        for name, spring in self.model.springs.items():
            ends = [float(row @ motion) for row in spring_ends(self, name, spring)]
            for i in range(1, spring.elements):
                own, part = self.dofs.unit(inner_name(name, i)), i / spring.elements
                moved += own * ((1.0 - part) * ends[1] + part * ends[0] - float(own @ motion))
        return moved


def lever_ends(structure: Structure, lever: Lever) -> dict[int, tuple[FloatArray, FloatArray]]:
    """Return, per elastic end of a lever, the rows of its path and of what moves there, shape (n,) each.

    Parameters
    ----------
    structure
        The structure.
    lever
        The lever.

    Returns
    -------
    dict
        By end: 0 for the driven one where it is a node, 1 for the point.
    """
    path = structure.path(lever)
    ends = {1: (path, structure.reach(lever))}
    if not lever.finger:
        ends[0] = path, structure.row(lever.start, lever.direction)
    return ends


def inner_name(spring: str, i: int) -> str:
    """Return the name of a spring's inner unknown, counted from the fixed end.

    Parameters
    ----------
    spring
        Name of the spring.
    i
        From 1.

    Returns
    -------
    str
        Such as ``springs.valve.3``.
    """
    return f"springs.{spring}.{i}"


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


@lru_cache(maxsize=4)
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
    inner = [inner_name(name, i) for name, spring in model.springs.items() for i in range(1, spring.elements)]
    dofs = fem.dof_map(model.mesh, model.supports.items(), _single(model))
    dofs = dofs.extended([*model.further_unknowns, *inner])
    nothing = Triplets.zeros(dofs.size)
    bare = Structure(model, beams, dofs, nothing, nothing, nothing, np.zeros((dofs.size, 0)))
    mass, stiffness, dampers = [fem.mass(beams, dofs), *_masses(bare)], [fem.stiffness(beams, dofs)], [nothing]
    for stretch, spring, damper in _stretches(bare):
        stiffness.append(along(stretch, spring))
        dampers.append(along(stretch, damper))
    mass, stiffness, dampers = (Triplets.joined(parts) for parts in (mass, stiffness, dampers))
    free = fem.free_motions(model.mesh, dofs, (stretch for stretch, spring, _ in _stretches(bare) if spring > 0.0))
    return Structure(model, beams, dofs, mass, stiffness, dampers, free)


def _masses(bare: Structure) -> Iterator[Triplets]:
    """Yield the masses of bodies, rockers and springs."""
    for name, part in bare.model.masses.items():
        yield _mass(bare, name, part)
    for rocker in bare.model.rockers.values():
        yield along(bare.path(rocker), rocker.inertia / rocker.arms[0] ** 2)
    for name, spring in bare.model.springs.items():
        if spring.mass > 0.0:
            for low, high in spring_parts(bare, name, spring):
                yield _bar_mass(low, high, spring.mass / spring.elements)


def _stretches(bare: Structure) -> Iterator[tuple[FloatArray, float, float]]:
    """Yield the row, the stiffness and the damping of everything that stretches: ends of levers, parts of springs."""
    for lever in bare.model.levers.values():
        for end, (path, moved) in lever_ends(bare, lever).items():
            bent = float(lever.reach(np.zeros(1), end)[1][0]) * path - moved
            yield bent, lever.stiffness[end], lever.damping[end]
    for name, spring in bare.model.springs.items():
        share = float(spring.elements)
        for low, high in spring_parts(bare, name, spring):
            yield high - low, share * spring.stiffness, share * spring.damping


def _single(model: Model) -> list[tuple[int, FloatArray]]:
    """Return what moves at nodes on no member: where a mass has inertia, and along springs."""
    known, used = model.mesh.points, model.mesh.on_members()
    moved = [(part.at, np.diag(part.body.matrix())) for part in model.masses.values()]
    for spring in model.springs.values():
        moved += [(end, spring.direction) for end in (spring.at, spring.to) if end is not None]
    nodes = [(int(node), size) for point, size in moved if point in known for node in known[point]]
    return [(node, size) for node, size in nodes if not used[node]]


def spring_ends(structure: Structure, name: str, spring: Spring) -> tuple[FloatArray, FloatArray]:
    """Return the rows of a spring's moving end and of its other end (zeros for ground), shape (n,) each.

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
    tuple
        Two rows.
    """
    moving = structure.row(spring.at, spring.direction, f"springs.{name}.at")
    if spring.to is None:
        return moving, np.zeros(structure.dofs.size)
    return moving, structure.row(spring.to, spring.direction, f"springs.{name}.to")


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
    moving, other = spring_ends(structure, name, spring)
    return moving - other


def spring_parts(structure: Structure, name: str, spring: Spring) -> list[tuple[FloatArray, FloatArray]]:
    """Return the rows of the ends of each part of a spring, from its fixed to its moving end.

    Parameters
    ----------
    structure
        The structure.
    name
        Of the spring.
    spring
        The spring.

    Returns
    -------
    list
        A pair of rows per part, shape (n,) each.
    """
    moving, other = spring_ends(structure, name, spring)
    inner = [structure.dofs.unit(inner_name(name, i)) for i in range(1, spring.elements)]
    return list(pairwise([other, *inner, moving]))


def _bar_mass(low: FloatArray, high: FloatArray, mass: float) -> Triplets:
    """Return the consistent mass m/6 [2 1; 1 2] of a bar between two motions."""
    both, apart = low + high, high - low
    return along(both, 0.25 * mass) + along(apart, mass / 12.0)


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
    for contact in model.driven.values():
        if contact.cam == cam:
            finger = model.rocker_at(contact.follower)
            if finger is not None:
                return finger.ratio
            train = model.connected(find_node(model, contact.follower, "follower"))
            ratios = [r.ratio for r in model.rockers.values() if not r.finger and model.mesh.node(r.start) in train]
            return ratios[0] if ratios else 1.0
    return 1.0
