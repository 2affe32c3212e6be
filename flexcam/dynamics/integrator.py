"""Interface of an integrator and of its step, and stability and accuracy properties.

A new integrator is a module with one frozen dataclass of this kind. Its properties follow from the amplification matrix
of a mode: T. J. R. Hughes, The Finite Element Method (1987), ch. 9.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Callable
from typing import Protocol

import numpy as np

from flexcam.core import FloatArray
from flexcam.core.errors import InputError
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
    @abstractmethod
    def order(self) -> int:
        """Order of accuracy of displacement and velocity."""

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
        turn = float(np.angle(self._oscillating_eigenvalue(omega_dt, damping)))
        return omega_dt * math.sqrt(1.0 - damping**2) / turn - 1.0 if turn > 0.0 else math.inf

    def damping_ratio(self, omega_dt: float, damping: float = 0.0) -> float:
        """Return the damping ratio of a mode in a run: physical plus numerical damping.

        Decay per radian (Hughes, eq. 9.1.30); infinite if the mode does not oscillate.
        """
        pair = self._oscillating_eigenvalue(omega_dt, damping)
        turn = float(np.angle(pair))
        return math.log(1.0 / abs(pair)) / turn if turn > 0.0 else math.inf

    def stability_limit(self, damping: float = 0.0) -> float:
        """Return the stability limit of angular frequency times step, to 1e-12; infinite if unconditionally stable."""
        beyond = [x for x in _STEPS.tolist() if self.spectral_radius(x, damping) > _GROWTH_LIMIT]
        if not beyond:
            return math.inf
        low, high = 0.0, float(beyond[0])
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
