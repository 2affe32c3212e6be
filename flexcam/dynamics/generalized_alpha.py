"""One-step schemes of the generalized-alpha family: Newmark, HHT-alpha and generalized-alpha.

Equation of motion at a weighted instant, with ``d`` displacement, ``v`` velocity, ``a`` acceleration::

    (1 - am) M a1 + am M a0 + (1 - af) r1 + af r0 = 0,      r = C v + K d - f
    d1 = d0 + dt v0 + dt^2 ((1/2 - beta) a0 + beta a1)
    v1 = v0 + dt ((1 - gamma) a0 + gamma a1)

Sources: N. M. Newmark, J. Eng. Mech. Div. ASCE 85 (1959); H. M. Hilber, T. J. R. Hughes, R. L. Taylor, Earthq. Eng.
Struct. Dyn. 5 (1977); J. Chung, G. M. Hulbert, J. Appl. Mech. 60 (1993), eqs. 17 and 25.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, TypeVar

import numpy as np

from flexcam.core import FloatArray, LongArray, select_storage
from flexcam.core.errors import refuse
from flexcam.dynamics.integrator import At, ImplicitStage, Method, Stepper
from flexcam.dynamics.local_forces import LocalForces
from flexcam.dynamics.massless import find_massless_rates
from flexcam.dynamics.step_state import StepInputs, StepState
from flexcam.dynamics.system import System

_ROUNDING = 1e-12
"""Rounding of sums of the parameters, which are of size 1."""

_TRAPEZOIDAL = 1.0 / 12.0
"""Error of the trapezoidal rule in a step, divided by h^2 times the change of the slope."""


Number = TypeVar("Number", float, FloatArray, LongArray)
"""A number or one per mode."""


def predict(
    q: Number, v: Number, a: Number, h: float, beta: Any, gamma: Any  # noqa: ANN401 - numbers or one per mode
) -> tuple[Number, Number]:  # fmt: skip
    """Return displacement and velocity at the end of a step h, s, without the new acceleration (Newmark's formulas)."""
    return q + h * v + (0.5 - beta) * h * h * a, v + (1.0 - gamma) * h * a


@dataclass(frozen=True)
class Scheme(Method):
    """Parameters of a one-step scheme; made by `newmark`, `hht` or `generalized_alpha`.

    Parameters
    ----------
    beta, gamma
        Newmark's parameters.
    alpha_m, alpha_f
        Weights of the old instant in the inertia and in the other forces.

    Raises
    ------
    InputError
        If a parameter is invalid: beta not above zero or above 1, gamma below 1/2 (energy growth), or a weight of 1.
    """

    beta: float
    gamma: float
    alpha_m: float = 0.0
    alpha_f: float = 0.0

    def __post_init__(self) -> None:
        if not 0.0 < self.beta <= 1.0:
            remedy = "use central-difference for the explicit rule with beta = 0" if self.beta == 0.0 else ""
            raise refuse("integrator.beta", self.beta, "a value above 0 and up to 1", "", remedy)
        if not 0.5 - _ROUNDING <= self.gamma + self.alpha_m - self.alpha_f <= 1.5:
            why = "below 1/2 the scheme feeds energy into every mode"
            raise refuse("integrator.gamma", self.gamma, "gamma + alpha_m - alpha_f of 1/2 or more", why)
        if not (self.alpha_m < 1.0 and 0.0 <= self.alpha_f < 1.0):
            raise refuse("integrator.alpha", (self.alpha_m, self.alpha_f), "alpha_m < 1, 0 <= alpha_f < 1")

    @property
    def order(self) -> int:
        """Order of accuracy of displacement and velocity."""
        return 2 if abs(self.gamma + self.alpha_m - self.alpha_f - 0.5) < _ROUNDING else 1

    @property
    def is_collocated(self) -> bool:
        """True if the acceleration satisfies the equation of motion at its own instant."""
        return not self.alpha_m and not self.alpha_f

    @property
    def average(self) -> bool:
        """True if the scheme is the average acceleration: a step then depends only on the sum of both accelerations."""
        return (self.beta, self.gamma, self.alpha_m, self.alpha_f) == (0.25, 0.5, 0.0, 0.0)

    @property
    def velocity_error(self) -> float:
        """Error of a step in the velocity, that of the trapezoidal rule, if the displacement is more accurate.

        At beta = 1/6 the displacement equals the series used for the error estimate, while the velocity does not.
        """
        return _TRAPEZOIDAL if self.beta < 1.0 / 6.0 + _TRAPEZOIDAL - _ROUNDING else 0.0

    def effective_mass(
        self, mass: FloatArray, damping: FloatArray, stiffness: FloatArray, step: float
    ) -> FloatArray:  # fmt: skip
        """Return the effective modal mass ``(1 - am) m + (1 - af)(gamma h c + beta h^2 k)``."""
        new = 1.0 - self.alpha_f
        return (1.0 - self.alpha_m) * mass + new * (self.gamma * step * damping + self.beta * step**2 * stiffness)

    @property
    def overshoot(self) -> float:
        """Displacement over dt^2 times the initial acceleration that does not follow from the velocities.

        With a1 from the velocity formula it is ``d1 = d0 + dt v0 + beta/gamma dt (v1 - v0) + o dt^2 a0`` with ``o = 1/2
        - beta/gamma``. For motions that decay within a step, such as an impact against a large damper, only the last
        term remains, which grows with a0.
        """
        return abs(0.5 - self.beta / self.gamma)

    def amplification(self, omega_dt: float, damping: float = 0.0) -> FloatArray:
        """Return the matrix that takes (d, dt v, dt^2 a) of one mode over a step, as `Method` says."""
        return family_matrix(self.beta, self.gamma, omega_dt, damping, self.alpha_m, self.alpha_f)

    def stepper(self, system: System, forces: LocalForces, step: float, at: At) -> Stepper:
        """Return the stepper of a system for steps of one length."""
        return _Stepper(system, forces, self, step)


def family_matrix(
    beta: float, gamma: float, omega_dt: float, damping: float, alpha_m: float = 0.0, alpha_f: float = 0.0
) -> FloatArray:
    """Return the amplification matrix of a member of the family, whose beta may be zero here."""
    w, x = omega_dt**2, 2.0 * damping * omega_dt
    new, old = 1.0 - alpha_f, alpha_f
    unit: FloatArray = np.eye(3)
    drift, speed = predict(unit[0], unit[1], unit[2], 1.0, beta, gamma)
    inertia = np.array([0.0, 0.0, alpha_m])
    old_forces = old * np.array([w, x, 0.0])
    effective = 1.0 - alpha_m + new * (x * gamma + w * beta)
    accel = -(inertia + old_forces + new * (x * speed + w * drift)) / effective
    return np.array([drift + beta * accel, speed + gamma * accel, accel])


class _Stepper:
    def __init__(self, system: System, forces: LocalForces, scheme: Scheme, step: float) -> None:
        self._scheme, self._dt = scheme, step
        self._M, self._C, self._K = map(select_storage, (system.mass, system.damping, system.stiffness))
        new_m, new_f = 1.0 - scheme.alpha_m, 1.0 - scheme.alpha_f
        self._stage = ImplicitStage(system, forces, scheme.beta * step**2, scheme.gamma * step, step, new_m, new_f)
        self._massless = find_massless_rates(system, average=scheme.average)

    def advance(self, now: StepState, to: StepInputs) -> StepState:
        """Return the next instant, as `Stepper` says."""
        s, dt, old = self._scheme, self._dt, None
        d, v = predict(now.d, now.v, now.a, dt, s.beta, s.gamma)
        if s.alpha_f or s.alpha_m:
            old = s.alpha_f * (now.applied - self._K @ now.d - self._C @ now.v) - s.alpha_m * (self._M @ now.a)
        new = self._stage.solve(d, v, now, to, old)
        return new if self._massless is None else self._massless.update_rates(now, new, dt)


def newmark(*, beta: float = 0.25, gamma: float = 0.5) -> Scheme:
    """Return Newmark's scheme; the default is the average acceleration, unconditionally stable without damping.

    Parameters
    ----------
    beta, gamma
        Newmark's parameters.

    Raises
    ------
    InputError
        If beta is not above zero or is above 1, or if gamma is below 1/2, at which energy grows.

    Examples
    --------
    >>> round(newmark().spectral_radius(10.0), 9)
    1.0
    """
    return Scheme(beta, gamma)


def hht(*, alpha: float = -0.05) -> Scheme:
    """Return the scheme of Hilber, Hughes and Taylor.

    Parameters
    ----------
    alpha
        From -1/3 (most damping of high frequencies) to 0 (Newmark's average acceleration).

    Raises
    ------
    InputError
        If alpha is out of range.

    Examples
    --------
    >>> round(hht(alpha=-0.1).spectral_radius(1e6), 5)
    0.81818
    """
    if not -1.0 / 3.0 <= alpha <= 0.0:
        raise refuse("integrator.alpha", alpha, "-1/3 to 0", "outside it the scheme is not unconditionally stable")
    return Scheme((1.0 - alpha) ** 2 / 4.0, 0.5 - alpha, 0.0, -alpha)


def generalized_alpha(*, rho_inf: float = 0.9) -> Scheme:
    """Return the generalized-alpha scheme chosen by its damping of infinitely high frequencies.

    Parameters
    ----------
    rho_inf
        Spectral radius at infinity: 1 keeps every mode, 0 removes the highest in one step.

    Raises
    ------
    InputError
        If rho_inf is out of range.

    Examples
    --------
    >>> round(generalized_alpha(rho_inf=0.8).spectral_radius(1e6), 3)
    0.8
    """
    if not 0.0 <= rho_inf <= 1.0:
        raise refuse("integrator.rho_inf", rho_inf, "0 to 1", "it is the factor on the highest mode per step")
    alpha_m, alpha_f = (2.0 * rho_inf - 1.0) / (rho_inf + 1.0), rho_inf / (rho_inf + 1.0)
    return Scheme((1.0 - alpha_m + alpha_f) ** 2 / 4.0, 0.5 - alpha_m + alpha_f, alpha_m, alpha_f)
