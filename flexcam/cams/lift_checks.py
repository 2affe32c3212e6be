"""Checks of a lift table."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from flexcam.core import FloatArray
from flexcam.core.errors import Fault

_REVOLUTION = 2.0 * math.pi
_LEAST_POINTS = 12
_MOST_FAULTS = 10

_BASE = 0.01
"""Fraction of the largest lift below which a point is on the base circle, and by which a lift may bend across a gap."""

_SCATTERS = 6.0
"""Standard deviations of the noise allowed for a point on the base circle: one in 1e9 lies outside."""

_OF_MEDIAN = 1.4826
"""Ratio of standard deviation to median absolute value of normal noise."""

_GAP, _GAP_RATIO, _WIDE = math.radians(3.0), 3.0, math.radians(20.0)
"""A step is wide above 3 deg and three times its neighbours, or above 20 deg."""


def find_table_faults(theta: FloatArray, s: FloatArray) -> list[Fault]:
    """Return the faults of a lift table, with rows counted from 1."""
    if len(theta) != len(s):
        given = f"{len(s)} lifts at {len(theta)} angles"
        return [Fault("lift table", given, "one lift per angle", "", "complete or remove the odd row")]
    lost = np.flatnonzero(~(np.isfinite(theta) & np.isfinite(s)))
    if lost.size:
        return [
            Fault(f"lift table, row {i + 1}", f"angle {math.degrees(theta[i]):g} deg, lift {1e3 * s[i]:g} mm",
                  "finite numbers", "", "mend or remove the row")
            for i in lost[:_MOST_FAULTS].tolist()
        ]  # fmt: skip
    if len(theta) < _LEAST_POINTS:
        return [Fault("lift table", f"{len(theta)} points", f"{_LEAST_POINTS} or more", "", "measure at more angles")]
    found: list[Fault] = []
    back = np.flatnonzero(np.diff(theta) <= 0.0)
    if back.size:
        i = int(back[0])
        given = f"{math.degrees(theta[i]):g} deg, then {math.degrees(theta[i + 1]):g} deg"
        found.append(Fault(f"angle, row {i + 2}", given, "angles that ascend", "", "sort the rows, each angle once"))
    elif theta[-1] - theta[0] > _REVOLUTION + 1e-9:
        given = f"{math.degrees(theta[-1] - theta[0]):g} deg of cam angle"
        remedy = "cut the table; crank angles must be said to be such"
        found.append(Fault("angle", given, "360 deg at most", "the lift repeats every revolution", remedy))
    top = float(s.max())
    if top <= 0.0:
        return [*found, Fault("lift", f"{top:g} m at most", "a lift above zero", "", "check the column and its unit")]
    low = base_level(theta, s) if not found else _BASE * top
    below = np.flatnonzero(s < -low)
    if below.size:
        i = int(below[0])
        given = f"{1e3 * s[i]:g} mm at {math.degrees(theta[i]):g} deg"
        found.append(Fault(f"lift, row {i + 1}", given, "zero or more", "a follower cannot enter the base circle",
                           "subtract the base circle's reading"))  # fmt: skip
    return found or [*_gaps(theta, s, low), *_periodicity_fault(theta, s, low)]


def base_level(theta: FloatArray, s: FloatArray) -> float:
    """Return the lift below which a point of a table counts as on the base circle, m."""
    return max(_BASE * float(s.max()), _SCATTERS * scatter(theta, s))


def scatter(theta: FloatArray, s: FloatArray) -> float:
    """Return the standard deviation of a table's noise, from the deviation from parabolas through three neighbours."""
    places = np.stack([theta[k : len(theta) - 3 + k] for k in range(4)])
    values = np.stack([s[k : len(s) - 3 + k] for k in range(4)])
    apart = places[:, None] - places[None]
    weights = 1.0 / np.where(np.eye(4, dtype=bool)[:, :, None], 1.0, apart).prod(axis=1)
    miss = np.abs((weights * values).sum(axis=0)) / np.sqrt((weights**2).sum(axis=0))
    return _OF_MEDIAN * float(np.median(miss))


def _gaps(theta: FloatArray, s: FloatArray, low: float) -> list[Fault]:
    """Return the first gap on the lift; a missing range at the ends of a table is checked elsewhere."""
    high = np.maximum(s[:-1], s[1:]) > low
    bent = _max_curvature_deviation(theta, s) > _BASE * float(s.max())
    gap = wide_steps(theta)[:-1] & high & (bent | (np.diff(theta) > _WIDE))
    if not gap.any():
        return []
    i = int(np.argmax(gap))
    given = f"no point between {math.degrees(theta[i]):g} and {math.degrees(theta[i + 1]):g} deg"
    return [
        Fault(f"angle, row {i + 2}", given, "an even cover of the lift", "a gap would be invented", "measure there")
    ]


def _max_curvature_deviation(theta: FloatArray, s: FloatArray) -> FloatArray:
    """Return the possible deviation of the lift from a straight line in each step, from the slopes on both sides.

    Each slope is taken over the angle of the step itself, which reduces the effect of noise.
    """
    step, slope = np.diff(theta), np.diff(s) / np.diff(theta)
    at = np.arange(len(step))
    before = np.maximum(np.searchsorted(theta, theta[:-1] - step, side="right") - 1, 0)
    after = np.minimum(np.searchsorted(theta, theta[1:] + step), len(theta) - 1)
    left = np.where(before < at, (s[at] - s[before]) / np.where(before < at, theta[at] - theta[before], 1.0), slope)
    inner = after > at + 1
    right = np.where(inner, (s[after] - s[at + 1]) / np.where(inner, theta[after] - theta[at + 1], 1.0), slope)
    return np.maximum(np.abs(slope - left), np.abs(right - slope)) * step / 8.0


def wide_steps(theta: FloatArray) -> NDArray[np.bool_]:
    """Return which steps to the next point, around the revolution, are wide compared with their neighbours."""
    step = np.diff(theta, append=theta[0] + _REVOLUTION)
    beside = np.maximum(np.roll(step, 1), np.roll(step, -1))
    return (step > _WIDE) | ((step > _GAP) & (step > _GAP_RATIO * beside))


def _periodicity_fault(theta: FloatArray, s: FloatArray, low: float) -> list[Fault]:
    """Return the fault of a lift that does not return to its initial value."""
    jump = abs(float(s[-1] - s[0]))
    if theta[-1] - theta[0] > _REVOLUTION - 1e-9:  # the last row repeats the first
        closes = jump <= low
    elif wide_steps(theta)[-1]:  # the base circle is omitted
        closes = max(float(s[0]), float(s[-1])) <= low
    else:
        closes = jump <= low + _GAP_RATIO * float(np.abs(np.diff(s)).max())
    if closes:
        return []
    given = (
        f"{1e3 * s[0]:g} mm at {math.degrees(theta[0]):g} deg, {1e3 * s[-1]:g} mm at {math.degrees(theta[-1]):g} deg"
    )
    allowed = "a lift that begins and ends on the base circle, or runs on into itself"
    return [Fault("lift", given, allowed, "the lift repeats every revolution", "measure the whole lift")]
