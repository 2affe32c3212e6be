"""Rates of motions without mass: led by displacements and velocities, which the balance gives.

Newmark's formulas tie velocities and accelerations to the displacement, wherever that comes from. By the average
acceleration what a start or a kink leaves in those of a motion without mass would alternate for ever, with
accelerations that grow: A. Cardona and M. Geradin, Comput. Struct. 33 (1989). Here such motions have formulas of their
own. No displacement depends on it: the balance takes velocities of what is damped alone, and no accelerations.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import lru_cache
from typing import TypeVar

import numpy as np

from flexcam.integrate.massless import massless
from flexcam.integrate.moment import Moment
from flexcam.linalg import FloatArray, SingularMatrixError, Triplets
from flexcam.system import System

BETA, GAMMA = 1.0, 1.5
"""Newmark's parameters of these motions: the velocity is that of the parabola through the last three instants, the
acceleration their second difference, so that a start or a kink is forgotten after two steps."""

Number = TypeVar("Number", float, FloatArray)
"""A number or one per motion."""


def massless_rates(change: Number, v: Number, a: Number, h: float) -> tuple[Number, Number]:
    """Return velocity and acceleration of a motion without mass from its change of displacement over a step."""
    new = (change / h - v - (0.5 - BETA) * h * a) / (BETA * h)
    return v + h * ((1.0 - GAMMA) * a + GAMMA * new), new


@dataclass(frozen=True, eq=False)
class Led:
    """Motions without mass, of unit stiffness.

    Parameters
    ----------
    free
        Those that no damper slows, as columns, shape (n, k).
    slow
        Those that one does and whose acceleration leads to nothing, shape (n, l).
    amounts
        Of all of them in a displacement, shape (k + l, n).
    """

    free: FloatArray
    slow: FloatArray
    amounts: FloatArray

    def led(self, now: Moment, new: Moment, step: float) -> Moment:
        """Return an instant with their rates by its displacements, velocities and the instant a step before."""
        k = self.free.shape[1]
        change, v, a, v1, a1 = (self.amounts @ np.column_stack([new.d - now.d, now.v, now.a, new.v, new.a])).T
        pushed = (v1 - v) / step
        moving, pushed[:k] = massless_rates(change[:k], v[:k], a[:k], step)
        more = self.free @ (pushed - a1)[:k] + self.slow @ (pushed - a1)[k:]
        return replace(new, v=new.v + self.free @ (moving - v1[:k]), a=new.a + more)


@lru_cache(maxsize=1)
def led(system: System, *, average: bool) -> Led | None:
    """Return the motions of a system whose rates are led; None where there are none."""
    found = massless(system)
    if not found.shape[1]:
        return None
    unit = unit_stiff(found, system.stiffness)
    times, turned = slowed(unit, system.damping)
    free, slow = unit @ turned[:, times == 0.0], unit @ turned[:, (times != 0.0) & average]
    both = np.hstack([free, slow])
    return Led(free, slow, system.stiffness.times_all(both).T) if both.shape[1] else None


def unit_stiff(motions: FloatArray, stiffness: Triplets) -> FloatArray:
    """Return motions mixed so that the stiffness is 1 for each and couples none."""
    try:
        L = np.linalg.cholesky(motions.T @ stiffness.times_all(motions))
    except np.linalg.LinAlgError:
        raise SingularMatrixError(tuple(np.abs(motions).argmax(axis=0).tolist())) from None
    return np.asarray(np.linalg.solve(L, motions.T).T, dtype=float)


def slowed(unit: FloatArray, damping: Triplets) -> tuple[FloatArray, FloatArray]:
    """Return by how much dampers slow motions of unit stiffness."""
    within = unit.T @ damping.times_all(unit)
    size = np.abs(unit).T @ replace(damping, values=np.abs(damping.values)).times_all(np.abs(unit))
    if not (within - np.diag(np.diag(within))).any():
        times, turned = np.diag(within), np.eye(len(within))
    else:
        times, turned = np.linalg.eigh(0.5 * (within + within.T))
    rounding = 64.0 * np.finfo(float).eps * np.abs(size).max(initial=0.0)
    return np.where(np.abs(times) <= rounding, 0.0, times), turned
