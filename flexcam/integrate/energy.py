"""Energy balance of a run: what goes in, where it is, what is lost, and what does not add up.

Every quantity is computed from what it is, none as what is left of the others, but for the part that the time
integration itself takes from the linear system (numerical) and the closing residual::

    work = kinetic + strain + contact (each less its start) + dissipated + numerical + residual

Between two instants a force does its mean times the path: with the average acceleration that is what the time
integration itself does, so that a linear system closes to rounding, and what is left tells of the contacts' curvature.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from flexcam.checkpoint import Arrays, below, flattened
from flexcam.integrate.local import LocalForces, Schedule
from flexcam.integrate.moment import Track
from flexcam.linalg import FloatArray, Triplets, operator
from flexcam.system import Observed, System

if TYPE_CHECKING:
    from scipy.sparse import csr_array

PARTS = ("work", "kinetic", "strain", "contact", "dissipated", "numerical", "residual")
"""Names of the balance's parts, in order."""


@dataclass(frozen=True, eq=False)
class _Held:
    """Energies of some instants, J, shape (m,), and what the work between them is computed from.

    `damped` is what the damping holds back, per unknown; `pushes` are loads and forces, `paths` what they move, of all
    that acts but opposed contacts (`LocalForces.opposed`); `still` the contacts' forces without their dissipation,
    `by_state` the derivatives of their energy by internal states, `changing` its part that depends on the cam angle,
    `carried` the part of the sensed rates that the cam alone causes. What a system cannot have, has no columns.
    """

    angle: FloatArray
    kinetic: FloatArray
    strain: FloatArray
    contact: FloatArray
    d: FloatArray
    damped: FloatArray
    pushes: FloatArray
    paths: FloatArray
    force: FloatArray
    still: FloatArray
    gap: FloatArray
    states: FloatArray
    by_state: FloatArray
    changing: FloatArray
    rate: FloatArray
    carried: FloatArray
    impulse: FloatArray

    def after(self, last: _Held) -> _Held:
        """Return the instants behind the last one of an earlier block, `last` of that."""
        names = self.__dataclass_fields__
        return _Held(*(np.concatenate([getattr(last, n), getattr(self, n)]) for n in names))

    def last(self) -> _Held:
        """Return the last instant alone."""
        return _Held(*(getattr(self, n)[-1:] for n in self.__dataclass_fields__))


class EnergyAccount:
    """The balance, block by block.

    Parameters
    ----------
    system
        The system.
    forces
        Its local forces, stacked.
    """

    def __init__(self, system: System, forces: LocalForces) -> None:
        self._system, self._forces = system, forces
        self._M, self._C, self._K = (_Form(m) for m in (system.mass, system.damping, system.stiffness))
        self._damped = bool(system.damping.values.any())
        self._others = np.flatnonzero(~forces.opposed)
        self._storing = forces.storing if not forces.storing.all() else None
        self._strikes = not np.isnan(forces.restitution).all()
        # Vectors of the contacts that are not opposed, and whose force acts along each.
        self._acting = np.flatnonzero(forces.act.owner[self._others].any(axis=0))
        self._acted = forces.act.owner[:, self._acting].argmax(axis=0) if forces.count else self._acting
        self._pushed = np.concatenate([system.load_vectors(), forces.act.vectors[self._acting]])
        self._last: _Held | None = None
        self._sums = np.zeros(4)  # work, dissipated, numerical, and the energy at the start

    def block(self, track: Track, seen: Observed, carried: FloatArray, schedule: Schedule) -> FloatArray:
        """Return the parts of the balance at the instants of a block, shape (m, 7), J."""
        new = self._held(track, seen, carried, schedule)
        energy = new.kinetic + new.strain + new.contact
        first = self._last is None
        if first:
            self._sums[3] = energy[0]
        gone = self._gone(new if self._last is None else new.after(self._last))
        sums = self._sums[:3] + np.cumsum(np.vstack([np.zeros((int(first), 3)), gone]), axis=0)
        self._sums[:3], self._last = sums[-1], new.last()
        residual = sums[:, 0] - (energy - self._sums[3]) - sums[:, 1] - sums[:, 2]
        return np.column_stack([sums[:, 0], new.kinetic, new.strain, new.contact, sums[:, 1], sums[:, 2], residual])

    def state(self) -> Arrays:
        """Return what the balance of the next block depends on."""
        return {**flattened("held", self._last), "sums": self._sums.copy()}

    def restore(self, state: Arrays) -> None:
        """Go on from what `state` returned."""
        held = below("held", state)
        self._last, self._sums = (_Held(**held) if held else None), state["sums"].copy()

    def _gone(self, both: _Held) -> FloatArray:
        """Return work, dissipation and numerical loss between successive instants, shape (m - 1, 3)."""
        damped = _done(both.damped, np.diff(both.d, axis=0))
        given = _done(both.pushes, np.diff(both.paths, axis=0))
        # What a contact does along its whole depth comes from the unknowns, and where it is not opposed from the cam.
        deepened, others = np.diff(both.gap, axis=0), self._others
        moving = _done(both.force[:, others], deepened[:, others])
        taken = _done(both.force, deepened) - moving
        lossy = self._forces.lossy
        crushed = _done(both.force[:, lossy], deepened[:, lossy]) - _done(both.still[:, lossy], deepened[:, lossy])
        crushed -= _done(both.by_state, np.diff(both.states, axis=0))
        curved, turned = self._curved(both, deepened)
        impulse = both.impulse[1:]
        struck, impact_lost = _done(both.carried, impulse), _done(both.rate, impulse)
        numerical = given - taken - np.diff(both.kinetic + both.strain) - damped + (struck - impact_lost) + curved
        work = given + moving + struck + turned
        return np.column_stack([work, damped + crushed + impact_lost, numerical])

    def _curved(self, both: _Held, deepened: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return what the mean force does beyond the curved one (by Simpson's rule), and what the cam's turning stores.

        The law of a contact may change with the cam angle, as with the cam's curvature: that energy comes from the cam.
        """
        angle, half = both.angle, _mean(both.states)
        middle = self._forces.stored(_mean(both.gap), half, 0.5 * (angle[1:] + angle[:-1]))
        curved = 2.0 / 3.0 * (_done(both.still, deepened) - _dot(middle.by_gap, deepened))
        later = self._forces.changing(both.gap[:-1], both.states[:-1], angle[1:])
        earlier = self._forces.changing(both.gap[1:], both.states[1:], angle[:-1])
        return curved, 0.5 * (later - both.changing[:-1] + both.changing[1:] - earlier)

    def _held(self, track: Track, seen: Observed, carried: FloatArray, schedule: Schedule) -> _Held:
        kept, d = self._forces.stored(seen.gaps, seen.states, schedule.angle), track.d
        nothing = np.zeros((len(d), 0))
        struck = (seen.rates, carried, track.impulse) if self._strikes else (nothing,) * 3
        acted = seen.forces[:, self._acted] * schedule.act[:, self._acting]
        return _Held(
            schedule.angle, 0.5 * self._M.twice(track.v), 0.5 * self._K.twice(d) + self._system.stored, kept.energy,
            *((d, self._C.times(track.v)) if self._damped else (nothing, nothing)),
            np.hstack([seen.histories, acted]), (self._pushed @ d.T).T,
            seen.forces if self._storing is None else seen.forces * self._storing, kept.by_gap, seen.gaps,
            seen.states, kept.by_state, kept.changing, *struck,
        )  # fmt: skip


class _Form:
    """A matrix, all of it or its diagonal where it has nothing else."""

    def __init__(self, matrix: Triplets) -> None:
        self._diagonal = matrix.diagonal() if (matrix.rows == matrix.cols).all() else None
        self._whole: FloatArray | csr_array = operator(matrix) if self._diagonal is None else np.zeros((0, 0))

    def times(self, rows: FloatArray) -> FloatArray:
        """Return what it makes of every row, shape (m, n)."""
        if self._diagonal is not None:
            return rows * self._diagonal
        return np.asarray(rows @ self._whole, dtype=float)

    def twice(self, rows: FloatArray) -> FloatArray:
        """Return x A x of every row x, shape (m,)."""
        return np.square(rows) @ self._diagonal if self._diagonal is not None else _dot(self.times(rows), rows)


def _mean(values: FloatArray) -> FloatArray:
    return 0.5 * (values[1:] + values[:-1])


def _done(forces: FloatArray, paths: FloatArray) -> FloatArray:
    """Return what the mean of forces (m, k) does along the paths between them, shape (m - 1, k)."""
    return 0.5 * _dot(forces[1:] + forces[:-1], paths)


def _dot(values: FloatArray, others: FloatArray) -> FloatArray:
    return np.einsum("mi,mi->m", values, others)
