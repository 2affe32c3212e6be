"""Harmonics of a history over one revolution of the camshaft: its orders."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from flexcam.checks import finite_array, refuse
from flexcam.linalg import ComplexArray, FloatArray

_REVOLUTION = 2.0 * math.pi


@dataclass(frozen=True, eq=False)
class OrderSpectrum:
    """Orders of a history.

    Parameters
    ----------
    coefficients
        Complex amplitudes c_0 to c_count, shape (count + 1,): value = Re sum c_n exp(i n angle), as those of
        `flexcam.motion.harmonics`.
    gap
        By how much the history misses closing: the difference of its values at both ends, in its own unit. What does
        not close leaks into every order, by about ``gap / (pi n)``.
    """

    coefficients: ComplexArray
    gap: float

    @property
    def amplitudes(self) -> FloatArray:
        """Amplitudes from order 0 (the size of the mean), shape (count + 1,)."""
        return np.abs(self.coefficients)


def order_spectrum(angle: ArrayLike, values: ArrayLike, count: int) -> OrderSpectrum:
    """Return the orders of a history over one revolution.

    No window: a revolution is the period. The orders are those of the nearest trigonometric polynomial, weighted by the
    angle that every instant stands for, so that they are exact for one of degree `count` at any instants, and the
    discrete Fourier transform at even ones.
    """
    at = finite_array("angle", angle, (None,))
    history = finite_array("values", values, (len(at),))
    _checked(at, count)
    steps = np.diff(at)
    weights = 0.5 * (np.append(steps, 0.0) + np.append(0.0, steps))
    orders = np.arange(1, count + 1)
    waves = np.concatenate(
        [np.ones((len(at), 1)), np.cos(np.outer(at, orders)), np.sin(np.outer(at, orders))], axis=1
    )  # fmt: skip
    heavy = waves * weights[:, None]
    found = np.linalg.solve(heavy.T @ waves, heavy.T @ history)
    coefficients = np.append(found[:1].astype(np.complex128), found[1 : count + 1] - 1j * found[count + 1 :])
    return OrderSpectrum(coefficients, abs(float(history[-1] - history[0])))


def _checked(angle: FloatArray, count: int) -> None:
    if count < 1:
        raise refuse("count", count, "a whole number from 1")
    if len(angle) < 2 * count + 2:
        why = "an order needs two instants of its own"
        raise refuse("angle", f"{len(angle)} instants", f"{2 * count + 2} or more for {count} orders", why)
    steps, span = np.diff(angle), float(angle[-1] - angle[0])
    if (steps <= 0.0).any() or abs(span - _REVOLUTION) > 1.5 * float(steps.max()):
        raise refuse("angle", f"{math.degrees(span):.6g} deg", "rising angles over one revolution, 360 deg")
