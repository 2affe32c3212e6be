"""Motion of a rigid train over the cam lift: equilibrium with unilateral contacts, in branches of equal contact.

The scalars z of the motion that contacts and levers sense minimize the energy of the springs under the constant loads
(C. L. Dym and I. H. Shames, Solid Mechanics: A Variational Approach (1973), ch. 3) with the conditions of A. Signorini:
a seat or a lash is closed and presses, or is open without force (P. Wriggers, Computational Contact Mechanics, 2nd ed.
(2006), ch. 2). A set of closed stops is a branch; in it z follows from the lifts, with exact derivatives.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import product

import numpy as np
from numpy.typing import NDArray

from flexcam.core import FloatArray, IntArray
from flexcam.core.errors import refuse
from flexcam.dynamics import AngleFunction, CamFunctionCache
from flexcam.valvetrain.parts import Adjuster, CamContact, Lash, Lever, PublishedLoad, Seat

RANK = 1e-9
"""Part of the largest value, or of a row, that counts as zero."""

_CLOSED = 1e-11  # gap or penetration that counts as zero, m: a billionth of a lift
_HELD_BACK = 1e-7  # lift that stops may hold back, or overlap, m, above all rounding

PULL = 1e-6
"""Part of the largest force with which a closed stop may pull, above all rounding."""

_MAX_TRIALS = 10  # number of stops up to which all sets of closed ones are tried
_DEFLECTION = 1e-3  # largest deflection of the springs under the loads, m, by which stiffness and loads are scaled
_COMPLIANCE = 1e-10  # compliance of stops, relative to the scaled springs, in the search for the closed ones
# gap of a closed lash in this search, m, above its deflection: the load of a body goes to its seat first
_SLACK = 4e-13
_ITERATIONS = 40  # maximum number of Newton iterations; some five suffice

Bools = NDArray[np.bool_]
Closed = tuple[bool, ...]
"""Which stops are closed."""


@dataclass(frozen=True, eq=False)
class Drive:
    """A cam that moves its follower by its lift, ``row z = s``."""

    name: str
    contact: CamContact | PublishedLoad
    lift: AngleFunction  #: over the angle of the drive
    row: FloatArray


@dataclass(frozen=True, eq=False)
class Stop:
    """A seat, lash or adjuster, ``row z <= gap``."""

    name: str
    part: Seat | Lash | Adjuster
    row: FloatArray
    gap: float

    @property
    def is_seat(self) -> bool:
        """True for a seat."""
        return isinstance(self.part, Seat)

    @property
    def push(self) -> float:
        """Force while open, N: that of an adjuster's plunger."""
        return self.part.plunger_force if isinstance(self.part, Adjuster) else 0.0


@dataclass(frozen=True, eq=False)
class LeverEnd:
    """An end of a lever, ``y(path z) = moved z``."""

    lever: Lever
    end: int
    path: FloatArray
    moved: FloatArray

    def evaluate(self, z: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return ``y - moved z``, its derivatives by z, and y'' by the path, at m motions, shape (m, d)."""
        y, slope, bend = self.lever.reach(z @ self.path, self.end)
        return y - z @ self.moved, slope[:, None] * self.path - self.moved, bend


@dataclass(frozen=True, eq=False)
class RigidMotion:
    """Motion of a train at m cam angles."""

    z: FloatArray  #: scalars and their first two derivatives by the cam angle, shape (3, m, d)
    branches: tuple[tuple[Branch, IntArray], ...]  #: branches and their instants


@dataclass(frozen=True, eq=False)
class RigidTrain:
    """Parts that cams move together, with d scalars z of their motion."""

    dofs: IntArray  #: numbers of their unknowns
    motions: FloatArray  #: motion of these unknowns per scalar, shape (d, k)
    drives: tuple[Drive, ...]
    stops: tuple[Stop, ...]
    levers: tuple[LeverEnd, ...]
    stiffness: FloatArray  #: of the springs that are not rigid, N/m, shape (d, d)
    force: FloatArray  #: constant loads, N, shape (d,)

    @cached_property
    def scale(self) -> float:
        """Stiffness by which stiffnesses and forces are divided, N/m."""
        return max(float(np.abs(self.stiffness).max()), float(np.abs(self.force).max()) / _DEFLECTION) or 1.0

    def load(self, closed: Sequence[bool]) -> FloatArray:
        """Return the constant loads with the plunger forces of open adjusters, over the scale, m, shape (d,)."""
        pushes = (stop.push * stop.row for stop, on in zip(self.stops, closed, strict=True) if not on)
        return (self.force - sum(pushes, 0.0 * self.force)) / self.scale

    @cached_property
    def branches(self) -> tuple[Branch, ...]:
        """Branches over a revolution; where several fit, such as on the base circle, the one with most closed seats."""
        lifts = self._lifts(CamFunctionCache(np.linspace(0.0, 2.0 * np.pi, 721)), 0)
        unique = {branch.closed: branch for branch, _, _ in self._assign(lifts, ())}.values()

        def order(branch: Branch) -> tuple[int, int]:
            return -sum(self.stops[i].is_seat for i in branch.stops), len(branch.stops)

        return tuple(sorted(unique, key=order))

    def solve(self, cam: CamFunctionCache) -> RigidMotion:
        """Return the motion at the cam angles of a cache."""
        return cam.lookup(self, lambda: self._solve(cam))

    def _solve(self, cam: CamFunctionCache) -> RigidMotion:
        lift, slope, bend = (self._lifts(cam, order) for order in range(3))
        z = np.empty((3, len(lift), len(self.force)))
        parts = self._assign(lift, self.branches)
        for branch, rows, positions in parts:
            z[0, rows], z[1:, rows] = positions, branch.derivatives(positions, slope[rows], bend[rows])
        return RigidMotion(z, tuple((branch, rows) for branch, rows, _ in parts))

    def _lifts(self, cam: CamFunctionCache, order: int) -> FloatArray:
        """Return the lifts of the cams or their derivatives by the cam angle, shape (m, cams)."""
        rows = [cam(drive.lift, order) for drive in self.drives]
        return np.array(rows).reshape(len(rows), len(cam.angle)).T

    def _assign(self, lifts: FloatArray, known: Sequence[Branch]) -> list[tuple[Branch, IntArray, FloatArray]]:
        """Return the branches of lifts, shape (m, cams), with their instants and positions z; known ones come first."""
        assigned: list[tuple[Branch, IntArray, FloatArray]] = []
        remaining, candidates = np.arange(len(lifts)), list(known)
        while len(remaining):
            branch = candidates.pop(0) if candidates else Branch(self, find_closed_stops(self, lifts[remaining[0]]))
            z, forces = branch.positions(lifts[remaining])
            good = branch.fits(z, forces, lifts[remaining])
            if branch not in known and not good[0]:  # rounding, or no equilibrium
                branch.check(z[0], forces[0], lifts[remaining[0]])
                good[0] = True
            if good.any():
                assigned.append((branch, remaining[good], z[good]))
            remaining = remaining[~good]
        return assigned

    def unit_motion(self, contact: CamContact | PublishedLoad) -> FloatArray:
        """Return z per lift of one cam as installed, with all lash closed and all seats open, shape (d,)."""
        alone = replace(self, drives=tuple(drive for drive in self.drives if drive.contact is contact))
        branch = Branch(alone, tuple(not stop.is_seat for stop in self.stops))
        return branch.derivatives(np.zeros((1, len(self.force))), np.ones((1, 1)), np.zeros((1, 1)))[0, 0]

    def bodies(self, mass: FloatArray) -> FloatArray:
        """Return independent motions of all bodies with mass, levers as installed, shape (b, d)."""
        rows = installed_rows(self.levers, len(mass))
        free = null_space_of_rows(rows)
        sizes, motions = np.linalg.eigh(free @ mass @ free.T)
        return motions[:, sizes > RANK * float(sizes.max(initial=0.0))].T @ free

    def shared_forces(self) -> dict[str, float]:
        """Return the forces that cams and seats share where the lifts are zero, N: the seats carry them."""
        lifts = np.zeros((1, len(self.drives)))
        base = next((branch for branch in self.branches if branch.fits(*branch.positions(lifts), lifts)[0]), None)
        if base is None:
            return {}
        z = base.positions(lifts)[0][0]
        touching = tuple(abs(s.gap - s.row @ z) <= _CLOSED and not isinstance(s.part, Adjuster) for s in self.stops)
        seated = Branch(self, touching)
        lifted = Branch(self, tuple(on and not stop.is_seat for on, stop in zip(touching, self.stops, strict=True)))
        shared = {
            drive.name: lifted.drive_force(i, lifts) - base.drive_force(i, lifts)
            for i, drive in enumerate(self.drives) if i not in seated.drives and isinstance(drive.contact, CamContact)
        }  # fmt: skip
        return {name: force for name, force in shared.items() if force > 0.0}


class Branch:
    """Motion of a train while certain stops are closed; dependent constraints are left out, cams before stops."""

    def __init__(self, train: RigidTrain, closed: Closed) -> None:
        self.train, self.closed = train, closed
        self.stops = [i for i, on in enumerate(closed) if on]
        rows = [*(train.stops[i].row for i in self.stops), *(drive.row for drive in train.drives)]
        independent = list(installed_rows(train.levers, len(train.force)))
        self._levers, self.kept = len(independent), list[int]()  # of the closed stops, then the cams
        for i, row in enumerate(rows):
            if is_independent(row, independent):
                independent.append(row)
                self.kept.append(i)
        self.drives = [i - len(self.stops) for i in self.kept if i >= len(self.stops)]
        self._rows = [rows[i] for i in self.kept]
        stiffness = train.stiffness / train.scale
        free = null_space_of_rows(np.vstack([*independent, stiffness]))
        self._elastic = stiffness + free.T @ free  # a motion that nothing determines does not take place

    def positions(self, lift: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return z, shape (m, d), and the forces of levers and kept constraints over the scale, for lifts (m, cams)."""
        levers, d = self.train.levers, len(self._elastic)
        values = self._constraint_values(np.array([self.train.stops[i].gap for i in self.stops]), lift)
        load = np.broadcast_to(self.train.load(self.closed), (len(lift), d))
        z, forces = np.zeros((len(lift), d)), np.zeros((len(lift), self._levers + len(self.kept)))
        for _ in range(_ITERATIONS):
            ends = [end.evaluate(z) for end in levers]
            targets = [(rows * z).sum(axis=1) - error for error, rows, _ in ends]
            solution = _solve(self._matrices(z), np.column_stack([load, *targets, values]))
            change, z, forces = np.abs(solution[:, :d] - z).max(initial=0.0), solution[:, :d], solution[:, d:]
            if not levers or change < _SLACK:
                break
        return z, forces

    def derivatives(self, z: FloatArray, slope: FloatArray, bend: FloatArray) -> FloatArray:
        """Return the derivatives of z by the cam angle for those of the lifts, shape (2, m, d)."""
        levers, d, matrices = self.train.levers, z.shape[1], self._matrices(z)
        zeros, curved = np.zeros(len(self.stops)), [np.zeros(len(z))] * self._levers
        first = _solve(matrices, np.column_stack([0.0 * z, *curved, self._constraint_values(zeros, slope)]))[:, :d]
        curved = [-end.evaluate(z)[2] * (first @ end.path) ** 2 for end in levers]
        second = _solve(matrices, np.column_stack([0.0 * z, *curved, self._constraint_values(zeros, bend)]))[:, :d]
        return np.array([first, second])

    def virtual_motions(self, z: FloatArray) -> FloatArray:
        """Return z per motion of each kept constraint, shape (m, d, kept); m is one without levers."""
        matrices, d = self._matrices(z), z.shape[1]
        unit = np.zeros((matrices.shape[-1], len(self.kept)))
        unit[d + self._levers :] = np.eye(len(self.kept))
        return np.linalg.solve(matrices, np.broadcast_to(unit, (len(matrices), *unit.shape)))[:, :d].astype(np.float64)

    def drive_force(self, drive: int, lift: FloatArray) -> float:
        """Return the static force of a cam at lifts of shape (1, cams), N; zero if the cam is left out."""
        column = self._column(len(self.stops) + drive)
        return 0.0 if column is None else -self.train.scale * float(self.positions(lift)[1][0, column])

    def drive_effect(self, drive: Drive, z: FloatArray, acting: FloatArray) -> FloatArray:
        """Return the work of forces on z, shape (m, d), per motion of a cam, shape (m,); one if it is left out."""
        constraint = len(self.stops) + self.train.drives.index(drive)
        if constraint not in self.kept:
            return np.ones(len(z))
        return (self.virtual_motions(z)[:, :, self.kept.index(constraint)] * acting).sum(axis=1)

    def fits(self, z: FloatArray, forces: FloatArray, lift: FloatArray) -> Bools:
        """Return at which instants nothing overlaps and every closed stop presses."""
        train, good = self.train, np.ones(len(z), dtype=bool)
        tension = RANK * (float(np.abs(train.force).max(initial=0.0)) / train.scale + _SLACK)
        for i, stop in enumerate(train.stops):
            good &= stop.gap - z @ stop.row >= -_CLOSED
            column = self._column(self.stops.index(i)) if self.closed[i] else None
            if column is not None:
                good &= forces[:, column] >= stop.push / train.scale - tension
        for i, drive in enumerate(train.drives):
            good &= np.abs(lift[:, i] - z @ drive.row) <= _CLOSED
        return good

    def check(self, z: FloatArray, forces: FloatArray, lift: FloatArray) -> None:
        """Refuse a position, shape (d,), that violates a contact beyond rounding."""
        train, largest = self.train, float(np.abs(forces).max(initial=0.0))
        missing = [abs(s - float(drive.row @ z)) for drive, s in zip(train.drives, lift.tolist(), strict=True)]
        overlap = [float(stop.row @ z) - stop.gap for stop in train.stops]
        columns = [(train.stops[i], self._column(k)) for k, i in enumerate(self.stops)]
        pulls = [
            column is not None and forces[column] < stop.push / train.scale - PULL * largest for stop, column in columns
        ]
        if max(*missing, *overlap, 0.0, 0.0) > _HELD_BACK or any(pulls):
            names = [f"contacts.{part.name}" for part in (*train.drives, *train.stops)]
            given = f"no position of the rigid train that suits {', '.join(names)}"
            why = "rigid members cannot yield"
            allowed = "followers at their lift, and seats and lashes that are open or press"
            remedy = "check directions and gaps, or use fidelity.model = beams"
            raise refuse(names[0], given, allowed, why, remedy)

    def _column(self, constraint: int) -> int | None:
        """Return the column of a constraint among the forces; None if it is left out."""
        return self._levers + self.kept.index(constraint) if constraint in self.kept else None

    def _constraint_values(self, stops: FloatArray, lift: FloatArray) -> FloatArray:
        """Return the values of the kept constraints, shape (m, kept)."""
        return np.column_stack([np.broadcast_to(stops, (len(lift), len(stops))), lift])[:, self.kept]

    def _matrices(self, z: FloatArray) -> FloatArray:
        """Return the matrices of equilibrium and constraints, one for all instants without levers."""
        levers, d = [end.evaluate(z)[1] for end in self.train.levers], z.shape[1]
        rows = [*levers, *self._rows]
        matrices = np.zeros((len(z) if levers else 1, d + len(rows), d + len(rows)))
        matrices[:, :d, :d] = self._elastic
        for i, row in enumerate(rows, start=d):
            matrices[:, i, :d] = matrices[:, :d, i] = row
        return matrices


def find_closed_stops(train: RigidTrain, lift: FloatArray) -> Closed:
    """Return which stops press at given lifts, shape (cams,).

    Newton's method on the equilibrium with slightly compliant stops: M. Hintermueller, K. Ito and K. Kunisch, SIAM J.
    Optim. 13 (2002) 865.
    """
    d, stops = len(train.force), train.stops
    elastic = train.stiffness / train.scale + _COMPLIANCE * np.eye(d)
    gaps = [stop.gap + (0.0 if stop.is_seat else _SLACK) for stop in stops]
    z, closed = np.zeros(d), tuple(stop.is_seat for stop in stops)
    visited: set[Closed] = set()
    for _ in range(_ITERATIONS):
        ends = [end.evaluate(z[None]) for end in train.levers]
        on = [i for i, is_closed in enumerate(closed) if is_closed]
        rows = [*(rows[0] for _, rows, _ in ends), *(stops[i].row for i in on), *(drive.row for drive in train.drives)]
        values = [*(float(rows[0] @ z - error[0]) for error, rows, _ in ends), *(gaps[i] for i in on), *lift.tolist()]
        C = np.array(rows).reshape(len(rows), d)
        compliance = np.repeat([0.0, _COMPLIANCE], [len(ends), len(rows) - len(ends)])
        matrix = np.block([[elastic, C.T], [C, -np.diag(compliance)]])
        solution = np.linalg.lstsq(matrix, np.concatenate([train.load(closed), values]))[0]
        change, z = float(np.abs(solution[:d] - z).max()), solution[:d].astype(np.float64)
        force = dict(zip(on, solution[d + len(ends) :].tolist(), strict=False))
        pressing = tuple(
            force[i] > stop.push / train.scale if i in force else float(stop.row @ z) > gaps[i]
            for i, stop in enumerate(stops)
        )
        if pressing == closed and (not ends or change < _SLACK):
            return closed
        if pressing != closed and pressing in visited:
            break
        closed = pressing
        visited.add(closed)
    return _try_closed_stops(train, lift) or closed


def _try_closed_stops(train: RigidTrain, lift: FloatArray) -> Closed | None:
    """Return the first set of closed stops that fits given lifts, by trial; None without one, or of too many."""
    if len(train.stops) > _MAX_TRIALS:
        return None
    for closed in product(*((stop.is_seat, not stop.is_seat) for stop in train.stops)):
        branch = Branch(train, closed)
        if branch.fits(*branch.positions(lift[None]), lift[None])[0]:
            return closed
    return None


def installed_rows(levers: Sequence[LeverEnd], d: int) -> FloatArray:
    """Return the rows of the lever ends as installed, shape (levers, d)."""
    return np.array([end.evaluate(np.zeros((1, d)))[1][0] for end in levers]).reshape(len(levers), d)


def null_space_of_rows(rows: FloatArray) -> FloatArray:
    """Return an orthonormal basis of the null space of rows, shape (k, d)."""
    _, values, vectors = np.linalg.svd(rows)
    return vectors[int(np.count_nonzero(values > RANK * float(values.max(initial=0.0)))) :]


def is_independent(row: FloatArray, others: Sequence[FloatArray]) -> bool:
    """Return whether a row is linearly independent of others."""
    if not others or not row.any():
        return bool(row.any())
    remainder = row - np.linalg.lstsq(np.array(others).T, row)[0] @ np.array(others)
    return bool(np.linalg.norm(remainder) > RANK * np.linalg.norm(row))


def _solve(matrices: FloatArray, right: FloatArray) -> FloatArray:
    """Return the solutions for given right sides, shape (m, n), of one or m matrices."""
    if len(matrices) == 1:
        return np.asarray(np.linalg.solve(matrices[0], right.T), dtype=float).T
    return np.linalg.solve(matrices, right[..., None])[..., 0].astype(np.float64)
