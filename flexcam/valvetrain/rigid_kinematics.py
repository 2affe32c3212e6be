"""Kinematics of the rigid train: motion over the cam lift through levers and lash."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import product
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from flexcam.core import FloatArray
from flexcam.core.errors import refuse
from flexcam.valvetrain.parts import Adjuster, Lash, Lever, Rocker, Seat, path_name, tip_name
from flexcam.valvetrain.structure import Structure
from flexcam.valvetrain.train_topology import complete_motion, moved_nodes, rigid_shift, with_springs

Coordinate = Callable[[FloatArray], tuple[FloatArray, FloatArray, FloatArray]]
"""Path of the rigid train over the lift, m, with its first two derivatives."""


def direct_path(lift: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return the path of parts moved directly by the cam: the lift."""
    return lift, np.ones_like(lift), np.zeros_like(lift)


def lever_path(before: Coordinate, lever: Lever, end: int, share: float) -> Coordinate:
    """Return the path of a lever's driven end (0), or of its point (1), over the lift."""

    def path(lift: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        c, c1, c2 = before(lift)
        p, slope, bend = lever.path_at(share * c)
        slope, bend = share * slope * c1, share**2 * bend * c1**2 + share * slope * c2
        if end == 0:
            return p, slope, bend
        y, by_path, by_path_twice = lever.reach(p, 1)
        return y, by_path * slope, by_path_twice * slope**2 + by_path * bend

    return path


def path_behind_lash(before: Coordinate, gap: float, rest: float | None) -> Coordinate:
    """Return the path after a lash, zero until the lash is taken up."""

    def path(lift: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        h, h1, h2 = before(lift)
        if rest is None:
            return h - gap, h1, h2
        on = h - gap > rest
        return np.where(on, h - gap, rest), np.where(on, h1, 0.0), np.where(on, h2, 0.0)

    return before if gap == 0.0 and rest is None else path


_FORCE_TOLERANCE = 1e-9  # fraction of the largest force that counts as zero
_PENETRATION_TOLERANCE = 1e-12  # penetration that counts as zero, m


@dataclass(frozen=True)
class Body:
    """Part of a train not divided by lash; motions and forces are reduced to the follower."""

    before: int = 0  #: number of the driving body; its own number for the first body, driven by the cam
    gap: float = 0.0  #: lash between them, m
    push: float = 0.0  #: plunger force of an adjuster, N
    extends: bool = False  #: whether an adjuster between them takes up the lash
    seated: bool = False  #: whether a seat stops its return

    def touches(self, place: float, before: float) -> bool:
        """Return whether its lash is closed at given positions of it and the driving body, m."""
        return self.extends or place - before <= _PENETRATION_TOLERANCE - self.gap


def find_rest(bodies: Sequence[Body], stiffness: FloatArray, force: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the rest positions of bodies on the base circle, m, and the forces of their seats, N, shape (g,) each.

    The first body has no seat force: the stiffnesses of seat and cam share its load.

    Forces return a body until its lash is closed, its seat stops it, or its springs balance them. The solution
    satisfies equilibrium with unilateral contact forces: the conditions of A. Signorini, as in P. Wriggers,
    Computational Contact Mechanics, 2nd ed. (2006), ch. 2.
    """
    own = force.copy()
    for i, body in enumerate(bodies[1:], 1):
        own[body.before] += body.push
        own[i] -= body.push
    stops = _stops(bodies)
    for held in product(*((stop.likely, not stop.likely) for stop in stops)) if stops else ():
        holding = [stop for stop, holds in zip(stops, held, strict=True) if holds]
        places, forces = _solve_active_set(stiffness[1:, 1:], own[1:], holding)
        if places is not None and all(float(one.row @ places) >= one.bound - _PENETRATION_TOLERANCE for one in stops):
            seats = sum((size * one.row * one.seat for one, size in zip(holding, forces, strict=True)), 0.0 * own[1:])
            return np.append(0.0, places), np.append(0.0, seats)
    return np.zeros(len(bodies)), np.zeros(len(bodies))


class _Stop(NamedTuple):
    """Unilateral constraint of bodies, ``row x >= bound``, and whether it is likely active: a seat, else a lash."""

    row: FloatArray
    bound: float
    likely: bool
    seat: bool


def _stops(bodies: Sequence[Body]) -> list[_Stop]:
    unit = np.eye(len(bodies))[:, 1:]
    numbered = list(enumerate(bodies))[1:]
    plays = [_Stop(unit[i] - unit[one.before], -one.gap, not one.seated, False) for i, one in numbered]
    return plays + [_Stop(unit[i], 0.0, True, True) for i, one in numbered if one.seated]


def _solve_active_set(K: FloatArray, force: FloatArray, stops: Sequence[_Stop]) -> tuple[FloatArray | None, FloatArray]:
    """Return the rest positions with active constraints and their forces; None if a force is tensile.

    ``K x + f = A^T r`` with ``A x = b`` and ``r >= 0``.
    """
    n, scale = len(force), float(np.abs(K).max(initial=0.0)) or 1.0
    A = np.array([stop.row for stop in stops]).reshape(-1, n)
    matrix = np.block([[K / scale, -A.T], [A, np.zeros((len(A), len(A)))]])
    given = np.concatenate([-force / scale, [stop.bound for stop in stops]])
    found: FloatArray = np.linalg.lstsq(matrix, given)[0].astype(np.float64, copy=False)
    slight = _FORCE_TOLERANCE * float(np.abs(force).max(initial=0.0)) / scale + _PENETRATION_TOLERANCE
    if (np.abs(matrix @ found - given) > slight).any() or (found[n:] < -slight).any():
        return None, found[n:]
    return found[:n], scale * found[n:]


Bools = NDArray[np.bool_]


@dataclass(frozen=True, eq=False)
class Part:
    """Part that moves along one path."""

    motion: FloatArray  #: shape (n,), per motion along the path
    slope: float = 1.0  #: slope of the path over the lift, as installed, with lash closed
    before: int = 0  #: number of the driving part
    body: int = 0  #: number of its body
    #: `lever`, `end`, `share`: lever, its driven end (0) or its point (1), and the fraction of the driving motion
    lever: Lever | None = None
    end: int = 0
    share: float = 1.0
    opens: bool = False  #: whether a lash precedes it, so that a new body begins


@dataclass(frozen=True, eq=False)
class TrainParts:
    """Rigid train divided into parts and bodies."""

    #: `parts`, `bodies`: from the cam on
    parts: tuple[Part, ...]
    bodies: tuple[Body, ...]

    @property
    def motions(self) -> FloatArray:
        """Motions of all parts, shape (b, n)."""
        return np.array([part.motion for part in self.parts])

    @property
    def installed(self) -> FloatArray:
        """Relative motions of the parts of every body as installed, shape (g, b)."""
        slopes, belongs = (np.array([getattr(part, one) for part in self.parts]) for one in ("slope", "body"))
        return slopes * (np.arange(len(self.bodies))[:, None] == belongs)

    def coordinates(self, rests: FloatArray) -> tuple[Coordinate, ...]:
        """Return the path of every part for rest positions of bodies, m, shape (g,), from `find_rest`."""
        found: list[Coordinate] = []
        for part in self.parts:
            path = found[part.before] if found else direct_path
            if part.lever is not None:
                path = lever_path(path, part.lever, part.end, part.share)
            if part.opens:
                path = self._lash_path(part, path, rests)
            found.append(path)
        return tuple(found)

    def rests_on_cam(self, rests: FloatArray) -> Bools:
        """Return which bodies are supported at rest by the cam without oil, shape (g,): their lash is closed."""
        found = [True]
        for body, rest in list(zip(self.bodies, rests, strict=True))[1:]:
            closed = not body.extends and body.touches(float(rest), float(rests[body.before]))
            found.append(closed and found[body.before])
        return np.array(found)

    def _lash_path(self, part: Part, path: Coordinate, rests: FloatArray) -> Coordinate:
        """Return a path after a lash; that of an adjuster, or one closed at rest, has no gap."""
        body, rest = self.bodies[part.body], float(rests[part.body])
        closed = body.touches(rest, float(rests[body.before]))
        if body.extends or (closed and body.seated):
            return path_behind_lash(path, float(path(np.zeros(1))[0][0]) - part.slope * rest, None)
        return path_behind_lash(path, part.slope * body.gap, None if closed else part.slope * rest)


@dataclass(frozen=True, eq=False)
class _Joint:
    """Lash between nodes, or a rocker with a separate point: driving and driven side."""

    row: FloatArray
    moved: FloatArray
    play: Lash | Adjuster | None
    rocker: Rocker | None = None


def divide_train(structure: Structure, motion: FloatArray) -> TrainParts:
    """Divide a train at lash and levers."""
    parts, bodies = [Part(motion)], [Body()]
    for joint in _topological_order([*_lash_joints(structure, motion), *_rockers(structure, motion)]):
        before = next((i for i, one in enumerate(parts) if float(joint.row @ one.motion) != 0.0), 0)
        for one in _parts_of(structure, joint, parts[before], before):
            if twin := _parallel_lash(parts, before, one):
                first, other = bodies[twin.body], _body(joint, parts[before], one)
                gap, push = min(first.gap, other.gap), first.push + other.push  # the smaller gap governs, forces add up
                extends = first.extends or other.extends
                bodies[twin.body] = replace(first, gap=gap, push=push, extends=extends)
                continue
            if one.opens:
                bodies.append(_body(joint, parts[before], one))
            parts = [replace(old, motion=np.where(one.motion != 0.0, 0.0, old.motion)) for old in parts]
            parts.append(replace(one, body=len(bodies) - 1) if one.opens else one)
    # Springs deform uniformly between their ends.
    parts = [replace(one, motion=with_springs(structure, one.motion)) for one in parts]
    seats = [structure.row(one.at, one.direction) for one in structure.model.contacts.values() if isinstance(one, Seat)]
    moved = [sum((one.slope * one.motion for one in parts if one.body == i), 0.0 * motion) for i in range(len(bodies))]
    seated = [any(float(row @ one) > 0.0 for row in seats) for one in moved]
    return TrainParts(tuple(parts), tuple(replace(one, seated=is_) for one, is_ in zip(bodies, seated, strict=True)))


def _lash_joints(structure: Structure, motion: FloatArray) -> Iterator[_Joint]:
    """Yield the lash elements between nodes of a train; refuse those that its lift does not close."""
    for play in structure.model.lashes:
        row, far = (structure.row(end, play.direction) for end in play.ends)
        start, end = play.ends
        pushed, at_node = rigid_shift(structure, end, play.direction), structure.is_node(start)
        fixed = at_node and not rigid_shift(structure, start, play.direction).any()
        if fixed or not pushed.any():  # a fixed node drives no other
            continue
        driven = float(row @ motion)
        other = at_node and driven == 0.0 and float(far @ motion)
        if driven < 0.0 or (other and not _is_cam_driven(structure, start)):
            allowed, why = "a lash that the lift of its cam closes", "the rigid model follows the train from the cam"
            remedy = "name as `from` the node on the side of the cam, with the direction in which it pushes"
            given = f"from {start!r} to {end!r}"
            raise refuse(f"contacts.{play.name}", given, allowed, why, remedy)
        if driven:
            yield _Joint(row, complete_motion(structure, pushed), play.part)


def _is_cam_driven(structure: Structure, node: str) -> bool:
    """Return whether a cam moves a node."""
    model = structure.model
    return any(model.mesh.node(node) in moved_nodes(model, one) for one in model.cam_contacts.values())


def _rockers(structure: Structure, motion: FloatArray) -> Iterator[_Joint]:
    """Yield the rockers of a train with separate points, and the linked nodes."""
    for name, rocker in structure.model.rockers.items():
        row = structure.row(rocker.start, rocker.direction)
        if float(row @ motion) and rocker.point in structure.dofs.names:
            own = complete_motion(structure, structure.dofs.unit(rocker.point))
            yield _Joint(row, own, structure.model.lash_of(name), rocker)


def _topological_order(joints: Sequence[_Joint]) -> Iterator[_Joint]:
    """Yield joints in topological order: each after its driving joint."""
    left = list(joints)
    while left:
        first = next((one for one in left if not any(float(one.row @ other.moved) for other in left)), left[0])
        left.remove(first)
        yield first


def _parts_of(structure: Structure, joint: _Joint, driver: Part, before: int) -> Iterator[Part]:
    """Yield the parts driven by a joint: both ends of a lever, then the parts at its point or after the lash."""
    rocker, opens = joint.rocker, joint.play is not None
    if not isinstance(rocker, Lever):
        yield Part(_transmit(joint, driver) * joint.moved, driver.slope, before, driver.body, opens=opens)
        return
    name, share = structure.name_of(rocker), float(joint.row @ driver.motion)
    for end, own in ((0, path_name(name)), (1, tip_name(name)), (1, None)):
        slope = driver.slope * float(lever_path(direct_path, rocker, end, share)(np.zeros(1))[1][0])
        if own is None or own in structure.dofs.names:
            moved = joint.moved if own is None else structure.dofs.unit(own)
            yield Part(moved, slope, before, driver.body, rocker, end, share, opens and own is None)


def _transmit(joint: _Joint, driver: Part) -> float:
    """Return the motion after a joint per path of its part; at a lever's point, the path itself."""
    if isinstance(joint.rocker, Lever):
        return 1.0
    return float(joint.row @ driver.motion) * (joint.rocker.ratio if joint.rocker else 1.0)


def _parallel_lash(parts: Sequence[Part], before: int, pushed: Part) -> Part | None:
    """Return the part driven by a parallel lash from the same body; None without one."""
    own = parts[before]
    beside = (one for one in parts if one.opens and one is not own and parts[one.before].body == own.body)
    return next((one for one in beside if pushed.opens and np.any((one.motion != 0.0) & (pushed.motion != 0.0))), None)


def _body(joint: _Joint, driver: Part, first: Part) -> Body:
    """Return the body that begins with a part after a lash."""
    moved = first.slope * _transmit(joint, driver)
    if isinstance(joint.play, Adjuster):
        return Body(driver.body, push=joint.play.plunger_force * moved, extends=True)
    return Body(driver.body, gap=joint.play.gap / moved if joint.play else 0.0)
