"""Motion laws: a normalized rise from 0 to 1 over 0 to 1 with its derivatives; reversed laws and ramps."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise
from typing import Protocol

import numpy as np
from numpy.polynomial.polynomial import polyder, polyval

from flexcam.core import FloatArray
from flexcam.core.errors import positive, refuse


class Law(Protocol):
    """Normalized motion law s(z), s(0) = 0 and s(1) = 1.

    A law is a frozen dataclass with its parameters as fields. At a jump of a derivative, the value is the right limit
    (at z = 1 the left limit).
    """

    @property
    def breaks(self) -> tuple[float, ...]:
        """Positions inside 0 to 1 where a derivative jumps."""
        ...

    def __call__(self, z: FloatArray, order: int = 0) -> FloatArray:
        """Return the derivative of the given order (0 to 4) at positions z from 0 to 1, shape as `z`."""
        ...


class SmoothLaw:
    """Base class of laws whose derivatives up to the fourth are continuous."""

    @property
    def breaks(self) -> tuple[float, ...]:
        """Positions of inner jumps: none."""
        return ()


def linear(z: FloatArray, order: int) -> FloatArray:
    """Return a derivative of z itself: z, 1 or 0."""
    return (z, np.ones_like(z))[order] if order < 2 else np.zeros_like(z)


_POINTS = 16


def quadrature(breaks: tuple[float, ...], panels: int = 64) -> list[tuple[FloatArray, FloatArray]]:
    """Return Gauss points and weights of panels that contain no joint inside."""
    points, weights = np.polynomial.legendre.leggauss(_POINTS)
    edges = np.unique(np.concatenate([np.linspace(0.0, 1.0, panels + 1), breaks]))
    return [(0.5 * (a + b) + 0.5 * (b - a) * points, 0.5 * (b - a) * weights) for a, b in pairwise(edges)]


@dataclass(frozen=True)
class ReversedLaw:
    """Reversed law s(z) = 1 - u(1 - z); a symmetric law equals its reverse.

    R. Roussev, B. Paleva-Kadiyska and V. Galabov, Quinquinomial power functions (2021), eq. 1, reverse their laws in
    this way for a cam with only a lower dwell.
    """

    law: Law  #: the law u

    @property
    def breaks(self) -> tuple[float, ...]:
        """Positions of inner jumps."""
        return tuple(sorted(1.0 - joint for joint in self.law.breaks))

    def __call__(self, z: FloatArray, order: int = 0) -> FloatArray:
        """Return the derivative of the given order at z; at a jump the right limit, which is the left limit of u."""
        mirrored = 1.0 - z
        for joint in self.law.breaks:
            mirrored = np.where(z == 1.0 - joint, np.nextafter(joint, 0.0), mirrored)
        value = (-1.0) ** (order + 1) * self.law(mirrored, order)
        return 1.0 + value if order == 0 else value


_SHORTEST = 1e-3
_GAIN_AT_END = 0.4  # value of `_gain` at z = 1
_GAIN_DERIVATIVES = [polyder((0.0, 1.0, 0.0, -2.0, 2.0, -0.6), order) for order in range(5)]


def _gain(z: FloatArray, order: int) -> FloatArray:
    """Return the integral of (1 - z)^3 (1 + 3 z): slope 1 at z = 0, zero at z = 1, without a step of acceleration."""
    return np.asarray(polyval(z, _GAIN_DERIVATIVES[order]), dtype=float)


@dataclass(frozen=True)
class Ramp:
    """A ramp of constant velocity with a smooth take-off."""

    height: float  #: m
    duration: float  #: cam angle, rad
    take_off: float = 0.25  #: fraction of the duration over which the velocity rises, 0 to 1; with 0 the velocity steps

    def __post_init__(self) -> None:
        positive("ramps.height", self.height, "m")
        positive("ramps.duration", self.duration, "rad")
        if not (self.take_off == 0.0 or _SHORTEST <= self.take_off <= 1.0):
            raise refuse("ramps.take_off", self.take_off, f"0, or a fraction from {_SHORTEST:g} to 1 of the duration")

    @property
    def slope(self) -> float:
        """Velocity at the end of the ramp, m/rad."""
        return self.height / self.duration / self._part

    @property
    def _part(self) -> float:
        """Ratio of the height to that of a ramp with full velocity from the start."""
        return 1.0 - (1.0 - _GAIN_AT_END) * self.take_off

    @property
    def breaks(self) -> tuple[float, ...]:
        """End of the take-off."""
        return (self.take_off,) if 0.0 < self.take_off < 1.0 else ()

    def __call__(self, z: FloatArray, order: int = 0) -> FloatArray:
        """Return the derivative of the given order of the normalized ramp, from 0 to 1 over 0 to 1."""
        t = self.take_off
        line = linear(z, order) - ((1.0 - _GAIN_AT_END) * t if order == 0 else 0.0)
        if t > 0.0:
            # The take-off is the mirror image of the gain at the end of the main lift.
            backwards = np.clip(1.0 - z / t, 0.0, 1.0)
            start = t ** (1 - order) * (-1.0) ** (order + 1) * _gain(backwards, order)
            start = start + (_GAIN_AT_END * t if order == 0 else 0.0)
            line = np.where(z < t, start, line)
        return line / self._part


@dataclass(frozen=True)
class RampTransition:
    """Law with an initial velocity and continuous velocity and acceleration.

    s = (1 - 0.4 k) law + k g, where g' = (1 - z)^3 (1 + 3 z), k is the velocity at z = 0 and the law rises from rest.
    """

    law: Law
    slope: float

    @property
    def breaks(self) -> tuple[float, ...]:
        """Positions of inner jumps."""
        return self.law.breaks

    def __call__(self, z: FloatArray, order: int = 0) -> FloatArray:
        """Return the derivative of the given order at z."""
        return (1.0 - _GAIN_AT_END * self.slope) * self.law(z, order) + self.slope * _gain(z, order)
