"""Criteria of motion laws and minima of curves over a revolution.

A grid locates the minima between the joints and successive refinement locates their values. The value just before a
joint is extrapolated from two points next to it, to rounding for curves that are smooth between the joints.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import ArrayLike, NDArray

from flexcam.cams.motion_law import Law, quadrature
from flexcam.core import FloatArray, IntArray
from flexcam.core.errors import refuse

_POINTS = 2001  # samples per smooth piece: two extremes closer than 1/2000 of it are not distinguished
_HALVINGS = 60
_ZERO = 1e-9  # size of a derivative (normalized law) that counts as zero
_SAME_CRITERIA = 1e-9  # relative difference of two extremes below which both positions are reported
_MAX_POSITIONS = 40  # number of equal extremes above which only the first is reported, as on a plateau
_HARMONICS = 12
_STEPS = ((1, "velocity"), (2, "acceleration"), (3, "jerk"))

Curve = Callable[[FloatArray], FloatArray]


@dataclass(frozen=True)
class Extreme:
    """Minimum or maximum of a curve and its position."""

    value: float
    at: float  #: first position
    also: tuple[float, ...] = ()  #: further positions with the same value


@dataclass(frozen=True)
class Criteria:
    """Criteria of a normalized law s(z)."""

    #: `velocity`, `acceleration`, `jerk`, `moment`: signed minimum and maximum of s', s'', s''' and s' s''
    velocity: tuple[Extreme, Extreme]
    acceleration: tuple[Extreme, Extreme]
    jerk: tuple[Extreme, Extreme]
    moment: tuple[Extreme, Extreme]
    #: root mean squares of s', s'' and s'''; that of s''' excludes the impulses at jumps of s''
    rms: tuple[float, float, float]
    harmonics: tuple[float, ...]  #: amplitudes of s'' as a Fourier series over the rise, from 1 to 12
    #: orders of derivatives (1 to 3) that jump inside the law; a jump in s'' makes the jerk infinite
    jumps: tuple[int, ...]
    #: derivatives s, s', s'', s''' at z = 0 and at z = 1
    ends: tuple[tuple[float, float, float, float], tuple[float, float, float, float]]
    symmetric: bool  #: whether s(z) + s(1 - z) = 1
    middle: float  #: s(1/2)

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
        """Largest absolute jerk; None if the acceleration jumps inside the law, which makes the jerk infinite."""
        return None if 2 in self.jumps else _largest(self.jerk)

    @property
    def Cm(self) -> float:  # noqa: N802
        """Largest absolute operating moment s' s''."""
        return _largest(self.moment)

    @property
    def rest_at_ends(self) -> int:
        """Order up to which all derivatives from the first vanish at both ends: 0 to 3."""
        vanishing = [all(abs(end[order]) < _ZERO for end in self.ends) for order in (1, 2, 3)]
        return vanishing.index(False) if False in vanishing else 3

    @property
    def violations(self) -> tuple[str, ...]:
        """Descriptions of the violated requirements of a rise between two dwells."""
        texts = [f"s({z}) = {end[0]:.6g}, not {z}" for z, end in enumerate(self.ends) if abs(end[0] - z) > _ZERO]
        for order, name in _STEPS:
            steps = ((0, self.ends[0][order]), (1, -self.ends[1][order]))  # right limit minus left limit
            jumps = [f"by {step:+.6g} at z = {z}" for z, step in steps if abs(step) > _ZERO]
            texts += [f"the {name} jumps at a dwell, {' and '.join(jumps)}"] if jumps else []
        inside = [name for order, name in _STEPS if order in self.jumps]
        texts += [f"jumps inside the rise: {', '.join(inside)}"] if inside else []
        return (*texts, *([] if self.symmetric else [f"not symmetric: s(1/2) = {self.middle:.6g}"]))


def criteria(law: Law) -> Criteria:
    """Return the criteria of a law."""

    def derivative(order: int) -> Curve:
        return lambda z: law(z, order)

    def moment(z: FloatArray) -> FloatArray:
        return law(z, 1) * law(z, 2)

    def moment_slope(z: FloatArray) -> FloatArray:
        return law(z, 2) ** 2 + law(z, 1) * law(z, 3)

    grid, n = np.linspace(0.0, 1.0, _POINTS), np.arange(1, _HARMONICS + 1)
    waves = sum(np.exp(2j * np.pi * np.outer(n, z)) @ (weight * law(z, 2)) for z, weight in quadrature(law.breaks))
    start, end = ([float(law(np.array([z]), order)[0]) for order in range(4)] for z in (0.0, 1.0))
    return Criteria(
        velocity=_extremes(derivative(1), derivative(2), law.breaks),
        acceleration=_extremes(derivative(2), derivative(3), law.breaks),
        jerk=_extremes(derivative(3), derivative(4), law.breaks),
        moment=_extremes(moment, moment_slope, law.breaks),
        rms=(root_mean_square(law, 1), root_mean_square(law, 2), root_mean_square(law, 3)),
        harmonics=tuple((2.0 * np.abs(waves)).tolist()),
        jumps=tuple(order for order in (1, 2, 3) if _jumps(derivative(order), law.breaks)),
        ends=((start[0], start[1], start[2], start[3]), (end[0], end[1], end[2], end[3])),
        symmetric=bool(np.abs(law(grid) + law(1.0 - grid) - 1.0).max() < _ZERO),
        middle=float(law(np.array([0.5]))[0]),
    )


def stationary_points(law: Law, order: int) -> FloatArray:
    """Return candidate positions of an extreme of a derivative: joints, ends and stationary points."""
    return _candidates(lambda z: law(z, order + 1), law.breaks)


def root_mean_square(law: Law, order: int) -> float:
    """Return the root mean square of a derivative over the rise."""
    return math.sqrt(sum(float(weight @ law(z, order) ** 2) for z, weight in quadrature(law.breaks)))


def _largest(extremes: tuple[Extreme, Extreme]) -> float:
    return max(abs(extreme.value) for extreme in extremes)


def _extremes(curve: Curve, slope: Curve, breaks: tuple[float, ...]) -> tuple[Extreme, Extreme]:
    positions = _candidates(slope, breaks)
    values = curve(positions)
    return _extreme(values, positions, int(np.argmin(values))), _extreme(values, positions, int(np.argmax(values)))


def _extreme(values: FloatArray, positions: FloatArray, index: int) -> Extreme:
    """Return an extreme with all positions of the same value, unless they form a plateau."""
    value = float(values[index])
    equal = positions[np.abs(values - value) <= _SAME_CRITERIA * max(abs(value), _ZERO)]
    distinct = equal[np.concatenate([[True], np.diff(equal) > 1.0 / _POINTS])]
    if len(equal) > _MAX_POSITIONS:
        return Extreme(value, float(equal[0]))
    return Extreme(value, float(distinct[0]), tuple(distinct[1:].tolist()))


def _candidates(slope: Curve, breaks: tuple[float, ...]) -> FloatArray:
    """Return the ends of all smooth pieces and the zeros of the slope between them."""
    candidates: list[FloatArray] = []
    for start, end in pairwise([0.0, *breaks, 1.0]):
        # A piece ends just before its joint because a law's value there is the right limit.
        grid = np.linspace(start, end if end == 1.0 else float(np.nextafter(end, 0.0)), _POINTS)
        signs = np.sign(slope(grid))
        i = np.flatnonzero(signs[:-1] * signs[1:] < 0.0)
        zeros = bisect(lambda z, sign=signs[i]: np.sign(slope(z)) != sign, grid[i], grid[i + 1])
        candidates += [grid[[0, -1]], grid[signs == 0.0], zeros]
    return np.sort(np.concatenate(candidates))


def bisect(beyond: Callable[[FloatArray], NDArray[np.bool_]], low: FloatArray, high: FloatArray) -> FloatArray:
    """Return the points between pairs of bounds at which a condition that holds at the upper bound begins to hold."""
    for _ in range(_HALVINGS if len(low) else 0):
        middle = 0.5 * (low + high)
        holds = beyond(middle)
        low, high = np.where(holds, low, middle), np.where(holds, middle, high)
    return 0.5 * (low + high)


def _jumps(curve: Curve, breaks: tuple[float, ...]) -> bool:
    joints = np.array(breaks)
    step = np.abs(curve(joints) - curve(np.nextafter(joints, 0.0)))
    return bool((step > 1e-6 * (1.0 + np.abs(curve(joints)))).any())


LIMIT_OFFSET = 1e-8
"""Distance from a joint for the left limit, rad: a closer angle counts as the joint."""

_SPACING = math.radians(0.05)
_MIN_POINTS = 33
_SAME = 1e-12  # relative difference of minima that count as equal; the first position is reported
_VALLEYS = 24  # number of the deepest sampled minima that are refined
_GRID_REFINEMENTS = 9  # number of refinements of the grid by four: 1e-8 rad, where a minimum is flat to rounding


def curve_minimum(curve: Curve, joints: Sequence[float] = ()) -> Extreme:
    """Return the minimum of a curve over a revolution."""
    edges = [0.0, *(joint for joint in joints if LIMIT_OFFSET < joint < math.tau - LIMIT_OFFSET), math.tau]
    pieces = [  # each ends just before its joint
        np.linspace(start, end - LIMIT_OFFSET, max(_MIN_POINTS, math.ceil((end - start) / _SPACING)))
        for start, end in pairwise(edges)
    ]
    angles = np.concatenate(pieces)
    values = _finite_values(curve(angles))
    valleys = _sampled_minima(values, np.cumsum([len(piece) for piece in pieces]))
    low, high = angles[np.maximum(valleys - 1, 0)], angles[np.minimum(valleys + 1, len(angles) - 1)]
    floors, floor_angles = refine_minima(lambda grid: curve(grid.ravel()).reshape(grid.shape), low, high)
    ends = np.array(edges[1:])
    extrapolated = _finite_values(2.0 * curve(ends - LIMIT_OFFSET) - curve(ends - 2.0 * LIMIT_OFFSET))
    all_values, positions = np.concatenate([values, floors, extrapolated]), np.concatenate([angles, floor_angles, ends])
    minimum = float(all_values.min())
    return Extreme(minimum, float(positions[all_values <= minimum + _SAME * abs(minimum)].min()))


def _finite_values(values: FloatArray) -> FloatArray:
    """Return values with non-finite ones removed, such as the curvature at a stationary point of a curve."""
    return np.where(np.isnan(values), np.inf, values)


def _sampled_minima(values: FloatArray, sizes: IntArray) -> IntArray:
    """Return the indices of the deepest sampled minima, including ends of pieces."""
    around = np.pad(values, 1, mode="edge")
    left, right = around[:-2], around[2:]
    valley = (values <= left) & (values <= right) & ((values < left) | (values < right))
    valley[[0, *sizes[:-1], *(sizes - 1), int(np.argmin(values))]] = True
    indices = np.flatnonzero(valley)
    return indices[np.argsort(values[indices], kind="stable")[:_VALLEYS]]


def refine_minima(curve: Curve, low: FloatArray, high: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the minima of a curve between pairs of bounds, shape (m,), and their positions; it takes shape (m, 9)."""
    rows, fractions = np.arange(len(low)), np.linspace(0.0, 1.0, 9)
    positions, values = low, np.full(len(low), np.inf)
    for _ in range(_GRID_REFINEMENTS):
        grid = low[:, None] + (high - low)[:, None] * fractions
        samples = _finite_values(curve(grid))
        i = np.argmin(samples, axis=1)
        positions, values = grid[rows, i], samples[rows, i]
        low, high = grid[rows, np.maximum(i - 1, 0)], grid[rows, np.minimum(i + 1, len(fractions) - 1)]
    return values, positions


_LARGEST = 1e3
_PANELS_PER_PERIOD = 8  # panels of sixteen points per oscillation: exact to rounding


def residual_spectrum(law: Law, ratio: ArrayLike) -> FloatArray:
    """Return the amplitude of the residual vibration after a rise, relative to the lift, by the rise time in periods.

    This is the exact response of the oscillator: the Fourier integral of s'' over the rise plus the steps of s' at its
    ends, by Gauss quadrature between the law's joints. Reference: M. P. Koster, Vibrations of Cam Mechanisms (1974),
    ch. 3.
    """
    periods = np.asarray(ratio, dtype=float)
    if not ((periods > 0.0).all() and (periods <= _LARGEST).all()):
        wrong = periods[~((periods > 0.0) & (periods <= _LARGEST))].flat[0]
        raise refuse("residual", f"{wrong:g}", f"a ratio of rise time to period above zero, up to {_LARGEST:g}")
    w = 2.0 * math.pi * periods
    panels = 64 + int(_PANELS_PER_PERIOD * periods.max(initial=0.0))
    total = law(np.zeros(1), 1)[0] - law(np.ones(1), 1)[0] * np.exp(1j * w)
    for z, weight in quadrature(law.breaks, panels):
        values = weight * law(z, 2)
        total = total + np.exp(1j * w[..., None] * z) @ values
    return np.abs(total) / w
