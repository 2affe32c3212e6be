"""Reference integrators: the exact modal solution, and Radau and DOP853 of scipy.

Exact modal solution: loads are linear between the instants, and the modal response is computed with the matrix
exponential: N. C. Nigam and P. C. Jennings, Bull. Seismol. Soc. Am. 59 (1969); C. F. Van Loan, IEEE Trans. Autom.
Control 23 (1978), for the integrals of the load. The only error is the interpolation of the loads.

scipy: the unknowns are written as a first-order system: displacement, velocity and the internal states of the local
forces. E. Hairer and G. Wanner, Solving Ordinary Differential Equations II (1996), for Radau IIA; E. Hairer, S. P.
Norsett and G. Wanner, Solving Ordinary Differential Equations I (1993), for the rule of Dormand and Prince.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from flexcam.core import FloatArray, solve_eigenproblem
from flexcam.core.errors import InputError, positive, refuse
from flexcam.dynamics.implicit_step import NoConvergenceError
from flexcam.dynamics.initial_acceleration import InitialAcceleration, massless_contact_error
from flexcam.dynamics.integrator import At, Method, Stepper
from flexcam.dynamics.local_forces import LocalForces
from flexcam.dynamics.massless import MasslessMotions
from flexcam.dynamics.step_state import StepInputs, StepState
from flexcam.dynamics.system import System

_MAX_EXACT_UNKNOWNS = 600
"""Maximum number of unknowns."""

_COUPLED = 1e-9
"""Modal damping coupling, relative to the diagonal, that counts as zero."""

_NAME = "exact"


@dataclass(frozen=True)
class Exact(Method):
    """Exact response of every mode to loads that are linear between the instants.

    Examples
    --------
    >>> Exact().period_error(2.0) < 1e-12
    True
    """

    @property
    def order(self) -> int:
        """Order of accuracy for loads that are nonlinear between the instants; free vibration is exact."""
        return 2

    def amplification(self, omega_dt: float, damping: float = 0.0) -> FloatArray:
        """Return the matrix that takes (d, dt v, dt^2 a) of one mode over a step, as `Method` says."""
        mode = _Modes(np.array([omega_dt]), np.array([[2.0 * damping * omega_dt]]), 1.0)
        still, one = np.zeros(1), np.ones(1)
        moved = np.hstack([mode.advance(one, still, still, still), mode.advance(still, one, still, still)])
        pulled = -np.array([omega_dt**2, 2.0 * damping * omega_dt]) @ moved
        return np.column_stack([np.vstack([moved, pulled]), np.zeros(3)])

    def stepper(self, system: System, forces: LocalForces, step: float, at: At) -> Stepper:
        """Return the stepper of a system for steps of one length."""
        return _Stepper(system, step)

    def refusal(self, system: System, step: float) -> InputError | None:
        """Return the error for local forces, dampers without mass, and large systems."""
        if system.local_forces:
            names = ", ".join([*dict.fromkeys(force.name for force in system.local_forces)][:6])
            why = "the modal solution is exact only for loads that do not depend on the motion"
            return refuse("run.integrator", _NAME, f"a method that can integrate {names}", why, "use newmark or bathe")
        if system.size > _MAX_EXACT_UNKNOWNS:
            given = f"{_NAME} with {system.size} unknowns"
            return refuse(
                "run.integrator",
                given,
                f"at most {_MAX_EXACT_UNKNOWNS} unknowns",
                "the method uses all modes",
                "use newmark",
            )
        return massless_contact_error(system, _NAME)


class _Stepper:
    """All modes, then the massless motions, which mass and damping do not couple to them."""

    def __init__(self, system: System, step: float) -> None:
        self._light, self._dt = MasslessMotions(system), step
        basis = self._light.spread(np.eye(system.size)[self._light.kept][:, self._light.kept])
        M, C, K = (basis.T @ matrix.multiply(basis) for matrix in (system.mass, system.damping, system.stiffness))
        values, shapes = solve_eigenproblem(0.5 * (M + M.T), 0.5 * (K + K.T))
        self._omega = np.sqrt(values)
        self._shapes = basis @ shapes
        self._weigh = system.mass.multiply(self._shapes).T
        self._damping = shapes.T @ C @ shapes
        self._modes = _Modes(self._omega, self._damping, step)

    def advance(self, now: StepState, to: StepInputs) -> StepState:
        """Return the next instant, as `Stepper` says."""
        old, new = self._shapes.T @ now.applied, self._shapes.T @ to.load
        q, speed = self._modes.advance(self._weigh @ now.d, self._weigh @ now.v, old, new)
        d, v, a = (self._shapes @ one for one in (q, speed, new - self._damping @ speed - self._omega**2 * q))
        follow = (to.load - now.applied) / self._dt
        d, v = self._light.place(d, to.load), self._light.place(v, follow)
        return replace(now, time=to.time, d=d, v=v, a=a, applied=to.load, iterations=0)


class _Modes:
    """Modal coordinates over a step: one by one if damping does not couple them, else all in one group.

    A group's state is (s q, q') with s of the size of the frequency, so that both parts have similar size.
    """

    def __init__(self, omega: FloatArray, damping: FloatArray, step: float) -> None:
        size = len(omega)
        own = np.sqrt(np.abs(np.diag(damping)))
        beside = np.abs(damping - np.diag(np.diag(damping)))
        groups = size if (beside <= _COUPLED * own[:, None] * own).all() else 1
        self._shape = (groups, size // groups if groups else 0)
        self._scale = np.maximum(omega, 1.0 / step)
        k = self._shape[1]
        slowed = damping[None] if groups == 1 else np.diag(damping)[:, None, None]
        scale = self._scale.reshape(self._shape)
        whole = np.zeros((groups, 4 * k, 4 * k))
        one = np.arange(k)
        whole[:, one, k + one] = step * scale
        whole[:, k + one, one] = -step * (omega**2 / self._scale).reshape(self._shape)
        whole[:, k : 2 * k, k : 2 * k] = -step * slowed
        whole[:, k + one, 2 * k + one] = step
        whole[:, 2 * k + one, 3 * k + one] = 1.0
        self._over = _exponential(whole)[:, : 2 * k]

    def advance(
        self, q: FloatArray, speed: FloatArray, old: FloatArray, new: FloatArray
    ) -> tuple[FloatArray, FloatArray]:
        """Return coordinates and velocities one step later, for forces linear from old to new, (m,) each."""
        given = [one.reshape(self._shape) for one in (self._scale * q, speed, old, new - old)]
        state = np.einsum("gij,gj->gi", self._over, np.concatenate(given, axis=1))
        k = self._shape[1]
        return state[:, :k].ravel() / self._scale, state[:, k:].ravel()


def _exponential(matrices: FloatArray) -> FloatArray:
    from scipy.linalg import expm

    return np.asarray(expm(matrices), dtype=float)


def exact() -> Exact:
    """Return the exact integration of linear systems.

    Returns
    -------
    Exact
        It has no parameter.

    Examples
    --------
    >>> exact().order
    2
    """
    return Exact()


_ORDERS = {"Radau": 5, "DOP853": 8}
_MAX_SCIPY_UNKNOWNS = 200
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
        return exact().amplification(omega_dt, damping)

    def stepper(self, system: System, forces: LocalForces, step: float, at: At) -> Stepper:
        """Return the stepper of a system for steps of one length."""
        return _ScipyStepper(system, forces, self, at)

    def refusal(self, system: System, step: float) -> InputError | None:
        """Return the error for contacts and dampers without mass, and for large systems."""
        if system.size > _MAX_SCIPY_UNKNOWNS:
            why, remedy = "the method is a slow check", "use bathe, or newmark with smaller steps"
            return refuse(
                "run.integrator",
                f"{self.name} with {system.size} unknowns",
                f"at most {_MAX_SCIPY_UNKNOWNS}",
                why,
                remedy,
            )
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
        found = solve_ivp(
            self._rate, (now.time, to.time), np.concatenate([now.d, now.v, now.inner]),
            method=self._method.name, rtol=self._method.tolerance, atol=self._sizes(now, length), first_step=first,
        )  # fmt: skip
        if not found.success:
            raise NoConvergenceError(list(dict.fromkeys(self._forces.names)) or ["the motion"])
        # The last internal step is cut by the end of the call.
        stride = float(np.diff(found.t)[:-1].max()) if len(found.t) > 2 else now.stride
        moment = self._moment(found.y[:, -1], to)
        if self._light.any:
            v = self._light.place(moment.v, (moment.applied - now.applied) / length)
            moment = replace(moment, v=v, a=self._light.place(moment.a, np.zeros(self._n)))
        return replace(moment, iterations=int(found.nfev), stride=stride)

    def _moment(self, y: FloatArray, to: StepInputs) -> StepState:
        n = self._n
        d = self._light.place(y[:n], to.load)
        return self._starter.restart(self._starter.update_forces(d, y[n : 2 * n], y[2 * n :], to))

    def _rate(self, time: float, y: FloatArray) -> FloatArray:
        to = self._at(time)
        moment = self._moment(y, to)
        return np.concatenate([moment.v, moment.a, self._state_rate(moment, to)])

    def _state_rate(self, moment: StepState, to: StepInputs) -> FloatArray:
        answer = self._forces.respond(moment.penetration, moment.rate, moment.inner, to.schedule, to.row)
        return answer.state_rate

    def _sizes(self, now: StepState, length: float) -> FloatArray:
        """Return the absolute tolerance of every entry, relative to the largest motion so far."""
        largest = (float(np.abs(one).max(initial=0.0)) * length**i for i, one in enumerate((now.d, now.v, now.a)))
        size = max(*largest, _ABSOLUTE_TOLERANCE)
        inner = np.maximum(np.abs(now.inner), np.abs(now.penetration[self._forces.table.owners])) + _ABSOLUTE_TOLERANCE
        parts = [np.full(self._n, size), np.full(self._n, size / length), inner]
        return self._method.tolerance * np.concatenate(parts)


def radau(*, tolerance: float = 1e-9) -> ScipyIntegrator:
    """Return scipy's implicit rule Radau IIA of fifth order.

    Parameters
    ----------
    tolerance
        Relative local error.

    Returns
    -------
    ScipyIntegrator
        For stiff systems.

    Examples
    --------
    >>> radau().name
    'Radau'
    """
    return ScipyIntegrator("Radau", tolerance)


def dop853(*, tolerance: float = 1e-9) -> ScipyIntegrator:
    """Return scipy's explicit rule of Dormand and Prince of eighth order.

    Parameters
    ----------
    tolerance
        Relative local error.

    Returns
    -------
    ScipyIntegrator
        For smooth systems whose frequencies are low.

    Examples
    --------
    >>> dop853().order
    8
    """
    return ScipyIntegrator("DOP853", tolerance)
