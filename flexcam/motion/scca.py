"""The family of sine, constant and cosine accelerations (SCCA)."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from flexcam.checks import refuse
from flexcam.linalg import FloatArray


@dataclass(frozen=True)
class Scca:
    """Acceleration that rises as a sine, stays, falls as a cosine through zero, and runs back antisymmetrically.

    With the parts b (both sines together), c (both constants) and d (the cosine), b + c + d = 1: (0, 0, 1) is simple
    harmonic, (1/2, 0, 1/2) cycloidal, (0, 1, 0) parabolic, (1/4, 1/2, 1/4) the modified trapezoid, (1/4, 0, 3/4) the
    modified sine. Source: R. L. Norton, Cam Design and Manufacturing Handbook, 2nd ed. (2009), ch. 3.

    Parameters
    ----------
    b, c, d
        Parts of the rise, zero or more, 1 together.

    Raises
    ------
    InputError
        If a part is negative or they do not sum to 1.

    Examples
    --------
    >>> round(Scca(0.25, 0.5, 0.25).peak, 4)
    4.8881
    """

    b: float
    c: float
    d: float

    def __post_init__(self) -> None:
        if not (min(self.b, self.c, self.d) >= 0.0 and abs(self.b + self.c + self.d - 1.0) <= 1e-12):
            raise refuse("b, c, d", (self.b, self.c, self.d), "three parts of zero or more that sum to 1")

    @property
    def peak(self) -> float:
        """Peak acceleration C_a, which makes s(1) = 1."""
        b, d, pi = self.b, self.d, math.pi
        return 4.0 * pi**2 / ((pi**2 - 8.0) * (b**2 - d**2) - 2.0 * pi * (pi - 2.0) * b + pi**2)

    @property
    def breaks(self) -> tuple[float, ...]:
        """Positions of inner jumps (of the acceleration or a derivative of it)."""
        joints = {0.5 * self.b, 0.5 * (1.0 - self.d), 1.0 - 0.5 * (1.0 - self.d), 1.0 - 0.5 * self.b}
        return tuple(sorted(joint for joint in joints if 0.0 < joint < 1.0))

    def __call__(self, z: FloatArray, order: int = 0) -> FloatArray:
        """Return the derivative of the given order at z; the second half is the first one turned about the middle."""
        second = (z > 0.5) | ((z == 0.5) & (self.d == 0.0))
        mirrored = np.where(second, 1.0 - z, z)
        for part in (self.b, 1.0 - self.d):  # 1 - z at a joint is the other joint, whatever its rounding
            mirrored = np.where(z == 1.0 - 0.5 * part, 0.5 * part, mirrored)
        half = self._first_half(mirrored, order, second)
        turned = (1.0 if order == 0 else 0.0) + (-1.0) ** (order + 1) * half
        return np.where(second, turned, half)

    def _first_half(self, x: FloatArray, order: int, left: NDArray[np.bool_]) -> FloatArray:
        """Return the derivative on 0 to 1/2; at a joint that of the part to the right, or to the left where told."""
        end, start = 0.5 * self.b, 0.5 * (1.0 - self.d)
        rising = _before(x, end, left)
        flat = _before(x, start, left)
        parts = [_sine(x, self.b, order), _constant(x, self.b, order)]
        return self.peak * np.select([rising, flat], parts, _cosine(x, self.b, self.c, self.d, order))


def _before(x: FloatArray, joint: float, left: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Tell what lies before a joint; on it, what looks to the left."""
    return (x < joint) | (left & (x == joint) & (joint > 0.0))


def _sine(x: FloatArray, b: float, order: int) -> FloatArray:
    if b == 0.0:
        return np.zeros_like(x)
    w = math.pi / b
    line = (x / w, np.full_like(x, 1.0 / w))[order] if order < 2 else np.zeros_like(x)
    return line - w ** (order - 2) * np.sin(w * x + order * math.pi / 2.0)


def _constant(x: FloatArray, b: float, order: int) -> FloatArray:
    slope = b * (1.0 / math.pi - 0.5)
    rows = (0.5 * x**2 + slope * x + b**2 * (0.125 - 1.0 / math.pi**2), x + slope, np.ones_like(x))
    return rows[order] if order < 3 else np.zeros_like(x)


def _cosine(x: FloatArray, b: float, c: float, d: float, order: int) -> FloatArray:
    if d == 0.0:
        return _constant(x, b, order)
    w, begin = math.pi / d, (1.0 - d) / 2.0
    slope = b / math.pi + c / 2.0
    level = 1.0 / w**2 + b**2 * (0.125 - 1.0 / math.pi**2) - begin**2 / 2.0
    line = (slope * x + level, np.full_like(x, slope))[order] if order < 2 else np.zeros_like(x)
    return line - w ** (order - 2) * np.cos(w * (x - begin) + order * math.pi / 2.0)
