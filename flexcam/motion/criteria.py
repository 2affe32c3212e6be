"""Criteria of a motion law: its extremes, its ends and its symmetry, as tables of laws give them.

Every criterion is the maximum of an absolute value; the signed extremes and where they lie stand beside it. Extremes
are the zeros of the next derivative between the law's joints, found by bisection, and one-sided values at the joints.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from flexcam.linalg import FloatArray
from flexcam.motion.law import Law

_POINTS = 2001
"""Samples per smooth piece: two extremes closer than 1/2000 of it would be taken for one."""

_HALVINGS = 60
_ZERO = 1e-9
"""Size of a derivative (normalized law) that counts as none."""

Curve = Callable[[FloatArray], FloatArray]


@dataclass(frozen=True)
class Extreme:
    """Least or largest value of a curve and where it lies."""

    value: float
    at: float


@dataclass(frozen=True)
class Criteria:
    """Criteria of a normalized law s(z).

    Parameters
    ----------
    velocity, acceleration, jerk, moment
        Signed extremes (least, largest) of s', s'', s''' and of the operating moment s' s''.
    jumps
        Orders of derivatives (1 to 3) that jump inside the law; one jump in s'' makes the jerk infinite there.
    ends
        Derivatives s, s', s'', s''' at z = 0 and at z = 1.
    symmetric
        Whether s(z) + s(1 - z) = 1.
    """

    velocity: tuple[Extreme, Extreme]
    acceleration: tuple[Extreme, Extreme]
    jerk: tuple[Extreme, Extreme]
    moment: tuple[Extreme, Extreme]
    jumps: tuple[int, ...]
    ends: tuple[tuple[float, float, float, float], tuple[float, float, float, float]]
    symmetric: bool

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


def criteria(law: Law) -> Criteria:
    """Compute the criteria of a law.

    Parameters
    ----------
    law
        A normalized law.

    Returns
    -------
    Criteria
        Extremes to 1e-12 in value.

    Examples
    --------
    >>> from flexcam.motion import Cycloidal
    >>> round(criteria(Cycloidal()).Ca, 9)
    6.283185307
    """

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
        jumps=tuple(order for order in (1, 2, 3) if _jumps(derivative(order), law.breaks)),
        ends=((start[0], start[1], start[2], start[3]), (end[0], end[1], end[2], end[3])),
        symmetric=bool(np.abs(law(grid) + law(1.0 - grid) - 1.0).max() < _ZERO),
    )


def _largest(extremes: tuple[Extreme, Extreme]) -> float:
    return max(abs(one.value) for one in extremes)


def _pieces(breaks: tuple[float, ...]) -> list[tuple[float, float]]:
    """Return the smooth pieces; each ends just before its joint, because a law's value there is that to the right."""
    ends = list(pairwise([0.0, *breaks, 1.0]))
    return [(a, b if b == 1.0 else float(np.nextafter(b, 0.0))) for a, b in ends]


def _extremes(curve: Curve, slope: Curve, breaks: tuple[float, ...]) -> tuple[Extreme, Extreme]:
    places = np.concatenate([_candidates(slope, *piece) for piece in _pieces(breaks)])
    values = curve(places)
    least, most = int(np.argmin(values)), int(np.argmax(values))
    return Extreme(float(values[least]), float(places[least])), Extreme(float(values[most]), float(places[most]))


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
