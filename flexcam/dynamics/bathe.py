"""Bathe's composite step."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from flexcam.core import FloatArray
from flexcam.dynamics.generalized_alpha import newmark
from flexcam.dynamics.integrator import At, ImplicitStage, Method, Stepper
from flexcam.dynamics.local_forces import LocalForces
from flexcam.dynamics.step_state import StepInputs, StepState
from flexcam.dynamics.system import System


@dataclass(frozen=True)
class Bathe(Method):
    """Composite step of Bathe: trapezoidal rule over half of it, three-point backward Euler over the whole.

    K. J. Bathe and M. M. I. Baig, Computers and Structures 83 (2005); K. J. Bathe, Computers and Structures 85 (2007).
    Second order, no parameter, high frequencies are damped out within a step; twice the work of one stage.

    Examples
    --------
    >>> round(Bathe().spectral_radius(1e6), 4)
    0.0
    """

    def amplification(self, omega_dt: float, damping: float = 0.0) -> FloatArray:
        """Return the matrix that takes (d, dt v, dt^2 a) of one mode over a step, as `Method` says."""
        halved = np.array([1.0, 0.5, 0.25])
        half = newmark().amplification(0.5 * omega_dt, damping) * halved / halved[:, None]
        start = np.eye(3)
        v = (4.0 * half[1] - start[1]) / 3.0
        d = (4.0 * half[0] - start[0] + v) / 3.0
        w, x = omega_dt**2, 2.0 * damping * omega_dt
        a = -(w * d + x * v) / (1.0 + x / 3.0 + w / 9.0)
        return np.array([d + a / 9.0, v + a / 3.0, a])

    def stepper(self, system: System, forces: LocalForces, step: float, at: At) -> Stepper:
        """Return the stepper of a system for steps of one length."""
        return _Stepper(system, forces, step, at)


class _Stepper:
    """Two stages, each with its own operator."""

    def __init__(self, system: System, forces: LocalForces, step: float, at: At) -> None:
        self._dt, self._at = step, at
        self._first = newmark().stepper(system, forces, 0.5 * step, at)
        self._second = ImplicitStage(system, forces, (step / 3.0) ** 2, step / 3.0, 0.5 * step)

    def advance(self, now: StepState, to: StepInputs) -> StepState:
        """Return the next instant, as `Stepper` says."""
        half = self._first.advance(now, self._at(to.time - 0.5 * self._dt))
        # a = (v0 - 4 vh + 3 v)/dt and v = (d0 - 4 dh + 3 d)/dt, solved for v and d.
        v = (4.0 * half.v - now.v) / 3.0
        d = (4.0 * half.d - now.d + self._dt * v) / 3.0
        new = self._second.solve(d, v, half, to)
        return replace(new, iterations=half.iterations + new.iterations)


def bathe() -> Bathe:
    """Return the composite step of Bathe."""
    return Bathe()
