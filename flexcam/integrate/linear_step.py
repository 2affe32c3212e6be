"""The derivative of a step of the average acceleration, for disturbances of a motion."""

from __future__ import annotations

import numpy as np

from flexcam.integrate.led import led
from flexcam.integrate.massless import Massless
from flexcam.integrate.tangent import Linear
from flexcam.linalg import FloatArray
from flexcam.system import System


class LinearStep:
    """A step of the average acceleration, linearized: accelerations balance the forces at both of its ends.

    Motions without mass balance their forces at the new end; what the old one leaves on them is passed on by their
    springs, and the velocity of those that no damper slows is that over the step.

    Parameters
    ----------
    system
        The system.
    """

    def __init__(self, system: System) -> None:
        self._M, self._C, self._K = (one.dense() for one in (system.mass, system.damping, system.stiffness))
        self._light = Massless(system)
        found = led(system, average=True) if self._light.any else None
        self._free = None if found is None else found.free @ found.amounts[: found.free.shape[1]]

    def begun(self, at: Linear, given: FloatArray) -> FloatArray:
        """Return disturbances of a given start as a run begins with them: what has no mass is placed by its springs."""
        if not self._light.any:
            return given
        n = len(self._M)
        d, v, z = parts(given, n)
        push = at.by_state @ z - (at.damping - self._C) @ v - (at.stiffness - self._K) @ d
        return np.vstack([self._light.place(d, push), v, z])

    def carried(
        self, old: Linear, new: Linear, h: float, before: FloatArray, more: FloatArray | None = None
    ) -> FloatArray:  # fmt: skip
        """Return disturbances, shape (2n + s, m), after a step of length h.

        With ``d = d_free + A v``, ``z = z_free + F_d d + F_v v`` and ``M v + h/2 (C v + K d - P z) = p`` at the new
        end, v is the only unknown. `more` is what comes to d_free, p and z_free from elsewhere.
        """
        n = len(self._M)
        d, v, z = parts(before, n)
        push = self._M @ v - 0.5 * h * self._balanced(old.damping @ v + old.stiffness @ d - old.by_state @ z)
        d, whole = d + 0.5 * h * v, 0.5 * h * np.eye(n)
        if self._free is not None:
            d, whole = d - 0.5 * h * (self._free @ v), whole + 0.5 * h * self._free
        own = np.zeros((len(before) - 2 * n, 1))
        if more is not None:
            d, push, own = d + more[:n], push + more[n : 2 * n], more[2 * n :]
        z, by_d, by_v = _states(old, new, h, before, own)
        C, K = new.damping - new.by_state @ by_v, new.stiffness - new.by_state @ by_d
        right = push - 0.5 * h * (K @ d - new.by_state @ z)
        v = np.asarray(np.linalg.solve(self._M + 0.5 * h * (C + K @ whole), right), dtype=float)
        d = d + whole @ v
        return np.vstack([d, v, z + by_d @ d + by_v @ v])

    def impulse(self, old: FloatArray, new: FloatArray) -> FloatArray:
        """Return what a longer step adds to d, the momentum and z, per second, by the flows at both ends, (2n + s,)."""
        n, mean = len(self._M), 0.5 * (old + new)
        return np.concatenate([mean[:n], self._M @ mean[n : 2 * n], mean[2 * n :]])

    def passed(self, more: FloatArray) -> FloatArray:
        """Return what comes from the old end, without what it leaves on motions without mass."""
        n = len(self._M)
        return np.concatenate([more[:n], self._balanced(more[n : 2 * n]), more[2 * n :]])

    def _balanced(self, forces: FloatArray) -> FloatArray:
        return self._light.passed_on(forces) if self._light.any else forces


def _states(
    old: Linear, new: Linear, h: float, before: FloatArray, more: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return internal states after a step without the new motion, and their derivatives by its d and v.

    By the rule of `flexcam.system.force_laws.oil_column`: with ``z' = a (x - z)`` and x linear over the step,
    ``z1 = (1 - S) x1 + (S - E) x0 + E z0``, ``E = exp(-a h)`` and ``S = (1 - E)/(a h)``.
    """
    n = new.state_by_d.shape[1]
    d, _, z = parts(before, n)
    if not len(z):
        return z, new.state_by_d, new.state_by_v
    rate, begun = -np.diag(new.state_by_state)[:, None], -np.diag(old.state_by_state)[:, None]
    kept = np.exp(-rate * h)
    share = -np.expm1(-rate * h) / (rate * h)
    free = kept * z + (share - kept) * (old.state_by_d @ d) / begun + more
    return free, (1.0 - share) / rate * new.state_by_d, np.zeros_like(new.state_by_v)


def parts(state: FloatArray, n: int) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return displacements, velocities and internal states of n unknowns."""
    return state[:n], state[n : 2 * n], state[2 * n :]
