"""One-step schemes of the generalized-alpha family: Newmark, HHT-alpha and generalized-alpha are its members.

Balance at a weighted instant, with ``d`` displacement, ``v`` velocity, ``a`` acceleration::

    (1 - am) M a1 + am M a0 + (1 - af) r1 + af r0 = 0,      r = C v + K d - f
    d1 = d0 + dt v0 + dt^2 ((1/2 - beta) a0 + beta a1)
    v1 = v0 + dt ((1 - gamma) a0 + gamma a1)

Sources: N. M. Newmark, J. Eng. Mech. Div. ASCE 85 (1959); H. M. Hilber, T. J. R. Hughes, R. L. Taylor, Earthq. Eng.
Struct. Dyn. 5 (1977); J. Chung, G. M. Hulbert, J. Appl. Mech. 60 (1993), eqs. 17 and 25.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from flexcam.checks import refuse
from flexcam.linalg import FloatArray

_ROUNDING = 1e-12
"""Of sums of the parameters, which are of size 1."""


@dataclass(frozen=True)
class Scheme:
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
        If a parameter makes no scheme: beta below zero, gamma below 1/2 (it would gain energy), a weight of 1.

    Examples
    --------
    >>> newmark().order
    2
    """

    beta: float
    gamma: float
    alpha_m: float = 0.0
    alpha_f: float = 0.0

    def __post_init__(self) -> None:
        if not 0.0 < self.beta <= 1.0:
            raise refuse(
                "integrator.beta", self.beta, "above 0 and up to 1", "beta = 0 is the explicit central difference"
            )
        if not 0.5 - _ROUNDING <= self.gamma + self.alpha_m - self.alpha_f <= 1.5:
            why = "below 1/2 the scheme feeds energy into every mode"
            raise refuse("integrator.gamma", self.gamma, "gamma + alpha_m - alpha_f of 1/2 or more", why)
        if not (self.alpha_m < 1.0 and 0.0 <= self.alpha_f < 1.0):
            raise refuse("integrator.alpha", (self.alpha_m, self.alpha_f), "alpha_m < 1, 0 <= alpha_f < 1")

    @property
    def order(self) -> int:
        """Order of accuracy of displacement and velocity."""
        return 2 if abs(self.gamma + self.alpha_m - self.alpha_f - 0.5) < _ROUNDING else 1

    def amplification(self, omega_dt: float, damping: float = 0.0) -> FloatArray:
        """Return the matrix that takes (d, dt v, dt^2 a) of one mode over a step.

        Parameters
        ----------
        omega_dt
            Angular frequency times step.
        damping
            Damping ratio.

        Returns
        -------
        ndarray
            Shape (3, 3).
        """
        w, x = omega_dt**2, 2.0 * damping * omega_dt
        new, old = 1.0 - self.alpha_f, self.alpha_f
        drift = np.array([1.0, 1.0, 0.5 - self.beta])
        speed = np.array([0.0, 1.0, 1.0 - self.gamma])
        inertia = np.array([0.0, 0.0, self.alpha_m])
        past = old * np.array([w, x, 0.0])
        pull = 1.0 - self.alpha_m + new * (x * self.gamma + w * self.beta)
        accel = -(inertia + past + new * (x * speed + w * drift)) / pull
        return np.array([drift + self.beta * accel, speed + self.gamma * accel, accel])

    def spectral_radius(self, omega_dt: float, damping: float = 0.0) -> float:
        """Return the largest modulus of the amplification matrix's eigenvalues; above 1 the mode grows.

        Parameters
        ----------
        omega_dt
            Angular frequency times step.
        damping
            Damping ratio.

        Returns
        -------
        float
            Growth of the mode in one step.
        """
        return _radius(self.amplification(omega_dt, damping), omega_dt)

    @property
    def balances(self) -> bool:
        """Whether the acceleration balances the forces of its own instant."""
        return not self.alpha_m and not self.alpha_f


@dataclass(frozen=True)
class Bathe:
    """Composite step of Bathe: trapezoidal rule over half of it, three-point backward Euler over the whole.

    K. J. Bathe and M. M. I. Baig, Computers and Structures 83 (2005); K. J. Bathe, Computers and Structures 85 (2007).
    Second order, no parameter, every high frequency gone within a step; twice the work of one stage.

    Examples
    --------
    >>> round(Bathe().spectral_radius(1e6), 4)
    0.0
    """

    @property
    def order(self) -> int:
        """Order of accuracy of displacement, velocity and acceleration."""
        return 2

    @property
    def balances(self) -> bool:
        """Whether the acceleration balances the forces of its own instant."""
        return True

    def amplification(self, omega_dt: float, damping: float = 0.0) -> FloatArray:
        """Return the matrix that takes (d, dt v, dt^2 a) of one mode over a step.

        Parameters
        ----------
        omega_dt
            Angular frequency times step.
        damping
            Damping ratio.

        Returns
        -------
        ndarray
            Shape (3, 3).
        """
        halved = np.array([1.0, 0.5, 0.25])
        half = Scheme(0.25, 0.5).amplification(0.5 * omega_dt, damping) * halved / halved[:, None]
        start = np.eye(3)
        v = (4.0 * half[1] - start[1]) / 3.0
        d = (4.0 * half[0] - start[0] + v) / 3.0
        w, x = omega_dt**2, 2.0 * damping * omega_dt
        a = -(w * d + x * v) / (1.0 + x / 3.0 + w / 9.0)
        return np.array([d + a / 9.0, v + a / 3.0, a])

    def spectral_radius(self, omega_dt: float, damping: float = 0.0) -> float:
        """Return the largest modulus of the amplification matrix's eigenvalues.

        Parameters
        ----------
        omega_dt
            Angular frequency times step.
        damping
            Damping ratio.

        Returns
        -------
        float
            Growth of the mode in one step.
        """
        return _radius(self.amplification(omega_dt, damping), omega_dt)


Method = Scheme | Bathe
"""What `solve` integrates with."""


def _radius(matrix: FloatArray, omega_dt: float) -> float:
    # Scaling the acceleration by the frequency keeps the matrix's entries of one size at large omega dt.
    scale = np.array([1.0, 1.0 / (1.0 + omega_dt), 1.0 / (1.0 + omega_dt) ** 2])
    return float(np.abs(np.linalg.eigvals(scale[:, None] * matrix / scale)).max())


def newmark(*, beta: float = 0.25, gamma: float = 0.5) -> Scheme:
    """Return Newmark's scheme; the default is the average acceleration, stable at any step without damping.

    Parameters
    ----------
    beta, gamma
        Newmark's parameters.

    Returns
    -------
    Scheme
        The scheme.

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

    Returns
    -------
    Scheme
        The scheme.

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

    Returns
    -------
    Scheme
        The scheme.

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


def bathe() -> Bathe:
    """Return the composite step of Bathe.

    Returns
    -------
    Bathe
        It has no parameter.

    Examples
    --------
    >>> bathe().order
    2
    """
    return Bathe()
