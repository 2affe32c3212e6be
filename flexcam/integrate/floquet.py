"""Floquet multipliers: whether small disturbances of a periodic motion grow from revolution to revolution.

The system is linearized about a motion: local forces give their tangents, which change with the cam angle, with what
is pressed and what is not, and with the axial force of a pushrod. A basis of disturbances is carried over one period by
the implicit midpoint rule; the eigenvalues of what becomes of it are the multipliers. Above 1 in modulus the motion is
unstable. A. H. Nayfeh and D. T. Mook, Nonlinear Oscillations (1979), ch. 5.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from flexcam.checks import refuse
from flexcam.integrate.generalized_alpha import newmark
from flexcam.integrate.massless import massless
from flexcam.integrate.method import Method
from flexcam.integrate.problem import Problem
from flexcam.integrate.solve import solve
from flexcam.integrate.tangent import Tangents
from flexcam.linalg import ComplexArray, FloatArray
from flexcam.response import RunFailedError, SaveAt

_MOST = 400
"""Unknowns up to which a basis of disturbances is carried along."""


@dataclass(frozen=True, eq=False)
class Floquet:
    """Multipliers of a periodic motion.

    Parameters
    ----------
    multipliers
        Largest first, complex, shape (2n,).
    shapes
        Displacements at the period's beginning that belong to them, complex, shape (n, 2n).
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
    """Return the Floquet multipliers of a motion over one period."""
    system, n = problem.system, problem.system.size
    if not 0 < n <= _MOST:
        raise refuse("system", f"{n} unknowns", f"1 to {_MOST}", "a basis of disturbances is carried along")
    if any(force.states for force in system.local_forces):
        raise refuse("system", "local forces with internal states", "none", "their disturbances are not followed")
    response = solve(problem, method or newmark(), save=SaveAt(field_every=1))
    if not response.status.ok:
        raise RunFailedError(response.status)
    times, fields = response.field_time, response.fields
    d, v = (0.5 * (one[1:] + one[:-1]) for one in (fields.displacement, fields.velocity))
    tangents = Tangents(system, problem.drive.at(0.5 * (times[1:] + times[:-1])), d, v)
    carried = _carried(tangents, massless(system), len(times) - 1, problem.step)
    values, vectors = np.linalg.eig(carried)
    order = np.argsort(-np.abs(values))
    period = float(response.field_time[-1] - response.field_time[0])
    return Floquet(values[order], vectors[:n, order], period, system.names, response.stats.events)


def _carried(tangents: Tangents, light: FloatArray, instants: int, step: float) -> FloatArray:
    """Return what becomes of a unit disturbance of every displacement and velocity, shape (2n, 2n).

    By the implicit midpoint rule, each step with the one tangent of its middle: where a contact's stiffness comes and
    goes from step to step, no acceleration of the old law is carried into the new one. Motions without mass have no
    motion of their own: they are left where the middle of the step has them.
    """
    M, n = tangents.mass, len(tangents.mass)
    x, v = np.hstack([np.eye(n), np.zeros((n, n))]), np.hstack([np.zeros((n, n)), np.eye(n)])
    for i in range(instants):
        C, K = tangents.at(i)
        middle = np.linalg.solve(2.0 * M + step * C + 0.5 * step**2 * K, 2.0 * (M @ v) - step * (K @ x))
        new, speed = x + step * middle, 2.0 * middle - v
        x = new - 0.5 * step * (light @ (light.T @ middle))
        v = speed - light @ (light.T @ (speed - middle))
    return np.vstack([x, v])
