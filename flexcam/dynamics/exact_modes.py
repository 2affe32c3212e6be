"""Exact integration of linear systems in modal coordinates; the only error is the interpolation of loads.

Loads are linear between the instants, and the modal response is computed with the matrix exponential: N. C. Nigam and
P. C. Jennings, Bull. Seismol. Soc. Am. 59 (1969); C. F. Van Loan, IEEE Trans. Autom. Control 23 (1978), for the
integrals of the load.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from flexcam.core import FloatArray, solve_eigenproblem
from flexcam.core.errors import InputError, refuse
from flexcam.dynamics.integrator import At, Method, Stepper
from flexcam.dynamics.local_forces import LocalForces
from flexcam.dynamics.massless import MasslessMotions
from flexcam.dynamics.step_state import StepInputs, StepState
from flexcam.dynamics.system import System

_MOST = 600
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
        """Return what advances a system by steps of one length, as `Method` says."""
        return _Stepper(system, step)

    def refusal(self, system: System, step: float) -> InputError | None:
        """Return the error for local forces, dampers without mass, and large systems."""
        if system.local_forces:
            names = ", ".join([force.name for force in system.local_forces][:6])
            why = "modes answer exactly to loads that do not depend on the motion"
            return refuse("run.integrator", _NAME, f"a method that takes {names}", why, "use newmark or bathe")
        if system.size > _MOST:
            given = f"{_NAME} with {system.size} unknowns"
            return refuse("run.integrator", given, f"at most {_MOST} unknowns", "all modes are carried", "use newmark")
        return MasslessMotions(system).contact_error(_NAME)


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
