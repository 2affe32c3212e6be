"""A measured or imported lift: points over the cam angle made into a periodic spline, and what that changed."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from flexcam.checks import Fault, InputError, finite_array, refuse
from flexcam.linalg import FloatArray
from flexcam.motion.periodic import DEGREE, PeriodicSpline, spline_rows

_REVOLUTION = 2.0 * math.pi
_LEAST_POINTS = 12
_STEP = math.radians(1.0)
"""Spacing of the points that are added on the base circle."""

_MOST_KNOTS, _MOST_KNOTS_THROUGH = 360, 720
"""A knot per degree of cam angle; two for a spline that is to pass through its points."""

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


def lift_table(
    angle: ArrayLike, lift: ArrayLike, *, tolerance: float | None = None
) -> tuple[PeriodicSpline, LiftReport]:
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
        720); None to judge the noise by
        generalized cross-validation.

    Returns
    -------
    PeriodicSpline, LiftReport
        The event, and what was changed.

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
    theta, s = finite_array("angle", angle, (None,)), finite_array("lift", lift, (None,))
    if tolerance is not None and not (math.isfinite(tolerance) and tolerance >= 0.0):
        raise refuse("tolerance", tolerance, "a length of zero or more, m")
    faults = _faults(theta, s)
    if faults:
        raise InputError(faults)
    theta, s = _closed(theta, s)
    fit = _Fit.of(*_with_base_circle(theta, s), _MOST_KNOTS_THROUGH if tolerance == 0.0 else _MOST_KNOTS)
    weight = _strongest(fit, tolerance) if tolerance is not None else _cross_validated(fit)
    spline = PeriodicSpline(fit.coefficients(weight))
    return spline, _report(theta, s, spline, weight)


def _faults(theta: FloatArray, s: FloatArray) -> list[Fault]:
    """Return what is wrong with a table, by rows counted from 1."""
    if len(theta) != len(s):
        return [Fault("lift", f"{len(s)} values", f"{len(theta)}, one per angle", "", "")]
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
        remedy = "say that they are crank angles, or cut the table"
        found.append(Fault("angle", given, "360 deg at most", "the lift repeats every revolution", remedy))
    top = float(s.max())
    if top <= 0.0:
        return [*found, Fault("lift", f"{top:g} m at most", "a lift above zero", "", "")]
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
    if theta[-1] - theta[0] > _REVOLUTION - _WIDE:
        closes = abs(s[-1] - s[0]) <= _BASE * top or theta[-1] - theta[0] < _REVOLUTION - 1e-9
    else:
        closes = max(s[0], s[-1]) <= _BASE * top
    if closes:
        return []
    given = (
        f"{1e3 * s[0]:g} mm at {math.degrees(theta[0]):g} deg, {1e3 * s[-1]:g} mm at {math.degrees(theta[-1]):g} deg"
    )
    return [Fault("lift", given, "a lift that begins and ends on the base circle", "", "measure the whole lift")]


def _closed(theta: FloatArray, s: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the table without a last row that repeats the first one a revolution later."""
    twice = theta[-1] - theta[0] > _REVOLUTION - 1e-9
    return (theta[:-1], s[:-1]) if twice else (theta, s)


def _with_base_circle(theta: FloatArray, s: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the points with more on the base circle, where the table leaves it out."""
    ends, lifts = np.append(theta, theta[0] + _REVOLUTION), np.append(s, s[0])
    angles, heights = [theta], [s]
    for i in np.flatnonzero(_wide(theta)).tolist():
        start, end = float(ends[i]), float(ends[i + 1])
        new = np.linspace(start, end, math.ceil((end - start) / _STEP) + 1)[1:-1]
        angles.append(new)
        heights.append(np.interp(new, ends[i : i + 2], lifts[i : i + 2]))
    return np.concatenate(angles), np.concatenate(heights)


@dataclass(frozen=True, eq=False)
class _Fit:
    """Normal equations of the smoothing: design matrix, its square, the roughness, the points."""

    rows: FloatArray
    square: FloatArray
    rough: FloatArray
    lift: FloatArray

    @classmethod
    def of(cls, theta: FloatArray, s: FloatArray, most: int) -> _Fit:
        knots = min(most, max(len(theta), 2 * (DEGREE + 1)))
        index, weight = spline_rows(theta, knots)
        rows = np.zeros((len(theta), knots))
        np.put_along_axis(rows, index, weight, axis=1)
        # Third differences of the coefficients stand for the third derivative; their square is the roughness.
        third = np.eye(knots)
        for _ in range(3):
            third = np.roll(third, -1, axis=0) - third
        square = rows.T @ rows
        rough = third.T @ third
        return cls(rows, square, rough * (np.trace(square) / np.trace(rough)), s)

    def coefficients(self, weight: float) -> FloatArray:
        return np.asarray(np.linalg.solve(self.square + weight * self.rough, self.rows.T @ self.lift), dtype=float)

    def change(self, weight: float) -> float:
        return float(np.sqrt(np.mean((self.rows @ self.coefficients(weight) - self.lift) ** 2)))

    def score(self, weight: float) -> float:
        """Return the generalized cross-validation: mean square change over (1 - c trace/m)^2."""
        used = float(np.trace(np.linalg.solve(self.square + weight * self.rough, self.square)))
        m = len(self.lift)
        return math.inf if _CAUTION * used >= m else (self.change(weight) / (1.0 - _CAUTION * used / m)) ** 2


_LEAST, _MOST = -12.0, 8.0
"""Powers of ten between which the weight of roughness lies; the roughness is scaled to the square of the rows."""


def _strongest(fit: _Fit, tolerance: float) -> float:
    """Return the largest weight that changes the points by no more than the tolerance."""
    low, high = _LEAST, _MOST
    if fit.change(10.0**low) >= tolerance:
        return 10.0**low
    for _ in range(40):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if fit.change(10.0**middle) <= tolerance else (low, middle)
    return 10.0**low


def _cross_validated(fit: _Fit) -> float:
    powers = np.arange(_LEAST, _MOST + 1.0)
    best = float(powers[_least(fit, powers)])
    fine = best + np.linspace(-1.0, 1.0, 9)
    return 10.0 ** float(fine[_least(fit, fine)])


def _least(fit: _Fit, powers: FloatArray) -> int:
    score: Callable[[float], float] = fit.score
    return int(np.argmin([score(10.0**power) for power in powers]))


def _report(theta: FloatArray, s: FloatArray, spline: PeriodicSpline, weight: float) -> LiftReport:
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
