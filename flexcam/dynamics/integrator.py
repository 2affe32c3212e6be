"""Interface of an integrator and of its step, its stability and accuracy properties, and the common implicit stage.

A new integrator is a module with one frozen dataclass of this kind. Its properties follow from the amplification matrix
of a mode: T. J. R. Hughes, The Finite Element Method (1987), ch. 9. An implicit step consists of stages with one
operator ``S = w_m M + w_f (c_v C + c_d K)`` each, factorized once for the whole run, because neither the step nor the
tangent outside the local forces changes; the local forces follow from a small iteration (`local_newton`).
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Callable
from typing import Protocol

import numpy as np

from flexcam.core import Factor, FloatArray, Triplets, factorize, select_storage
from flexcam.core.errors import InputError
from flexcam.dynamics.force_laws import (
    ANSWER,
    BASE,
    BEGIN,
    FREE_PENETRATION,
    FREE_RATE,
    NEW_STATE,
    OWN,
    PENETRATION,
    RATE,
    SPAN,
    STATE,
    TRIAL,
)
from flexcam.dynamics.local_forces import LocalForces
from flexcam.dynamics.step_state import StepInputs, StepState
from flexcam.dynamics.system import System

At = Callable[[float], StepInputs]
"""Function that returns the prescribed inputs at a time, s."""

_GROWTH_LIMIT = 1.0 + 1e-7
"""Spectral radius that counts as growth: a double eigenvalue of 1 is accurate to half the digits."""

_STEPS = np.geomspace(1e-3, 1e6, 181)
"""Values of angular frequency times step in the search for the stability limit."""


class Stepper(Protocol):
    """Advances a system by one step."""

    def advance(self, now: StepState, to: StepInputs) -> StepState:
        """Return the next instant for its prescribed inputs; `NoConvergenceError` if the local iteration fails."""
        ...


class Method(ABC):
    """Integration method, created by `newmark`, `hht`, `generalized_alpha`, `bathe` and others.

    Its properties are those of a mode by angular frequency times step, `omega_dt`, and damping ratio (below 1).
    """

    @property
    def order(self) -> int:
        """Order of accuracy of displacement and velocity; 2 unless a method overrides it."""
        return 2

    @property
    def is_collocated(self) -> bool:
        """True if the acceleration satisfies the equation of motion at its own instant."""
        return True

    @property
    def locates_contacts(self) -> bool:
        """True if steps end where a contact opens or closes; they always end at impacts with restitution."""
        return True

    @property
    def velocity_error(self) -> float:
        """Error of a step not visible in its displacement, divided by h^2 times the change of the acceleration."""
        return 0.0

    @abstractmethod
    def amplification(self, omega_dt: float, damping: float = 0.0) -> FloatArray:
        """Return the matrix that takes (d, dt v, dt^2 a) of one mode over a step, shape (3, 3)."""

    @abstractmethod
    def stepper(self, system: System, forces: LocalForces, step: float, at: At) -> Stepper:
        """Return the stepper of a system for steps of one length, s.

        `at` returns the prescribed inputs at a time between the instants. Raises `SingularMatrixError` if some motion
        has neither mass, damping nor stiffness.
        """

    def refusal(self, system: System, step: float) -> InputError | None:
        """Return the reason why the method cannot integrate a system with a step, s; None if it can."""
        return None

    def spectral_radius(self, omega_dt: float, damping: float = 0.0) -> float:
        """Return the spectral radius of the amplification matrix; above 1 the mode grows."""
        return float(np.abs(self._eigenvalues(omega_dt, damping)).max())

    def period_error(self, omega_dt: float, damping: float = 0.0) -> float:
        """Return the relative period elongation of a mode; infinite if it does not oscillate."""
        angle = float(np.angle(self._oscillating_eigenvalue(omega_dt, damping)))
        return omega_dt * math.sqrt(1.0 - damping**2) / angle - 1.0 if angle > 0.0 else math.inf

    def damping_ratio(self, omega_dt: float, damping: float = 0.0) -> float:
        """Return the damping ratio of a mode in a run: physical plus numerical damping.

        Decay per radian (Hughes, eq. 9.1.30); infinite if the mode does not oscillate.
        """
        eigenvalue = self._oscillating_eigenvalue(omega_dt, damping)
        angle = float(np.angle(eigenvalue))
        return math.log(1.0 / abs(eigenvalue)) / angle if angle > 0.0 else math.inf

    def stability_limit(self, damping: float = 0.0) -> float:
        """Return the stability limit of angular frequency times step, to 1e-12; infinite if unconditionally stable."""
        unstable = [x for x in _STEPS.tolist() if self.spectral_radius(x, damping) > _GROWTH_LIMIT]
        if not unstable:
            return math.inf
        low, high = 0.0, float(unstable[0])
        while high - low > 1e-12 * high:
            middle = 0.5 * (low + high)
            low, high = (low, middle) if self.spectral_radius(middle, damping) > _GROWTH_LIMIT else (middle, high)
        return low

    def _oscillating_eigenvalue(self, omega_dt: float, damping: float) -> complex:
        """Return the eigenvalue of the oscillating pair: the one of largest angle."""
        values = self._eigenvalues(omega_dt, damping)
        return complex(values[int(np.argmax(values.imag))])

    def _eigenvalues(self, omega_dt: float, damping: float) -> np.ndarray[tuple[int], np.dtype[np.complex128]]:
        # Scaling the acceleration by the frequency keeps the matrix's entries of one size at large omega dt.
        scale = np.array([1.0, 1.0 / (1.0 + omega_dt), 1.0 / (1.0 + omega_dt) ** 2])
        matrix = scale[:, None] * self.amplification(omega_dt, damping) / scale
        return np.asarray(np.linalg.eigvals(matrix), dtype=complex)


class NoConvergenceError(ArithmeticError):
    """The iteration for the named local forces did not converge."""

    def __init__(self, forces: list[str]) -> None:
        super().__init__(", ".join(forces))
        self.forces = forces


class ImplicitStage:
    """An implicit stage: ``d = d^ + c_d a``, ``v = v^ + c_v a``, and the weighted equation of motion for a.

    `to_d`, s^2, and `to_v`, s, are c_d and c_v; `step`, s, is that of the internal states; the weights are those of the
    new instant in the inertia and in the other forces. `inverse` factorizes S and raises `SingularMatrixError` if some
    motion has neither mass, damping nor stiffness.
    """

    def __init__(
        self, system: System, forces: LocalForces, to_d: float, to_v: float, step: float,
        weight_m: float = 1.0, weight_f: float = 1.0, inverse: Callable[[Triplets], Factor] = factorize,
    ) -> None:  # fmt: skip
        self._forces, self._to_d, self._to_v, self._step, self._weight = forces, to_d, to_v, step, weight_f
        self._slope = to_v / to_d if to_d else 0.0
        self._C, self._K = select_storage(system.damping), select_storage(system.stiffness)
        self._damped = bool(system.damping.values.any())
        S = system.mass.scale(weight_m) + system.damping.scale(weight_f * to_v)
        self._S = inverse(S + system.stiffness.scale(weight_f * to_d) if to_d else S)
        # Response of all unknowns to each acting vector, and its sensed part: the low-rank update.
        self._by_act = self._S.solve(forces.act.vectors.T) * weight_f
        give = (forces.sense.vectors @ self._by_act).T
        self._give = np.array([to_d * give, to_v * give])

    def solve(
        self, d: FloatArray, v: FloatArray, now: StepState, to: StepInputs, old: FloatArray | None = None
    ) -> StepState:
        """Return the new instant from d^, v^ and the weighted forces of the old instant, shape (n,) each."""
        right = self._weight * (to.load - self._K @ d)
        if self._damped:
            right = right - self._weight * (self._C @ v)
        if old is not None:
            right = right + old
        a = self._S.solve(right)
        d, v = d + self._to_d * a, v + self._to_v * a
        if self._forces.count == 0:
            return StepState(to.time, d, v, a, to.load, now.local, now.penetration, now.rate, now.inner)
        iterations = self._find_forces(d, v, now, to)
        local, states = self._forces.workspace.local, self._forces.workspace.states
        weights = local[TRIAL] @ to.inputs.acting_matrix(to.row)
        a_local = self._by_act @ weights
        applied = to.load + weights @ self._forces.act.vectors
        return StepState(
            to.time, d + self._to_d * a_local, v + self._to_v * a_local, a + a_local, applied, local[TRIAL].copy(),
            local[PENETRATION].copy(), local[RATE].copy(), states[NEW_STATE].copy(), iterations=iterations,
        )  # fmt: skip

    def _find_forces(self, d: FloatArray, v: FloatArray, now: StepState, to: StepInputs) -> int:
        """Find the local forces for the motion without them; return the iterations."""
        forces, work, table = self._forces, self._forces.workspace, self._forces.table
        inputs, i, local = to.inputs, to.row, self._forces.workspace.local
        sensing, sensing_rate = inputs.sensing_matrix(i), inputs.sensing_rate_matrix(i)
        on_d, on_v = forces.sense.vectors @ d, forces.sense.vectors @ v
        local[FREE_PENETRATION] = sensing @ on_d + inputs.offset[i]
        local[FREE_RATE] = sensing @ on_v + sensing_rate @ on_d + inputs.offset_rate[i]
        local[TRIAL] = local[BASE] = now.local
        local[OWN] = -1.0
        by_d, by_v = (give.T @ inputs.acting_matrix(i).T for give in self._give)
        work.compliance[0], work.compliance[1] = (sensing @ by_d).T, (sensing @ by_v + sensing_rate @ by_d).T
        work.states[STATE], work.states[BEGIN] = now.inner, now.penetration[table.owners]
        work.states[SPAN] = self._step
        iterations = forces.functions["solve_local"](
            table.laws, np.array([0, len(table.laws)]), table.constants, forces.places, forces.no_reach, self._give,
            inputs.rows, i, 1, 0, self._slope, local, work.tangent, work.states, work.active, work.compliance,
            work.matrix,
        )  # fmt: skip
        if iterations == 0:
            raise NoConvergenceError(unconverged_forces(forces.names, local))
        return int(iterations)


def unconverged_forces(names: list[str], local: FloatArray) -> list[str]:
    """Return the names of the local forces with the largest difference from their laws."""
    errors = np.abs(local[TRIAL] - local[ANSWER])
    return [name for name, error in zip(names, errors, strict=True) if error >= 0.1 * errors.max()]
