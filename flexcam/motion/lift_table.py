"""A measured or imported lift: points over the cam angle made into a periodic spline, and what that changed."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from flexcam.checks import Fault, InputError, refuse
from flexcam.linalg import FloatArray
from flexcam.motion.event import Shifted
from flexcam.motion.periodic import DEGREE, PeriodicSpline, spline_rows

_REVOLUTION = 2.0 * math.pi
_LEAST_POINTS = 12
_STEP = math.radians(1.0)
"""Spacing of the points that are added on the base circle."""

_KNOTS = (360, 720, 1440)
"""A knot per degree of cam angle; more where the tolerance asks for it."""

_BASE = 0.01
"""Part of the largest lift below which a point lies on the base circle."""

_GAP, _GAP_RATIO, _WIDE = math.radians(3.0), 3.0, math.radians(20.0)
"""A gap is wider than 3 deg and three times its neighbours, or wider than 20 deg."""

_CAUTION = 1.4
"""Weight of the degrees of freedom in cross-validation: 1 now and then follows the noise (Kim and Gu 2004)."""


@dataclass(frozen=True)
class LiftReport:
    """What smoothing changed.

    Parameters
    ----------
    points
        How many were given.
    rms_change, largest_change, at
        Root mean square and largest difference of spline and points, m, and the cam angle of the latter, rad.
    acceleration_before, acceleration_after
        Least and largest second derivative by the cam angle, m/rad^2: of the points by differences, and of the spline.
    smoothing
        The weight of roughness that was found.
    """

    points: int
    rms_change: float
    largest_change: float
    at: float
    acceleration_before: tuple[float, float]
    acceleration_after: tuple[float, float]
    smoothing: float


def lift_table(angle: ArrayLike, lift: ArrayLike, *, tolerance: float | None = None) -> tuple[Shifted, LiftReport]:
    """Make a periodic spline of a lift given by points.

    The spline minimizes the squared distances plus a weight times the integral of its squared third derivative
    (C. H. Reinsch, Smoothing by spline functions, Numerische Mathematik 10 (1967); here on even knots, P. H. C. Eilers
    and B. D. Marx, Flexible smoothing with B-splines and penalties, Statistical Science 11 (1996)).

    Parameters
    ----------
    angle
        Cam angles, rad, ascending, over one revolution at most, shape (m,). What they leave out is base circle.
    lift
        m, shape (m,).
    tolerance
        Root mean square of what smoothing may change, m; 0 to pass through the points (of up to
        1440); None to judge the noise by
        generalized cross-validation.

    Returns
    -------
    Shifted, LiftReport
        The event, a `PeriodicSpline` with its first knot at the first point, and what was changed.

    Raises
    ------
    InputError
        If angles do not ascend or take more than a revolution, points are too few or leave gaps, lift is negative or
        does not come back to where it began.

    Examples
    --------
    >>> angle = np.linspace(0.0, 2.0 * np.pi, 73)
    >>> event, report = lift_table(angle, 0.003 * (1.0 - np.cos(angle)), tolerance=0.0)
    >>> report.largest_change < 1e-9
    True
    """
    theta, s = _column("angle", angle), _column("lift", lift)
    if tolerance is not None and not (math.isfinite(tolerance) and tolerance >= 0.0):
        raise refuse("tolerance", tolerance, "a length of zero or more, m")
    faults = _faults(theta, s)
    if faults:
        raise InputError(faults)
    theta, s = _closed(theta, s)
    local = theta - theta[0]  # knots lie on the points of an even table: elsewhere a spline through them may not exist
    around, heights = _with_base_circle(local, s)
    if tolerance is None:
        fit = _Fit.of(around, heights, len(s), _KNOTS[0])
        weight = _cross_validated(fit)
    else:
        fit, weight = _within(around, heights, len(s), tolerance)
    event = Shifted(PeriodicSpline(fit.coefficients(weight)), float(theta[0]))
    return event, _report(theta, s, event, weight)


def _column(name: str, values: ArrayLike) -> FloatArray:
    """Return a column as numbers; which of them are none is told with their rows."""
    try:
        column = np.array(values, dtype=float)
    except (TypeError, ValueError):
        raise refuse(name, str(values)[:60], "an array of numbers") from None
    if column.ndim != 1:
        raise refuse(name, f"shape {column.shape}", "a plain column of numbers")
    return column


def _within(theta: FloatArray, s: FloatArray, count: int, tolerance: float) -> tuple[_Fit, float]:
    """Return the fit and the largest weight of roughness that keep to a tolerance, with as few knots as do."""
    fit = _Fit.of(theta, s, count, _KNOTS[0])
    least = fit.change(_LEAST)
    for most in _KNOTS[1:]:
        if least <= tolerance or fit.rows.shape[1] >= len(theta):
            break
        fit = _Fit.of(theta, s, count, most)
        least = fit.change(_LEAST)
    if least <= tolerance:
        return fit, _strongest(fit, tolerance)
    if tolerance > 0.0:
        given = f"{1e6 * tolerance:.4g} um for {count} points"
        why = f"a spline of {_KNOTS[-1]} knots cannot follow them closer"
        raise refuse("tolerance", given, f"{1e6 * least:.4g} um or more", why, "allow more: the points scatter")
    return fit, _LEAST


def _faults(theta: FloatArray, s: FloatArray) -> list[Fault]:
    """Return what is wrong with a table, by rows counted from 1."""
    if len(theta) != len(s):
        given = f"{len(s)} lifts at {len(theta)} angles"
        return [Fault("lift table", given, "one lift per angle", "", "complete or remove the odd row")]
    lost = np.flatnonzero(~(np.isfinite(theta) & np.isfinite(s)))
    if lost.size:
        i = int(lost[0])
        given = f"angle {math.degrees(theta[i]):g} deg, lift {1e3 * s[i]:g} mm"
        return [Fault(f"lift table, row {i + 1}", given, "finite numbers", "", "mend or remove the row")]
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
    below = np.flatnonzero(s < -_BASE * top)
    if below.size:
        i = int(below[0])
        given = f"{1e3 * s[i]:g} mm at {math.degrees(theta[i]):g} deg"
        found.append(Fault(f"lift, row {i + 1}", given, "zero or more", "a follower cannot enter the base circle",
                           "subtract the base circle's reading"))  # fmt: skip
    return found or [*_gaps(theta, s, top), *_open_end(theta, s, top)]


def _gaps(theta: FloatArray, s: FloatArray, top: float) -> list[Fault]:
    """Return the first gap on the lift; what a table leaves out at its ends is another matter."""
    wide = _wide(theta)[:-1] & (np.maximum(s[:-1], s[1:]) > _BASE * top)
    if not wide.any():
        return []
    i = int(np.argmax(wide))
    given = f"no point between {math.degrees(theta[i]):g} and {math.degrees(theta[i + 1]):g} deg"
    return [
        Fault(f"angle, row {i + 2}", given, "an even cover of the lift", "a gap would be invented", "measure there")
    ]


def _wide(theta: FloatArray) -> NDArray[np.bool_]:
    """Tell which steps to the next point, around the revolution, are gaps."""
    step = np.diff(theta, append=theta[0] + _REVOLUTION)
    beside = np.maximum(np.roll(step, 1), np.roll(step, -1))
    return (step > _WIDE) | ((step > _GAP) & (step > _GAP_RATIO * beside))


def _open_end(theta: FloatArray, s: FloatArray, top: float) -> list[Fault]:
    """Return the fault of a lift that does not come back to where it began."""
    jump, low = abs(float(s[-1] - s[0])), _BASE * top
    if theta[-1] - theta[0] > _REVOLUTION - 1e-9:  # the last row repeats the first
        closes = jump <= low
    elif _wide(theta)[-1]:  # the base circle is left out
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


def _closed(theta: FloatArray, s: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the table without a last row that repeats the first one a revolution later."""
    twice = theta[-1] - theta[0] > _REVOLUTION - 1e-9
    return (theta[:-1], s[:-1]) if twice else (theta, s)


def _with_base_circle(theta: FloatArray, s: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the points with more on the base circle, where the table leaves it out."""
    ends, lifts = np.append(theta, theta[0] + _REVOLUTION), np.append(s, s[0])
    spacing = min(_STEP, float(np.median(np.diff(theta))))
    angles, heights = [theta], [s]
    for i in np.flatnonzero(_wide(theta)).tolist():
        start, end = float(ends[i]), float(ends[i + 1])
        new = np.linspace(start, end, math.ceil((end - start) / spacing) + 1)[1:-1]
        angles.append(new)
        heights.append(np.interp(new, ends[i : i + 2], lifts[i : i + 2]))
    return np.concatenate(angles), np.concatenate(heights)


@dataclass(frozen=True, eq=False)
class _Fit:
    """What smoothing works on.

    Rows of the spline at the points and their square, those of the measured points alone, third differences of the
    coefficients (which stand for the third derivative) and their square, and the lifts.
    """

    rows: FloatArray
    square: FloatArray
    measured: FloatArray
    third: FloatArray
    rough: FloatArray
    lift: FloatArray
    count: int

    @classmethod
    def of(cls, theta: FloatArray, s: FloatArray, count: int, most: int) -> _Fit:
        knots = min(most, max(len(theta), 2 * (DEGREE + 1)))
        index, weight = spline_rows(theta, knots)
        rows = np.zeros((len(theta), knots))
        np.put_along_axis(rows, index, weight, axis=1)
        third = np.eye(knots)
        for _ in range(3):
            third = np.roll(third, -1, axis=0) - third
        square, rough = rows.T @ rows, third.T @ third
        scale = float(np.trace(square) / np.trace(rough))
        measured = rows[:count].T @ rows[:count]
        return cls(rows, square, measured, math.sqrt(scale) * third, scale * rough, s, count)

    def coefficients(self, weight: float) -> FloatArray:
        if weight > _ILL:
            found = np.linalg.solve(self.square + weight * self.rough, self.rows.T @ self.lift)
        else:  # the normal equations would lose so small a weight
            both = np.vstack([self.rows, math.sqrt(weight) * self.third])
            right = np.concatenate([self.lift, np.zeros(len(self.third))])
            found = np.linalg.lstsq(both, right, rcond=None)[0]
        return np.asarray(found, dtype=float)

    def change(self, weight: float) -> float:
        """Return the root mean square of what the measured points are changed by."""
        change = self.rows[: self.count] @ self.coefficients(weight) - self.lift[: self.count]
        return float(np.sqrt(np.mean(change**2)))

    def score(self, weight: float) -> float:
        """Return the generalized cross-validation of the measured points: mean square change over (1 - c trace/m)^2."""
        used = float(np.trace(np.linalg.solve(self.square + weight * self.rough, self.measured)))
        m = self.count
        return math.inf if _CAUTION * used >= m else (self.change(weight) / (1.0 - _CAUTION * used / m)) ** 2


_ILL = 1e-7
_LEAST, _LOWEST, _HIGHEST = 1e-9, -7.0, 8.0
"""Weight of roughness where nothing is to be changed, and powers of ten between which it is sought otherwise; the
roughness is scaled to the square of the rows."""


def _strongest(fit: _Fit, tolerance: float) -> float:
    """Return the largest weight that changes the points by no more than the tolerance."""
    low, high = _LOWEST, _HIGHEST
    if fit.change(10.0**low) > tolerance:
        return _LEAST
    for _ in range(30):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if fit.change(10.0**middle) <= tolerance else (low, middle)
    return 10.0**low


def _cross_validated(fit: _Fit) -> float:
    powers = np.arange(_LOWEST + 1.0, _HIGHEST + 1.0)
    best = float(powers[_least(fit, powers)])
    fine = best + np.linspace(-1.0, 1.0, 9)
    return 10.0 ** float(fine[_least(fit, fine)])


def _least(fit: _Fit, powers: FloatArray) -> int:
    score: Callable[[float], float] = fit.score
    return int(np.argmin([score(10.0**power) for power in powers]))


def _report(theta: FloatArray, s: FloatArray, spline: Shifted, weight: float) -> LiftReport:
    change = spline(theta) - s
    worst = int(np.argmax(np.abs(change)))
    fine = spline(np.linspace(0.0, _REVOLUTION, 3601), 2)
    raw = _second_differences(theta, s)
    return LiftReport(
        len(theta), float(np.sqrt(np.mean(change**2))), float(abs(change[worst])), float(theta[worst]),
        (float(raw.min()), float(raw.max())), (float(fine.min()), float(fine.max())), weight,
    )  # fmt: skip


def _second_differences(theta: FloatArray, s: FloatArray) -> FloatArray:
    left, right = np.diff(theta)[:-1], np.diff(theta)[1:]
    slope = np.diff(s) / np.diff(theta)
    return 2.0 * np.diff(slope) / (left + right)
