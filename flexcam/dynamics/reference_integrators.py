"""Reference integrators: Radau and DOP853 of scipy.

The unknowns are written as a first-order system: displacement, velocity and the internal states of the local forces. E.
Hairer and G. Wanner, Solving Ordinary Differential Equations II (1996), for Radau IIA; E. Hairer, S. P. Norsett and G.
Wanner, Solving Ordinary Differential Equations I (1993), for the rule of Dormand and Prince.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from flexcam.core import FloatArray
from flexcam.core.errors import InputError, positive, refuse
from flexcam.dynamics.collocation import collocation
from flexcam.dynamics.initial_acceleration import InitialAcceleration, massless_contact_error
from flexcam.dynamics.integrator import At, Method, NoConvergenceError, Stepper
from flexcam.dynamics.local_forces import LocalForces
from flexcam.dynamics.massless import MasslessMotions
from flexcam.dynamics.step_state import StepInputs, StepState
from flexcam.dynamics.system import System

_ORDERS = {"Radau": 5, "DOP853": 8}
_MAX_UNKNOWNS = 200
"""Maximum number of unknowns."""

_ABSOLUTE_TOLERANCE = 1e-15
"""Magnitude of a motion, m, rad or of a state, below which errors are ignored."""


@dataclass(frozen=True)
class ScipyIntegrator(Method):
    """Integrator of scipy, applied to every step with a given tolerance.

    Parameters
    ----------
    name
        ``"Radau"`` for stiff systems, ``"DOP853"`` for smooth ones.
    tolerance
        Relative local error.

    Examples
    --------
    >>> ScipyIntegrator("Radau").order
    5
    """

    name: Literal["Radau", "DOP853"]
    tolerance: float = 1e-9

    def __post_init__(self) -> None:
        if self.name not in _ORDERS:
            raise refuse("integrator", self.name, " or ".join(_ORDERS))
        positive("integrator.tolerance", self.tolerance, "")
        if not 1e-13 <= self.tolerance <= 1e-2:
            raise refuse("integrator.tolerance", self.tolerance, "1e-13 to 0.01")

    @property
    def order(self) -> int:
        """Order of the rule; the error is controlled by the tolerance."""
        return _ORDERS[self.name]

    def amplification(self, omega_dt: float, damping: float = 0.0) -> FloatArray:
        """Return the matrix that takes (d, dt v, dt^2 a) of one mode over a step: the exact one."""
        return collocation().amplification(omega_dt, damping)

    def stepper(self, system: System, forces: LocalForces, step: float, at: At) -> Stepper:
        """Return the stepper of a system for steps of one length."""
        return _ScipyStepper(system, forces, self, at)

    def refusal(self, system: System, step: float) -> InputError | None:
        """Return the error for contacts and dampers without mass, and for large systems."""
        if system.size > _MAX_UNKNOWNS:
            why, remedy = "the method is a slow check", "use bathe, or newmark with smaller steps"
            given = f"{self.name} with {system.size} unknowns"
            return refuse("run.integrator", given, f"at most {_MAX_UNKNOWNS}", why, remedy)
        return massless_contact_error(system, self.name)


class _ScipyStepper:
    """One call of scipy's integrator per step, with the step length of the last call as initial guess."""

    def __init__(self, system: System, forces: LocalForces, method: ScipyIntegrator, at: At) -> None:
        self._forces, self._method, self._at = forces, method, at
        self._light, self._starter, self._n = MasslessMotions(system), InitialAcceleration(system, forces), system.size

    def advance(self, now: StepState, to: StepInputs) -> StepState:
        """Return the next instant, as `Stepper` says."""
        from scipy.integrate import solve_ivp

        length = to.time - now.time
        first = None if now.stride is None else min(now.stride, length)
        solution = solve_ivp(
            self._rate, (now.time, to.time), np.concatenate([now.d, now.v, now.inner]),
            method=self._method.name, rtol=self._method.tolerance, atol=self._sizes(now, length), first_step=first,
        )  # fmt: skip
        if not solution.success:
            raise NoConvergenceError(list(dict.fromkeys(self._forces.names)) or ["the motion"])
        # The last internal step is cut by the end of the call.
        stride = float(np.diff(solution.t)[:-1].max()) if len(solution.t) > 2 else now.stride
        moment = self._moment(solution.y[:, -1], to)
        if self._light.any:
            v = self._light.place(moment.v, (moment.applied - now.applied) / length)
            moment = replace(moment, v=v, a=self._light.place(moment.a, np.zeros(self._n)))
        return replace(moment, iterations=int(solution.nfev), stride=stride)

    def _moment(self, y: FloatArray, to: StepInputs) -> StepState:
        n = self._n
        d = self._light.place(y[:n], to.load)
        return self._starter.restart(self._starter.update_forces(d, y[n : 2 * n], y[2 * n :], to))

    def _rate(self, time: float, y: FloatArray) -> FloatArray:
        to = self._at(time)
        moment = self._moment(y, to)
        reaction = self._forces.respond(moment.penetration, moment.rate, moment.inner, to.inputs, to.row)
        return np.concatenate([moment.v, moment.a, reaction.state_rate])

    def _sizes(self, now: StepState, length: float) -> FloatArray:
        """Return the absolute tolerance of every entry, relative to the largest motion so far."""
        largest = (float(np.abs(motion).max(initial=0.0)) * length**i for i, motion in enumerate((now.d, now.v, now.a)))
        size = max(*largest, _ABSOLUTE_TOLERANCE)
        inner = np.maximum(np.abs(now.inner), np.abs(now.penetration[self._forces.table.owners])) + _ABSOLUTE_TOLERANCE
        parts = [np.full(self._n, size), np.full(self._n, size / length), inner]
        return self._method.tolerance * np.concatenate(parts)


def radau(*, tolerance: float = 1e-9) -> ScipyIntegrator:
    """Return scipy's implicit rule Radau IIA of fifth order, for stiff systems.

    Parameters
    ----------
    tolerance
        Relative local error.
    """
    return ScipyIntegrator("Radau", tolerance)


def dop853(*, tolerance: float = 1e-9) -> ScipyIntegrator:
    """Return scipy's explicit rule of Dormand and Prince of eighth order, for smooth systems whose frequencies are low.

    Parameters
    ----------
    tolerance
        Relative local error.
    """
    return ScipyIntegrator("DOP853", tolerance)
