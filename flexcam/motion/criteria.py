"""Criteria of a motion law: its extremes, its ends and its symmetry, as tables of laws give them.

Every criterion is the maximum of an absolute value; the signed extremes and where they lie stand beside it. Extremes
are the zeros of the next derivative between the law's joints, found by bisection, and one-sided values at the joints.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from flexcam.linalg import FloatArray
from flexcam.motion.law import Law
from flexcam.motion.quadrature import quadrature

_POINTS = 2001
"""Samples per smooth piece: two extremes closer than 1/2000 of it would be taken for one."""

_HALVINGS = 60
_ZERO = 1e-9
"""Size of a derivative (normalized law) that counts as none."""

_SAME = 1e-9
"""Difference of two extremes, as part of the larger, below which both places are told."""

_MOST_PLACES = 40
"""More places than these are a plateau, of which only the first is told."""

_HARMONICS = 12
_STEPS = ((1, "velocity"), (2, "acceleration"), (3, "jerk"))

Curve = Callable[[FloatArray], FloatArray]


@dataclass(frozen=True)
class Extreme:
    """Least or largest value of a curve and where it lies.

    Parameters
    ----------
    value
        The value.
    at
        The first place.
    also
        Further places with the same value.
    """

    value: float
    at: float
    also: tuple[float, ...] = ()


@dataclass(frozen=True)
class Criteria:
    """Criteria of a normalized law s(z).

    Parameters
    ----------
    velocity, acceleration, jerk, moment
        Signed extremes (least, largest) of s', s'', s''' and of the operating moment s' s''.
    rms
        Root mean squares of s', s'' and s'''; the last without the impulses where s'' jumps.
    harmonics
        Amplitudes of s'' as a Fourier series over the rise, from 1 to 12.
    jumps
        Orders of derivatives (1 to 3) that jump inside the law; one jump in s'' makes the jerk infinite there.
    ends
        Derivatives s, s', s'', s''' at z = 0 and at z = 1.
    symmetric
        Whether s(z) + s(1 - z) = 1.
    middle
        s(1/2).
    """

    velocity: tuple[Extreme, Extreme]
    acceleration: tuple[Extreme, Extreme]
    jerk: tuple[Extreme, Extreme]
    moment: tuple[Extreme, Extreme]
    rms: tuple[float, float, float]
    harmonics: tuple[float, ...]
    jumps: tuple[int, ...]
    ends: tuple[tuple[float, float, float, float], tuple[float, float, float, float]]
    symmetric: bool
    middle: float

    @property
    def Cv(self) -> float:  # noqa: N802 - the field's name
        """Largest absolute velocity."""
        return _largest(self.velocity)

    @property
    def Ca(self) -> float:  # noqa: N802
        """Largest absolute acceleration."""
        return _largest(self.acceleration)

    @property
    def Cj(self) -> float | None:  # noqa: N802
        """Largest absolute jerk; None where the acceleration jumps inside the law and it is infinite."""
        return None if 2 in self.jumps else _largest(self.jerk)

    @property
    def Cm(self) -> float:  # noqa: N802
        """Largest absolute operating moment s' s''."""
        return _largest(self.moment)

    @property
    def rest_at_ends(self) -> int:
        """Order up to which all derivatives from the first vanish at both ends: 0, 1, 2 or 3."""
        met = [all(abs(end[order]) < _ZERO for end in self.ends) for order in (1, 2, 3)]
        return met.index(False) if False in met else 3

    @property
    def broken(self) -> tuple[str, ...]:
        """What a rise between two dwells should meet and this law does not, in words."""
        said = [f"s({z}) = {end[0]:.6g}, not {z}" for z, end in enumerate(self.ends) if abs(end[0] - z) > _ZERO]
        for order, name in _STEPS:
            steps = ((0, self.ends[0][order]), (1, -self.ends[1][order]))  # after less before
            at = [f"by {step:.6g} at z = {z}" for z, step in steps if abs(step) > _ZERO]
            said += [f"the {name} steps next to a dwell: {' and '.join(at)}"] if at else []
        inside = [name for order, name in _STEPS if order in self.jumps]
        said += [f"steps inside the rise: {', '.join(inside)}"] if inside else []
        return (*said, *([] if self.symmetric else [f"not symmetric: s(1/2) = {self.middle:.6g}"]))


def criteria(law: Law) -> Criteria:
    """Compute the criteria of a law."""

    def derivative(order: int) -> Curve:
        return lambda z: law(z, order)

    def moment(z: FloatArray) -> FloatArray:
        return law(z, 1) * law(z, 2)

    def moment_slope(z: FloatArray) -> FloatArray:
        return law(z, 2) ** 2 + law(z, 1) * law(z, 3)

    grid = np.linspace(0.0, 1.0, _POINTS)
    start, end = ([float(law(np.array([z]), order)[0]) for order in range(4)] for z in (0.0, 1.0))
    return Criteria(
        velocity=_extremes(derivative(1), derivative(2), law.breaks),
        acceleration=_extremes(derivative(2), derivative(3), law.breaks),
        jerk=_extremes(derivative(3), derivative(4), law.breaks),
        moment=_extremes(moment, moment_slope, law.breaks),
        rms=(_rms(law, 1), _rms(law, 2), _rms(law, 3)),
        harmonics=_harmonics(law),
        jumps=tuple(order for order in (1, 2, 3) if _jumps(derivative(order), law.breaks)),
        ends=((start[0], start[1], start[2], start[3]), (end[0], end[1], end[2], end[3])),
        symmetric=bool(np.abs(law(grid) + law(1.0 - grid) - 1.0).max() < _ZERO),
        middle=float(law(np.array([0.5]))[0]),
    )


def stationary_points(law: Law, order: int) -> FloatArray:
    """Return where a derivative of a law may be largest: its joints, ends and stationary points."""
    pieces = _pieces(law.breaks)
    return np.sort(np.concatenate([_candidates(lambda z: law(z, order + 1), *piece) for piece in pieces]))


def _rms(law: Law, order: int) -> float:
    return math.sqrt(sum(float(weight @ law(z, order) ** 2) for z, weight in quadrature(law.breaks)))


def _harmonics(law: Law) -> tuple[float, ...]:
    """Return the amplitudes 2 abs(integral of s'' exp(2 pi i n z)) over the rise."""
    n = np.arange(1, _HARMONICS + 1)
    total = np.zeros(_HARMONICS, dtype=complex)
    for z, weight in quadrature(law.breaks):
        total += np.exp(2j * np.pi * np.outer(n, z)) @ (weight * law(z, 2))
    return tuple((2.0 * np.abs(total)).tolist())


def _largest(extremes: tuple[Extreme, Extreme]) -> float:
    return max(abs(one.value) for one in extremes)


def _pieces(breaks: tuple[float, ...]) -> list[tuple[float, float]]:
    """Return the smooth pieces; each ends just before its joint, because a law's value there is that to the right."""
    ends = list(pairwise([0.0, *breaks, 1.0]))
    return [(a, b if b == 1.0 else float(np.nextafter(b, 0.0))) for a, b in ends]


def _extremes(curve: Curve, slope: Curve, breaks: tuple[float, ...]) -> tuple[Extreme, Extreme]:
    places = np.sort(np.concatenate([_candidates(slope, *piece) for piece in _pieces(breaks)]))
    values = curve(places)
    return _extreme(values, places, int(np.argmin(values))), _extreme(values, places, int(np.argmax(values)))


def _extreme(values: FloatArray, places: FloatArray, best: int) -> Extreme:
    """Return an extreme with all places that share it, unless they are a plateau."""
    value = float(values[best])
    at = places[np.abs(values - value) <= _SAME * max(abs(value), _ZERO)]
    apart = at[np.concatenate([[True], np.diff(at) > 1.0 / _POINTS])]
    if len(at) > _MOST_PLACES:
        return Extreme(value, float(at[0]))
    return Extreme(value, float(apart[0]), tuple(apart[1:].tolist()))


def _candidates(slope: Curve, start: float, end: float) -> FloatArray:
    """Return the ends of a smooth piece and the zeros of the slope between them."""
    grid = np.linspace(start, end, _POINTS)
    signs = np.sign(slope(grid))
    left = np.flatnonzero(signs[:-1] * signs[1:] < 0.0)
    low, high, sign = grid[left], grid[left + 1], signs[left]
    for _ in range(_HALVINGS if len(left) else 0):
        middle = 0.5 * (low + high)
        before = np.sign(slope(middle)) == sign
        low, high = np.where(before, middle, low), np.where(before, high, middle)
    return np.concatenate([[start, end], grid[signs == 0.0], 0.5 * (low + high)])


def _jumps(curve: Curve, breaks: tuple[float, ...]) -> bool:
    joints = np.array(breaks)
    step = np.abs(curve(joints) - curve(np.nextafter(joints, 0.0)))
    return bool((step > 1e-6 * (1.0 + np.abs(curve(joints)))).any())
