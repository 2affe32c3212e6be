"""Periodic lifts: spline with equally spaced knots, and sum of harmonics."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from flexcam.cams.lift_event import Event, unique_angles
from flexcam.core import ComplexArray, FloatArray
from flexcam.core.errors import finite_array, refuse

if TYPE_CHECKING:
    from scipy.interpolate import BSpline

DEGREE = 5
_REVOLUTION = 2.0 * math.pi
_GRID = np.linspace(0.0, _REVOLUTION, 7201)
_AT_ONCE = 64  # number of harmonics evaluated together: ten thousand would need tens of GB


def spline_knots(count: int) -> FloatArray:
    """Return the knots of the periodic B-splines of degree 5, which begin and end outside of the revolution."""
    return _REVOLUTION / count * np.arange(-DEGREE, count + DEGREE + 1, dtype=np.float64)


class _SmoothLift(ABC):
    """Lift without joints."""

    @property
    def joints(self) -> tuple[float, ...]:
        """Cam angles where a derivative up to the fourth may jump: none."""
        return ()

    @property
    def height(self) -> float:
        """Largest lift, m, with a relative accuracy of 1e-9."""
        return self._height

    @cached_property
    def _height(self) -> float:
        at = float(_GRID[np.argmax(self(_GRID))])
        return float(self(at + np.linspace(-1.0, 1.0, 2001) * (_GRID[1] - _GRID[0])).max())

    @abstractmethod
    def __call__(self, angle: FloatArray, order: int = 0) -> FloatArray: ...


@dataclass(frozen=True, eq=False)
class PeriodicSpline(_SmoothLift):
    """Lift over a revolution as a spline of degree 5 with equally spaced knots and continuous fourth derivative."""

    coefficients: FloatArray  #: m, shape (n,), one per knot, 12 or more

    def __post_init__(self) -> None:
        values = finite_array("coefficients", self.coefficients, (None,))
        if len(values) < 2 * (DEGREE + 1):
            raise refuse("coefficients", f"{len(values)} values", f"{2 * (DEGREE + 1)} or more")
        object.__setattr__(self, "coefficients", values)

    def __call__(self, angle: FloatArray, order: int = 0) -> FloatArray:
        """Return the derivative of the given order (0 to 4) by the cam angle (rad), m/rad^order, shape as `angle`."""
        return np.asarray(self._derivatives[order](np.mod(angle, _REVOLUTION)), dtype=float)

    @cached_property
    def _derivatives(self) -> tuple[BSpline[np.float64], ...]:
        from scipy.interpolate import BSpline

        around = np.append(self.coefficients, self.coefficients[:DEGREE])
        spline = BSpline(spline_knots(len(self.coefficients)), around, DEGREE)
        return tuple(spline.derivative(order) if order else spline for order in range(DEGREE))


@dataclass(frozen=True)
class HarmonicLift(_SmoothLift):
    """Lift as a mean and a few harmonics of the cam angle, which bounds the excitation spectrum.

    C. Li, Cam motion simulation and optimization (2014), eq. 5.
    """

    mean: float  #: m
    #: `cosine`, `sine`: amplitudes a_n and b_n of cos(n angle) and sin(n angle), m, n from 1, as many of both
    cosine: tuple[float, ...]
    sine: tuple[float, ...]

    def __post_init__(self) -> None:
        if len(self.cosine) != len(self.sine) or not self.cosine:
            given = f"{len(self.cosine)} and {len(self.sine)} values"
            raise refuse("cosine, sine", given, "as many of both, one or more")
        if not np.isfinite([self.mean, *self.cosine, *self.sine]).all():
            raise refuse("mean, cosine, sine", "numbers that are not finite", "finite numbers")

    @classmethod
    def of(cls, amplitudes: ComplexArray) -> HarmonicLift:
        """Return the lift Re sum c_n exp(i n angle) of complex amplitudes c_n, n from 0, m."""
        cosine, sine = amplitudes[1:].real.tolist(), (-amplitudes[1:].imag).tolist()
        return cls(float(amplitudes[0].real), tuple(cosine), tuple(sine))

    def with_delay(self, angle: float) -> HarmonicLift:
        """Return the same lift later by a cam angle, rad."""
        n, amplitude = self._amplitudes
        return HarmonicLift.of(np.append(self.mean, amplitude * np.exp(-1j * angle * n)))

    @cached_property
    def _amplitudes(self) -> tuple[FloatArray, ComplexArray]:
        """Orders and complex amplitudes: lift = mean + Re sum c_n exp(i n angle)."""
        n = np.linspace(1.0, len(self.cosine), len(self.cosine))
        return n, np.array(self.cosine) - 1j * np.array(self.sine)

    def __call__(self, angle: FloatArray, order: int = 0) -> FloatArray:
        """Return the derivative of the given order (0 to 4) by the cam angle (rad), m/rad^order, shape as `angle`."""
        angle = np.asarray(angle, dtype=float)
        n, amplitude = self._amplitudes
        turned = np.exp(1j * angle[..., None] * n) @ ((1j * n) ** order * amplitude)
        return np.asarray(turned.real + (self.mean if order == 0 else 0.0), dtype=float)


def harmonics(event: Event, count: int, order: int = 0) -> ComplexArray:
    """Return the harmonics of an event's lift or of its derivative."""
    points, weights = np.polynomial.legendre.leggauss(8)
    even = np.linspace(0.0, _REVOLUTION, max(361, 2 * count + 1))
    edges = np.concatenate([unique_angles(np.concatenate([even[:-1], event.joints])), [_REVOLUTION]])
    half = 0.5 * np.diff(edges)
    angle = (edges[:-1] + half)[:, None] + half[:, None] * points
    values = (half[:, None] * weights * event(angle, order)).ravel()
    parts = np.array_split(np.arange(count + 1), count // _AT_ONCE + 1)
    swung = np.concatenate([np.exp(-1j * np.outer(n, angle.ravel())) @ values for n in parts])
    amplitude = np.asarray(swung / math.pi, dtype=np.complex128)
    amplitude[0] *= 0.5
    return amplitude


def harmonic_rows(angle: FloatArray, count: int) -> FloatArray:
    """Return 1, the cosines and the sines of the multiples of angles up to a count, shape (n, 2 count + 1)."""
    turned = np.outer(angle, np.arange(1, count + 1))
    return np.hstack([np.ones((len(angle), 1)), np.cos(turned), np.sin(turned)])


@dataclass(frozen=True, eq=False)
class OrderSpectrum:
    """Order spectrum of a time history."""

    #: complex amplitudes c_0 to c_count, shape (count + 1,): value = Re sum c_n exp(i n angle)
    coefficients: ComplexArray
    #: difference of the values at both ends, in their own unit; it leaks into every order by about gap/(pi n)
    gap: float

    @property
    def amplitudes(self) -> FloatArray:
        """Amplitudes from order 0 (the size of the mean), shape (count + 1,)."""
        return np.abs(self.coefficients)


def order_spectrum(angle: ArrayLike, values: ArrayLike, count: int) -> OrderSpectrum:
    """Return the order spectrum of a history over one revolution.

    No window is applied because a revolution is the period. The orders are those of the least-squares trigonometric
    polynomial, weighted by the angle of each sample. They are exact for a polynomial of degree `count` at any samples,
    and equal the discrete Fourier transform for equally spaced ones.
    """
    at = finite_array("angle", angle, (None,))
    history = finite_array("values", values, (len(at),))
    if count < 1:
        raise refuse("count", count, "a whole number from 1")
    if len(at) < 2 * count + 2:
        why = "each order needs two instants"
        raise refuse("angle", f"{len(at)} instants", f"{2 * count + 2} or more for {count} orders", why)
    steps, span = np.diff(at), float(at[-1] - at[0])
    if (steps <= 0.0).any() or abs(span - _REVOLUTION) > 1.5 * float(steps.max()):
        raise refuse("angle", f"{math.degrees(span):.6g} deg", "rising angles over one revolution, 360 deg")
    weights = 0.5 * (np.append(steps, 0.0) + np.append(0.0, steps))
    waves = harmonic_rows(at, count)
    heavy = waves * weights[:, None]
    found = np.linalg.solve(heavy.T @ waves, heavy.T @ history)
    coefficients = np.append(found[:1].astype(np.complex128), found[1 : count + 1] - 1j * found[count + 1 :])
    return OrderSpectrum(coefficients, abs(float(history[-1] - history[0])))
