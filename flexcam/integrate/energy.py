"""Energy balance of a run: what goes in, where it is, what is lost, and what does not add up.

Every quantity is computed from what it is, none as what is left of the others, but for the part that the time
integration itself takes from the linear system (numerical) and the closing residual::

    work = kinetic + strain + contact (each less its start) + dissipated + numerical + residual

Integrals over time are trapezoidal over the steps.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Protocol, runtime_checkable

import numpy as np

from flexcam.integrate.local import LocalForces, Schedule
from flexcam.integrate.step import Moment
from flexcam.linalg import FloatArray, operator
from flexcam.system import CamMotion, System

if TYPE_CHECKING:
    from scipy.sparse import csr_array

PARTS = ("work", "kinetic", "strain", "contact", "dissipated", "numerical", "residual")
"""Names of the balance's parts, in order."""


@runtime_checkable
class Storing(Protocol):
    """A local law that stores energy: it acts along what it senses, A = -G."""

    def stored(self, gap: FloatArray, angle: float) -> tuple[float, FloatArray]:
        """Return the energy stored, J, and the force at rest, shape (c,)."""
        ...


@dataclass(frozen=True, eq=False)
class _Rates:
    """Powers (W) and energies (J) of some instants, shape (m,) each, and the forces on the unknowns, shape (m, n)."""

    drive: FloatArray
    damped: FloatArray
    crushed: FloatArray
    kinetic: FloatArray
    strain: FloatArray
    contact: FloatArray
    applied: FloatArray
    displacement: FloatArray
    time: FloatArray

    def after(self, last: _Rates) -> _Rates:
        """Return the instants behind the last one of an earlier block."""
        names = self.__dataclass_fields__
        return _Rates(*(np.concatenate([getattr(last, n)[-1:], getattr(self, n)]) for n in names))


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
        self._last: _Rates | None = None
        self._sums = np.zeros(4)  # work, dissipated, numerical, and the energy at the start

    def block(self, moments: list[Moment], motion: CamMotion, schedule: Schedule, time: FloatArray) -> FloatArray:
        """Return the parts of the balance at the instants of a block, shape (m, 7), J."""
        new = self._rates(moments, motion, schedule, time)
        held = new.kinetic + new.strain + new.contact
        first = self._last is None
        if first:
            self._sums[3] = held[0]
        both = new if self._last is None else new.after(self._last)
        step = np.diff(both.time)
        work, damped, crushed = (_trapezoids(p, step) for p in (both.drive, both.damped, both.crushed))
        linear = both.kinetic + both.strain
        pushed = 0.5 * np.einsum("mn,mn->m", both.applied[1:] + both.applied[:-1], np.diff(both.displacement, axis=0))
        numerical = pushed - np.diff(linear) - damped
        gone = np.column_stack([work, damped + crushed, numerical])
        sums = self._sums[:3] + np.cumsum(np.vstack([np.zeros((int(first), 3)), gone]), axis=0)
        self._sums[:3], self._last = sums[-1], new
        residual = sums[:, 0] - (held - self._sums[3]) - sums[:, 1] - sums[:, 2]
        return np.column_stack([sums[:, 0], new.kinetic, new.strain, new.contact, sums[:, 1], sums[:, 2], residual])

    def _rates(self, moments: list[Moment], motion: CamMotion, schedule: Schedule, time: FloatArray) -> _Rates:
        d, v = (np.array([getattr(m, name) for m in moments]) for name in ("d", "v"))
        histories = self._system.load_histories(motion)
        drive = np.einsum("mk,mk->m", histories, v @ self._vectors.T)
        contact, crushed, prescribed = self._contacts(moments, d, v, schedule)
        nothing = np.zeros(len(moments))
        return _Rates(
            drive + prescribed, _quadratic(self._C, v) if self._damped else nothing, crushed,
            0.5 * _quadratic(self._M, v), 0.5 * _quadratic(self._K, d), contact,
            np.array([m.applied for m in moments]), d, time,
        )  # fmt: skip

    def _contacts(
        self, moments: list[Moment], d: FloatArray, v: FloatArray, schedule: Schedule
    ) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return the energy in the contacts, the power they dissipate, and the power that comes in through them."""
        energy, lost, drive = (np.zeros(len(moments)) for _ in range(3))
        sense, act = self._forces.sense.vectors, self._forces.act.vectors
        on_d, on_v, acted = d @ sense.T, v @ sense.T, v @ act.T
        for i, moment in enumerate(moments if self._forces.count else ()):
            gap = schedule.sense[i] @ on_d[i] + schedule.offset[i]
            moving = schedule.sense_rate[i] @ on_d[i] + schedule.offset_rate[i]
            rate = schedule.sense[i] @ on_v[i] + moving
            for law, part in self._forces.laws:
                force = moment.local[part]
                if isinstance(law, Storing):
                    stored, still = law.stored(gap[part], float(schedule.angle[i]))
                    energy[i] += stored
                    lost[i] += float((force - still) @ rate[part])
                    drive[i] += float(force @ moving[part])
                else:
                    drive[i] += float(force @ (schedule.act[i][part] @ acted[i]))
        return energy, lost, drive


def _quadratic(matrix: FloatArray | csr_array, rows: FloatArray) -> FloatArray:
    products = np.asarray(matrix @ rows.T, dtype=float)
    return np.einsum("mn,nm->m", rows, products)


def _trapezoids(power: FloatArray, step: FloatArray) -> FloatArray:
    return 0.5 * (power[1:] + power[:-1]) * step
