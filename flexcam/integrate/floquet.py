"""Floquet multipliers: whether small disturbances of a periodic motion grow from revolution to revolution.

A basis of disturbances is carried over one period by the derivatives of the steps themselves (`monodromy`); the
eigenvalues of what becomes of it are the multipliers. Above 1 in modulus the motion is unstable. A. H. Nayfeh and D. T.
Mook, Nonlinear Oscillations (1979), ch. 5. Unknowns in which nothing moves are not left out: a disturbance in them
may grow as well, as beside a straight member under a pulsating load.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from flexcam.checks import refuse
from flexcam.integrate.generalized_alpha import newmark
from flexcam.integrate.method import Method
from flexcam.integrate.monodromy import LARGEST, revolution
from flexcam.integrate.problem import Problem
from flexcam.integrate.within import within
from flexcam.linalg import ComplexArray


@dataclass(frozen=True, eq=False)
class Floquet:
    """Multipliers of a periodic motion.

    Parameters
    ----------
    multipliers
        Largest first, complex, shape (2m + s,): of m unknowns integrated and s internal states of local forces.
    shapes
        Displacements of all unknowns at the period's beginning that belong to them, complex, shape (n, 2m + s).
    period
        s.
    names
        Of the unknowns.
    events
        How often contacts open or close within the period. With some, large multipliers tell of chatter: small
        differences of the times of bounces grow, as those of a bouncing ball do.
    """

    multipliers: ComplexArray
    shapes: ComplexArray
    period: float
    names: tuple[str, ...]
    events: int = 0

    @property
    def growth(self) -> float:
        """Rate at which the largest disturbance grows, 1/s; negative where it dies out."""
        return math.log(max(abs(complex(self.multipliers[0])), np.finfo(float).tiny)) / self.period

    def stable(self, tolerance: float = 1e-5) -> bool:
        """Tell whether no multiplier is beyond 1 by more than a tolerance.

        A free motion has a double multiplier of 1, of which rounding leaves half the digits and fewer.
        """
        return bool(abs(self.multipliers[0]) <= 1.0 + tolerance)

    def moving(self, count: int = 3) -> list[str]:
        """Return the names of the unknowns that move most in the largest disturbance."""
        order: list[int] = np.argsort(-np.abs(self.shapes[:, 0])).tolist()
        return [self.names[i] for i in order[:count]]


def floquet(problem: Problem, method: Method | None = None) -> Floquet:
    """Return the Floquet multipliers of a motion over one period.

    Parameters
    ----------
    problem
        One period, from the state that returns behind it.
    method
        By which the motion is found; disturbances of it follow the average acceleration. None for that as well.

    Returns
    -------
    Floquet
        The multipliers.

    Raises
    ------
    InputError
        If there are no unknowns, or too many to carry a disturbance of each.
    RunFailedError
        If the run of the period breaks off.
    """
    basis = problem.basis
    inside = problem if basis is None else within(problem, basis)
    n = inside.system.size
    if not 0 < n <= LARGEST:
        raise refuse("system", f"{n} unknowns", f"1 to {LARGEST}", "a basis of disturbances is carried along")
    found = revolution(inside, method or newmark(), lambda: False)
    values, vectors = np.linalg.eig(found.derivative)
    order = np.argsort(-np.abs(values))
    shapes = np.asarray(vectors[:n, order], dtype=complex)
    if basis is not None:
        real, imaginary = (np.asarray(part(shapes.T), dtype=float) for part in (np.real, np.imag))
        shapes = (basis.spread(real) + 1j * basis.spread(imaginary)).T
    values = np.asarray(values[order], dtype=complex)
    return Floquet(values, shapes, problem.step * problem.steps, problem.system.names, found.events)
