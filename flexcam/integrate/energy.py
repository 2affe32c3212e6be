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
from flexcam.linalg import FloatArray, operator
from flexcam.system import Observed, System

if TYPE_CHECKING:
    from scipy.sparse import csr_array

PARTS = ("work", "kinetic", "strain", "contact", "dissipated", "numerical", "residual")
"""Names of the balance's parts, in order."""


@dataclass(frozen=True, eq=False)
class _Held:
    """Energies of some instants, J, shape (m,), and what the work between them is computed from.

    `loads` are histories, `acted` the weights of the acting vectors, `still` the contacts' forces without their
    dissipation, `by_state` the derivatives of their energy by internal states, `changing` its part that depends on
    the cam angle, `carried` the part of the sensed rates that the cam alone causes.
    """

    angle: FloatArray
    kinetic: FloatArray
    strain: FloatArray
    contact: FloatArray
    d: FloatArray
    v: FloatArray
    loads: FloatArray
    acted: FloatArray
    force: FloatArray
    still: FloatArray
    gap: FloatArray
    rate: FloatArray
    carried: FloatArray
    states: FloatArray
    by_state: FloatArray
    changing: FloatArray
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
        self._M, self._C, self._K = (operator(m) for m in (system.mass, system.damping, system.stiffness))
        self._damped = bool(system.damping.values.any())
        self._vectors = system.load_vectors()
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
        moved = np.diff(both.d, axis=0)
        damped = _dot(_mean(both.v @ self._C), moved) if self._damped else np.zeros(len(moved))
        given = _dot(_mean(both.loads), moved @ self._vectors.T)
        # What a contact does: along its whole depth, and on the unknowns; the difference comes from the cam.
        deepened = np.diff(both.gap, axis=0)
        along = _dot(_mean(both.force), deepened)
        on_unknowns = _dot(_mean(both.acted), moved @ self._forces.act.vectors.T)
        crushed = _dot(_mean(both.force - both.still), deepened)
        crushed -= _dot(_mean(both.by_state), np.diff(both.states, axis=0))
        curved, turned = self._curved(both, deepened)
        impulse = both.impulse[1:]
        struck, impact_lost = _dot(impulse, _mean(both.carried)), _dot(impulse, _mean(both.rate))
        numerical = given + on_unknowns - np.diff(both.kinetic + both.strain) - damped + (struck - impact_lost) + curved
        work = given + along + on_unknowns + struck + turned
        return np.column_stack([work, damped + crushed + impact_lost, numerical])

    def _curved(self, both: _Held, deepened: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return what the mean force does beyond the curved one (by Simpson's rule), and what the cam's turning stores.

        The law of a contact may change with the cam angle, as with the cam's curvature: that energy comes from the cam.
        """
        angle, half = both.angle, _mean(both.states)
        middle = self._forces.stored(_mean(both.gap), half, 0.5 * (angle[1:] + angle[:-1]))
        curved = 2.0 / 3.0 * _dot(_mean(both.still) - middle.by_gap, deepened)
        later = self._forces.changing(both.gap[:-1], both.states[:-1], angle[1:])
        earlier = self._forces.changing(both.gap[1:], both.states[1:], angle[:-1])
        return curved, 0.5 * (later - both.changing[:-1] + both.changing[1:] - earlier)

    def _held(self, track: Track, seen: Observed, carried: FloatArray, schedule: Schedule) -> _Held:
        kept = self._forces.stored(seen.gaps, seen.states, schedule.angle)
        return _Held(
            schedule.angle, 0.5 * _quadratic(self._M, seen.velocity),
            0.5 * _quadratic(self._K, seen.displacement) + self._system.stored, kept.energy,
            seen.displacement, seen.velocity, seen.histories, (seen.forces @ schedule.acts) * schedule.act,
            seen.forces * self._forces.storing, kept.by_gap, seen.gaps, seen.rates, carried, seen.states, kept.by_state,
            kept.changing, track.impulse,
        )  # fmt: skip


def _mean(values: FloatArray) -> FloatArray:
    return 0.5 * (values[1:] + values[:-1])


def _dot(values: FloatArray, others: FloatArray) -> FloatArray:
    return np.einsum("mi,mi->m", values, others)


def _quadratic(matrix: FloatArray | csr_array, rows: FloatArray) -> FloatArray:
    products = np.asarray(matrix @ rows.T, dtype=float)
    return np.einsum("mn,nm->m", rows, products)
