"""Trigonometric, parabolic and composite motion laws."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from flexcam.cams.motion_law import SmoothLaw, linear
from flexcam.core import FloatArray
from flexcam.core.errors import refuse

_ROUNDING = 1e-9


@dataclass(frozen=True)
class Harmonic(SmoothLaw):
    """s = z - sum c_n sin(2 pi n z)/(2 pi n); c_1 = 1 alone gives the cycloidal law.

    s' vanishes at both ends if the c_n sum to 1. Source of the cycloidal law: R. L. Norton, Cam Design and
    Manufacturing Handbook, 2nd ed. (2009), ch. 2.

    Examples
    --------
    >>> Harmonic(((1, 1.0),))(np.array([0.5])).round(12)
    array([0.5])
    """

    harmonics: tuple[tuple[int, float], ...]  #: pairs of order n and coefficient c_n

    def __post_init__(self) -> None:
        if not all(n >= 1 and n == int(n) and math.isfinite(c) for n, c in self.harmonics):
            raise refuse("harmonics", list(self.harmonics), "pairs of a whole number, at least 1, and a finite number")

    def __call__(self, z: FloatArray, order: int = 0) -> FloatArray:
        """Return the derivative of the given order at z."""
        value = linear(z, order)
        for n, c in self.harmonics:
            w = 2.0 * math.pi * n
            value = value - c * w ** (order - 1) * np.sin(w * z + order * math.pi / 2.0)
        return value


PAVLOVIC_TRIGONOMETRIC = Harmonic(((1, 15.0 / 16.0), (2, 1.0 / 24.0)))
"""Law z - 15 sin(2 pi z)/(32 pi) - sin(4 pi z)/(96 pi).

The figures of V. D. Pavlovic and M. M. Lutovac, New class of camshaft transfer functions, were computed with it; s' =
1/48 at both ends, which violates the paper's conditions (2) and (4). The classical law is Gutman's, with 6 pi in place
of 4 pi.
"""

GUTMAN = Harmonic(((1, 15.0 / 16.0), (3, 1.0 / 16.0)))
"""Gutman's 1-3 law: z - 15 sin(2 pi z)/(32 pi) - sin(6 pi z)/(96 pi)."""

FREUDENSTEIN = Harmonic(((1, 27.0 / 28.0), (3, 1.0 / 28.0)))
"""Freudenstein's 1-3 law: z - (27/28 sin 2 pi z + 1/84 sin 6 pi z)/(2 pi)."""


@dataclass(frozen=True)
class CosineSum(SmoothLaw):
    """s = sum d_k cos(k pi z), k from 0; d = (1/2, -1/2) is the simple harmonic law (Norton, 2009, ch. 2).

    The velocity vanishes at both ends for all coefficients; the acceleration only for some.

    Examples
    --------
    >>> CosineSum((0.5, -0.5))(np.array([0.0, 0.5, 1.0])).round(12)
    array([0. , 0.5, 1. ])
    """

    coefficients: tuple[float, ...]  #: d_k, from k = 0

    def __post_init__(self) -> None:
        start = sum(self.coefficients)
        end = sum(d * (-1.0) ** k for k, d in enumerate(self.coefficients))
        if not (abs(start) <= _ROUNDING and abs(end - 1.0) <= _ROUNDING):
            given = f"coefficients with s(0) = {start:.9g} and s(1) = {end:.9g}"
            remedy = "they sum to 0, with alternating signs to 1"
            raise refuse("coefficients", given, "a rise from 0 to 1", remedy=remedy)

    def __call__(self, z: FloatArray, order: int = 0) -> FloatArray:
        """Return the derivative of the given order at z."""
        value = np.zeros_like(z)
        for k, d in enumerate(self.coefficients):
            w = math.pi * k
            value = value + d * w**order * np.cos(w * z + order * math.pi / 2.0)
        return value


def _sum_of_products(terms: Sequence[tuple[int, int, float]]) -> CosineSum:
    """Return sum c cos(i pi z) cos(j pi z) as a plain sum: cos a cos b = (cos(a + b) + cos(a - b))/2."""
    sums = np.zeros(1 + max(i + j for i, j, _ in terms))
    for i, j, c in terms:
        sums[i + j] += 0.5 * c
        sums[abs(i - j)] += 0.5 * c
    return CosineSum(tuple(sums.tolist()))


PAVLOVIC_NEW = _sum_of_products(
    [
        (0, 0, 0.462615966796875), (1, 0, -0.4375), (1, 1, 0.095703125), (2, 0, -0.059814453125),
        (2, 2, -0.02392578125), (3, 0, -0.0625), (1, 3, 0.02734375), (3, 3, 0.001953125),
        (4, 0, -0.00213623046875), (2, 4, -0.001708984375), (4, 4, -0.000030517578125),
    ]
)  # fmt: skip
"""Equation (21) of V. D. Pavlovic and M. M. Lutovac, New class of camshaft transfer functions, as printed.

The law is not symmetric, s(1/2) = 0.498047, and its acceleration steps by pi^2 at both ends.
"""


def harmonic_acceleration(b: tuple[float, ...] = (2.0 * math.pi,)) -> Harmonic:
    """Return the law with the acceleration sum b_n sin(2 pi n z), n from 1.

    Rest at both ends needs sum b_n/(2 pi n) = 1, and the velocity must not be negative. Reference: C. Li, Cam motion
    simulation and optimization (2014), eqs. 7-11. One amplitude of 2 pi is the cycloidal law.

    Examples
    --------
    >>> harmonic_acceleration().harmonics
    ((1, 1.0),)
    """
    law = Harmonic(tuple((n, amplitude / (2.0 * math.pi * n)) for n, amplitude in enumerate(b, start=1)))
    total = sum(c for _, c in law.harmonics)
    if not abs(total - 1.0) <= _ROUNDING:
        why = "the velocity must vanish at both ends"
        raise refuse("b", f"amplitudes with sum b_n/(2 pi n) = {total:.9g}", "a sum of 1", why, "scale them")
    slowest = float(law(np.linspace(0.0, 1.0, 4001), 1).min())
    if slowest < -_ROUNDING:
        why = f"the velocity falls to {slowest:.4g}: the follower would turn back"
        raise refuse("b", f"{list(b)}", "amplitudes with a velocity of zero or more", why)
    return law


@dataclass(frozen=True)
class Scca:
    """Acceleration with a sine rise, a constant part and a cosine fall through zero, continued antisymmetrically.

    With the fractions b (both sines together), c (both constants) and d (the cosine), b + c + d = 1: (0, 0, 1) is
    simple harmonic, (1/2, 0, 1/2) cycloidal, (0, 1, 0) parabolic, (1/4, 1/2, 1/4) the modified trapezoid, (1/4, 0, 3/4)
    the modified sine. Source: R. L. Norton, Cam Design and Manufacturing Handbook, 2nd ed. (2009), ch. 3.

    Examples
    --------
    >>> round(Scca(0.25, 0.5, 0.25).peak, 4)
    4.8881
    """

    #: `b`, `c`, `d`: fractions of the rise, not negative, with sum 1
    b: float
    c: float
    d: float

    def __post_init__(self) -> None:
        if not (min(self.b, self.c, self.d) >= 0.0 and abs(self.b + self.c + self.d - 1.0) <= 1e-12):
            raise refuse("b, c, d", (self.b, self.c, self.d), "three non-negative fractions that sum to 1")

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
        """Return the derivative of the given order at z; the second half is the first one rotated about the middle."""
        second = (z > 0.5) | ((z == 0.5) & (self.d == 0.0))
        mirrored = np.where(second, 1.0 - z, z)
        for fraction in (self.b, 1.0 - self.d):  # 1 - z at a joint is the other joint up to rounding
            mirrored = np.where(z == 1.0 - 0.5 * fraction, 0.5 * fraction, mirrored)
        # The first half; at a joint the right limit, or the left limit in the mirrored half.
        rising, flat = (
            (mirrored < joint) | (second & (mirrored == joint) & (joint > 0.0))
            for joint in (0.5 * self.b, 0.5 * (1.0 - self.d))
        )
        parts = [_sine(mirrored, self.b, order), _constant(mirrored, self.b, order)]
        half = self.peak * np.select([rising, flat], parts, _cosine(mirrored, self.b, self.c, self.d, order))
        rotated = (1.0 if order == 0 else 0.0) + (-1.0) ** (order + 1) * half
        return np.where(second, rotated, half)


def _sine(x: FloatArray, b: float, order: int) -> FloatArray:
    if b == 0.0:
        return np.zeros_like(x)
    w = math.pi / b
    line = linear(x, order) / w
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


@dataclass(frozen=True)
class CompoundCycloid:
    """Rise of a valve cam without dwell: s'' = A sin(pi z/p) up to z = p, then -B sin(pi (z - p)/(2 (1 - p))).

    Lift and velocity are continuous at the split p; the deceleration is greatest at the nose, z = 1, and smooth in the
    mirrored return. C. Li, Cam motion simulation and optimization (2014), names a cam "FB2" (compound cycloid II)
    without defining it; this form and its default split are flexcam's choice.

    Examples
    --------
    >>> CompoundCycloid()(np.array([0.0, 1.0])).round(12)
    array([0., 1.])
    """

    split: float = 0.3  #: fraction of the rise with positive acceleration, between 0 and 1

    def __post_init__(self) -> None:
        if not 0.0 < self.split < 1.0:
            raise refuse("split", self.split, "a number between 0 and 1", "it divides acceleration from deceleration")

    @property
    def breaks(self) -> tuple[float, ...]:
        """Positions of inner jumps: that of the jerk at the split."""
        return (self.split,)

    def __call__(self, z: FloatArray, order: int = 0) -> FloatArray:
        """Return the derivative of the given order at z."""
        p, pi = self.split, math.pi
        peak = 1.0 / (p**2 / pi + 4.0 * p * (1.0 - p) / pi**2)  # from s(1) = 1
        w = pi / (2.0 * (1.0 - p))
        speed, height = 2.0 * peak * p / pi, peak * p**2 / pi
        wave = speed * w ** (order - 1) * np.sin(w * (z - p) + order * pi / 2.0)
        return np.where(z < p, peak * _sine(z, p, order), (height if order == 0 else 0.0) + wave)
