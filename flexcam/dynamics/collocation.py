"""Exponential collocation: exact for the linear part of a system, of fourth order in its local forces.

In modal coordinates each mode is integrated exactly under a force that is a parabola over the step. The parabola passes
through the forces at the beginning, the middle and the end of the step (the points of Lobatto), which agree there with
loads, damping between the modes and local forces. A step covers two output steps. M. Hochbruck and A. Ostermann,
Exponential integrators, Acta Numerica 19 (2010), sec. 2.2, for exponential collocation; E. Hairer and G. Wanner,
Solving Ordinary Differential Equations II (1996), sec. IV.5, for Lobatto's points.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from flexcam.core import FloatArray
from flexcam.core.errors import refuse
from flexcam.dynamics.generalized_alpha import newmark
from flexcam.dynamics.integrator import At, Method, Stepper
from flexcam.dynamics.local_forces import LocalForces
from flexcam.dynamics.system import System

_PARABOLA = np.array([[1.0, 0.0, 0.0], [-3.0, 4.0, -1.0], [4.0, -8.0, 4.0]])
"""Value and the first two derivatives, by the length of the step, at the beginning of the parabola through the values
at beginning, middle and end."""

_AT_POINTS = np.array([[[1.0, x, 0.5 * x * x], [0.0, 1.0, x], [0.0, 0.0, 1.0]] for x in (0.5, 1.0)]) @ _PARABOLA
"""The same at middle and end, shape (2, 3, 3)."""


@dataclass(frozen=True)
class Collocation(Method):
    """Exponential collocation in Lobatto's points, see `flexcam.dynamics.collocation`.

    Examples
    --------
    >>> abs(Collocation().period_error(2.0)) < 1e-12
    True
    """

    @property
    def order(self) -> int:
        """Order of accuracy of displacement and velocity while no contact opens or closes."""
        return 4

    @property
    def locates_contacts(self) -> bool:
        """False: steps end only at impacts with restitution."""
        return False

    def amplification(self, omega_dt: float, damping: float = 0.0) -> FloatArray:
        """Return the matrix that takes (d, dt v, dt^2 a) of one mode over an output step, as `Method` says."""
        x = 2.0 * damping * omega_dt
        coefficients = stage_coefficients(np.ones(1), np.array([x]), np.array([omega_dt**2]), 2.0)[0, :2, :2, 0]
        motion = np.column_stack([coefficients, np.zeros(2)])
        return np.vstack([motion, -np.array([omega_dt**2, x]) @ motion])

    def stepper(self, system: System, forces: LocalForces, step: float, at: At) -> Stepper:
        """Return the stepper of a system without unknowns; for others the method needs modes and compiled code."""
        if system.size:
            raise refuse("run.integrator.method", "collocation", "newmark", "the direct solver engine has no modes")
        return newmark().stepper(system, forces, step, at)


def stage_coefficients(
    mass: FloatArray, damping: FloatArray, stiffness: FloatArray, length: float | FloatArray
) -> FloatArray:  # fmt: skip
    """Return the coefficients of a step of each of n modes, of one length or one per mode, s, shape (2, 3, 5, n).

    First axis: middle and end of the step. Second axis: displacement, velocity, acceleration. Third axis: displacement
    and velocity at the beginning, forces at beginning, middle and end. The acceleration is by displacement and velocity
    of the same instant. A mode without mass follows its damper, and without both its spring.

    Examples
    --------
    A free mass under a constant force of one:

    >>> end = stage_coefficients(np.ones(1), np.zeros(1), np.zeros(1), 2.0)[1]
    >>> bool(abs(end[0, 2:].sum() - 2.0) < 1e-14)
    True
    """
    coefficients, length = np.zeros((2, 3, 5, len(mass))), np.broadcast_to(length, mass.shape)
    heavy = mass != 0.0
    damped = ~heavy & (damping != 0.0)
    static = ~heavy & ~damped
    coefficients[..., heavy] = _modes_with_mass(mass[heavy], damping[heavy], stiffness[heavy], length[heavy])
    if damped.any():
        coefficients[..., damped] = _modes_with_damper(damping[damped], stiffness[damped], length[damped])
    coefficients[:, :, 2:, static] = _parabola_weights(length[static]) / stiffness[static]
    return coefficients


def _modes_with_mass(m: FloatArray, c: FloatArray, k: FloatArray, length: FloatArray) -> FloatArray:
    rates = np.zeros((len(m), 5, 5))  # of q, length v, and the force with its derivatives, by time over length
    rates[:, 0, 1] = rates[:, 2, 3] = rates[:, 3, 4] = 1.0
    rates[:, 1, :3] = np.stack([-(length**2) * k / m, -length * c / m, length**2 / m], axis=1)
    motion = _over_step(rates)
    coefficients = np.zeros((2, 3, 5, len(m)))
    coefficients[:, :2] = motion.transpose(1, 2, 3, 0)
    coefficients[:, 0, 1] *= length
    coefficients[:, 1, [0, 2, 3, 4]] /= length
    coefficients[:, 2, 0], coefficients[:, 2, 1] = -k / m, -c / m
    coefficients[:, 2, 2:] = _parabola_weights(length)[:, 0] / m
    return coefficients


def _modes_with_damper(c: FloatArray, k: FloatArray, length: FloatArray) -> FloatArray:
    rates = np.zeros((len(c), 4, 4))  # of q, and the force with its derivatives, by time over length
    rates[:, 1, 2] = rates[:, 2, 3] = 1.0
    rates[:, 0, :2] = np.stack([-length * k / c, length / c], axis=1)
    motion = _over_step(rates)[:, :, 0].transpose(1, 2, 0)
    coefficients = np.zeros((2, 3, 5, len(c)))
    coefficients[:, 0, 0], coefficients[:, 0, 2:] = motion[:, 0], motion[:, 1:]
    coefficients[:, 1] = -coefficients[:, 0] * (k / c)
    coefficients[:, 2, 1] = -k / c
    coefficients[:, 1:, 2:] += _parabola_weights(length)[:, :2] / c
    return coefficients


def _over_step(rates: FloatArray) -> FloatArray:
    """Return the motion at middle and end, shape (n, 2, rows, columns); the last columns are by the three forces."""
    from scipy.linalg import expm

    half = np.asarray(expm(0.5 * rates), dtype=float)
    motion = np.stack([half, half @ half], axis=1)
    motion[..., -3:] = motion[..., -3:] @ _PARABOLA
    return motion[:, :, :-3]


def _parabola_weights(length: FloatArray) -> FloatArray:
    """Return value, slope and second derivative of the parabola at middle and end by its values at three points.

    For n lengths, s, the shape is (2, 3, 3, n).
    """
    return _AT_POINTS[..., None] / np.stack([np.ones_like(length), length, length**2])[:, None]


def collocation() -> Collocation:
    """Return the exponential collocation."""
    return Collocation()
