"""Measured or imported lift tables: checks, smoothing by a periodic spline, and a report of the changes."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import ArrayLike, NDArray

from flexcam.cams.lift_event import GRID, DelayedEvent, Event
from flexcam.core import FloatArray
from flexcam.core.errors import Fault, InputError, finite_array, format_shape, refuse
from flexcam.core.units import DIMENSIONS

if TYPE_CHECKING:
    from scipy.interpolate import BSpline

_STEP, _MIN_STEP = math.radians(1.0), math.radians(0.1)  # spacing of the points added on the base circle
_KNOTS = (360, 720, 1440)  # initial number of knots, one per degree of cam angle; the tolerance may require more
_FAR, _SMALL = 8.0, 5e-4  # an outlier moves by more than eight times the scatter and 1/2000 of the lift
_INTERPOLATION_TOLERANCE = 1e-5  # rms deviation, relative to the lift, up to which a spline interpolates the points
_BELOW = 1e-4  # fraction of the largest lift by which a spline may fall below the base circle without a warning
MAX_LIFT = 0.5  # lift, m, above which a number was probably meant in mm
_DOF_WEIGHT = 1.4  # of the degrees of freedom in cross-validation; 1 sometimes follows the noise (Kim and Gu 2004)
_DEGREE = 5  # of the spline


def _spline_knots(count: int) -> FloatArray:
    """Return the knots of the periodic B-splines of degree 5, which begin and end outside of the revolution."""
    return math.tau / count * np.arange(-_DEGREE, count + _DEGREE + 1, dtype=np.float64)


@dataclass(frozen=True, eq=False)
class PeriodicSpline(Event):
    """Lift over a revolution as a spline of degree 5 with equally spaced knots and continuous fourth derivative."""

    coefficients: FloatArray  #: m, shape (n,), one per knot, 12 or more

    def __post_init__(self) -> None:
        values = finite_array("coefficients", self.coefficients, (None,))
        if len(values) < 2 * (_DEGREE + 1):
            raise refuse("coefficients", f"{len(values)} values", f"{2 * (_DEGREE + 1)} or more")
        object.__setattr__(self, "coefficients", values)

    def __call__(self, angle: FloatArray, order: int = 0) -> FloatArray:
        """Return the derivative of the given order (0 to 4) by the cam angle (rad), m/rad^order, shape as `angle`."""
        return np.asarray(self._derivatives[order](np.mod(angle, math.tau)), dtype=float)

    @cached_property
    def _derivatives(self) -> tuple[BSpline[np.float64], ...]:
        from scipy.interpolate import BSpline

        around = np.append(self.coefficients, self.coefficients[:_DEGREE])
        spline = BSpline(_spline_knots(len(self.coefficients)), around, _DEGREE)
        return tuple(spline.derivative(order) if order else spline for order in range(_DEGREE))


@dataclass(frozen=True)
class LiftReport:
    """Changes of a lift table by smoothing."""

    points: int  #: number of points given
    #: `rms_change`, `largest_change`, `at`: differences of spline and points, m, and the angle of the largest, rad
    rms_change: float
    largest_change: float
    at: float
    #: `acceleration_before`, `acceleration_after`: range by differences of the points, and of the spline, m/rad^2
    acceleration_before: tuple[float, float]
    acceleration_after: tuple[float, float]
    smoothing: float  #: roughness weight of the fit
    scatter: float  #: estimated standard deviation of the noise of the points, m
    remarks: tuple[str, ...]  #: warnings, in words


def lift_table(angle: ArrayLike, lift: ArrayLike, *, tolerance: float | None = None) -> tuple[DelayedEvent, LiftReport]:
    """Return a periodic spline for a lift given by points.

    The spline minimizes the squared distances plus a weight times the integral of its squared third derivative
    (C. H. Reinsch, Smoothing by spline functions, Numerische Mathematik 10 (1967); here on even knots, P. H. C. Eilers
    and B. D. Marx, Flexible smoothing with B-splines and penalties, Statistical Science 11 (1996)).

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
    if faults := find_table_faults(theta, s):
        raise InputError(faults)
    if theta[-1] - theta[0] > math.tau - 1e-9:  # the last row repeats the first
        theta, s = theta[:-1], s[:-1]
    local = theta - theta[0]  # knots on equally spaced points: elsewhere an interpolating spline may not exist
    around, heights = _add_base_circle(local, s)
    noise = scatter(theta, s)
    if tolerance is None:
        fit, weight = _fit_by_cross_validation(around, heights, len(s), noise)
    else:
        fit, weight = _fit_within_tolerance(around, heights, len(s), tolerance)
    event = DelayedEvent(PeriodicSpline(fit.coefficients(weight)), float(theta[0]))
    change = event(theta) - s
    worst = int(np.argmax(np.abs(change)))
    fine = event(np.linspace(0.0, math.tau, 3601), 2)
    raw = 2.0 * np.diff(np.diff(s) / np.diff(theta)) / (np.diff(theta)[:-1] + np.diff(theta)[1:])
    return event, LiftReport(
        len(theta), float(np.sqrt(np.mean(change**2))), float(abs(change[worst])), float(theta[worst]),
        (float(raw.min()), float(raw.max())), (float(fine.min()), float(fine.max())), weight,
        noise, tuple(_remarks(theta, s, event, noise, tolerance)),
    )  # fmt: skip


def _column(name: str, values: ArrayLike) -> FloatArray:
    """Return a column as numbers; non-finite values are reported later with their rows."""
    try:
        column = np.array(values, dtype=float)
    except (TypeError, ValueError):
        raise refuse(name, str(values)[:60], "an array of numbers") from None
    if column.ndim != 1:
        raise refuse(name, f"shape {format_shape(column.shape)}", "a plain column of numbers")
    return column


def _fit_by_cross_validation(theta: FloatArray, s: FloatArray, count: int, noise: float) -> tuple[_Fit, float]:
    """Return the fit by cross-validation, with more knots if fewer knots leave outliers.

    If more knots do not halve the deviation, the point is an outlier and the coarser spline is used.
    """
    fit = _Fit(theta, s, count, _KNOTS[0])
    weight = _minimize_cross_validation(fit)
    allowed = _FAR * noise + _SMALL * float(s.max())
    for knots in _KNOTS[1:]:
        if fit.largest_change(weight) <= allowed or fit.rows.shape[1] >= len(theta):
            break
        finer = _Fit(theta, s, count, knots)
        finer_weight = _minimize_cross_validation(finer, expected=math.log10(weight) + _WEIGHT_PER_HALVING)
        if finer.largest_change(finer_weight) <= 0.5 * fit.largest_change(weight):
            fit, weight = finer, finer_weight
    return fit, weight


def _fit_within_tolerance(theta: FloatArray, s: FloatArray, count: int, tolerance: float) -> tuple[_Fit, float]:
    """Return the fit with the largest roughness weight and the fewest knots within a tolerance."""
    fit = _Fit(theta, s, count, _KNOTS[0])
    rms = fit.rms_change(_MIN_WEIGHT)
    for knots in _KNOTS[1:]:
        if rms <= tolerance or fit.rows.shape[1] >= len(theta):
            break
        fit = _Fit(theta, s, count, knots)
        rms = fit.rms_change(_MIN_WEIGHT)
    if rms <= tolerance:
        low, high = _LOWEST, _HIGHEST
        if fit.rms_change(10.0**low) > tolerance:
            return fit, _MIN_WEIGHT
        for _ in range(30):
            middle = 0.5 * (low + high)
            low, high = (middle, high) if fit.rms_change(10.0**middle) <= tolerance else (low, middle)
        return fit, 10.0**low
    if tolerance > 0.0:
        given = f"{1e6 * tolerance:.4g} um for {count} points"
        why = f"a spline of {_KNOTS[-1]} knots cannot follow them closer"
        raise refuse("tolerance", given, f"{1e6 * rms:.4g} um or more", why, "allow more, because the points scatter")
    if len(theta) > _KNOTS[-1] and rms > _INTERPOLATION_TOLERANCE * float(s.max()):
        given, allowed = f"0 for {len(theta)} points", f"{1e6 * rms:.4g} um or more, or up to {_KNOTS[-1]} points"
        why = f"a spline of {_KNOTS[-1]} knots cannot pass through them all"
        raise refuse("tolerance", given, allowed, why, "allow some, or leave out points")
    return fit, _MIN_WEIGHT


def _add_base_circle(theta: FloatArray, s: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the points with additional ones on the base circle where the table has none."""
    ends, lifts = np.append(theta, theta[0] + math.tau), np.append(s, s[0])
    spacing = max(min(_STEP, float(np.median(np.diff(theta)))), _MIN_STEP)
    angles, heights = [theta], [s]
    is_base = np.maximum(lifts[:-1], lifts[1:]) <= base_level(theta, s)
    for i in np.flatnonzero(wide_steps(theta) & is_base).tolist():
        start, end = float(ends[i]), float(ends[i + 1])
        added = np.linspace(start, end, math.ceil((end - start) / spacing) + 1)[1:-1]
        angles.append(added)
        heights.append(np.interp(added, ends[i : i + 2], lifts[i : i + 2]))
    return np.concatenate(angles), np.concatenate(heights)


class _Fit:
    """Smoothing problem: spline through points of which the first `count` are measured.

    `third` holds third differences of the coefficients, which stand for the third derivative.
    """

    def __init__(self, theta: FloatArray, s: FloatArray, count: int, max_knots: int) -> None:
        from scipy.interpolate import BSpline

        knots = min(max_knots, max(len(theta), 2 * (_DEGREE + 1)))
        all_rows = BSpline.design_matrix(np.mod(theta, math.tau), _spline_knots(knots), _DEGREE).toarray()
        self.rows: FloatArray = all_rows[:, :knots]
        self.rows[:, :_DEGREE] += all_rows[:, knots:]
        third = np.eye(knots)
        for _ in range(3):
            third = np.roll(third, -1, axis=0) - third
        self.square, rough = self.rows.T @ self.rows, third.T @ third
        scale = float(np.trace(self.square) / np.trace(rough))
        self.third, self.rough = math.sqrt(scale) * third, scale * rough
        self.measured = self.rows[:count].T @ self.rows[:count]
        self.lift, self.count = s, count

    def coefficients(self, weight: float) -> FloatArray:
        """Return the coefficients of the spline at a roughness weight."""
        if weight > _ILL:
            solution = np.linalg.solve(self.square + weight * self.rough, self.rows.T @ self.lift)
        else:  # the normal equations would lose so small a weight
            matrix = np.vstack([self.rows, math.sqrt(weight) * self.third])
            right = np.concatenate([self.lift, np.zeros(len(self.third))])
            solution = np.linalg.lstsq(matrix, right, rcond=None)[0]
        return np.asarray(solution, dtype=float)

    def changes(self, weight: float) -> FloatArray:
        """Return the changes of the measured points."""
        return self.rows[: self.count] @ self.coefficients(weight) - self.lift[: self.count]

    def rms_change(self, weight: float) -> float:
        """Return the root mean square change of the measured points."""
        return float(np.sqrt(np.mean(self.changes(weight) ** 2)))

    def largest_change(self, weight: float) -> float:
        """Return the largest change of a measured point."""
        return float(np.abs(self.changes(weight)).max())

    def score(self, weight: float) -> float:
        """Return the generalized cross-validation score: mean square change over (1 - c trace/m)^2."""
        rough, measured = self._demmler_reinsch
        used, m = float(np.sum(measured / (1.0 + (weight - 1.0) * rough))), self.count
        return math.inf if _DOF_WEIGHT * used >= m else (self.rms_change(weight) / (1.0 - _DOF_WEIGHT * used / m)) ** 2

    @cached_property
    def _demmler_reinsch(self) -> tuple[FloatArray, FloatArray]:
        """Roughness, and square over the measured points, of the functions of the Demmler-Reinsch basis.

        Of each function the square over all points and the roughness add to 1.
        """
        inverse = np.linalg.inv(np.linalg.cholesky(self.square + self.rough))
        rough, vectors = np.linalg.eigh(inverse @ self.rough @ inverse.T)
        shapes = inverse.T @ vectors
        return rough, np.einsum("ij,ij->j", shapes, self.measured @ shapes)


_ILL = 1e-7
_MIN_WEIGHT, _LOWEST, _HIGHEST = 1e-9, -7.0, 8.0
"""Roughness weight for interpolation, and the range of powers of ten of the search otherwise.

The roughness is scaled to the square of the rows.
"""
_WEIGHT_PER_HALVING = 6.0 * math.log10(2.0)  # of its power of ten when the knot spacing is halved


def _minimize_cross_validation(fit: _Fit, expected: float | None = None) -> float:
    """Return the weight of minimum score; with many knots only weights near the expected one are evaluated."""
    powers = np.arange(_LOWEST + 1.0, _HIGHEST + 1.0)
    if expected is not None:
        powers = np.maximum(expected + np.arange(-2.0, 3.0), _LOWEST)
    coarse = float(powers[np.argmin([fit.score(10.0**power) for power in powers])])
    fine = coarse + (np.linspace(-1.0, 1.0, 9) if expected is None else np.array([-0.5, 0.0, 0.5]))
    return 10.0 ** float(fine[np.argmin([fit.score(10.0**power) for power in fine])])


def _remarks(
    theta: FloatArray, s: FloatArray, spline: DelayedEvent, noise: float, tolerance: float | None
) -> list[str]:  # fmt: skip
    """Return warnings: the unit, radii, outliers, large changes by smoothing, and ripple below the base circle."""
    if (top := float(s.max())) > MAX_LIFT:
        return [f"a maximum lift of {top:.4g} m is unusual: did you mean {top:.4g} mm? Check the unit of the lift"]
    if (lowest := float(s.min())) > top - lowest:  # a base circle is larger than the lift
        what = f"the lift is {1e3 * lowest:.4g} mm or more at every angle, and so never on the base circle"
        return [f"{what}: does the table give radii? Subtract the reading on the base circle"]
    if (rows := _find_outliers(theta, s, noise)).size:
        i = int(rows[0])
        given = f"a lift of {1e3 * s[i]:.4g} mm between {1e3 * s[i - 1]:.4g} and {1e3 * s[i + 1]:.4g} mm"
        further = f", as are {rows.size - 1} further rows" if rows.size > 1 else ""
        place = f"row {i + 1}, at {math.degrees(theta[i]):.4g} deg of cam angle"
        return [f"{place}: {given} is an outlier{further}: correct or remove it"]
    change = np.abs(spline(theta) - s)
    changed = np.flatnonzero(change > _FAR * noise + _SMALL * top)
    remarks: list[str] = []
    if changed.size:
        j = int(changed[np.argmax(change[changed])])
        points = "1 point" if changed.size == 1 else f"{changed.size} points"
        estimate = f"the noise estimated from the table ({1e6 * noise:.2g} um)"
        text = f"smoothing moves {points} by more than {_FAR:g} times {estimate}"
        worst = f"{1e6 * change[j]:.3g} um at {math.degrees(theta[j]):.4g} deg of cam angle"
        why = "outliers, a kink in the lift, or too few points on the lobe; check the table, or set a small tolerance"
        if tolerance is not None:
            why = f"reduce the tolerance of {1e6 * tolerance:.3g} um, or correct outliers"
        remarks.append(f"{text}, by up to {worst}: {why}")
    smooth, lowest = spline(GRID), min(float(s.min()), 0.0)
    i = int(np.argmin(smooth))
    if smooth[i] < -max(_BELOW * top, -1.5 * lowest):
        curve = "the spline through the points" if tolerance == 0.0 else "the smoothed lift"
        dip = f"{curve} dips {-1e6 * smooth[i]:.3g} um below the base circle"
        level = "below it" if lowest == 0.0 else f"more than {-1e6 * lowest:.3g} um below it"
        remedy = "check the points there, or add some"
        if tolerance:
            remedy = f"leave out the tolerance of {1e6 * tolerance:.3g} um, or {remedy}"
        place = f"at {math.degrees(GRID[i]):.4g} deg of cam angle"
        remarks.append(f"{dip} {place}, although no point of the table is {level}: {remedy}")
    return remarks


def _find_outliers(theta: FloatArray, s: FloatArray, noise: float) -> NDArray[np.intp]:
    """Return the rows whose lift is far from a cubic through four neighbours, while it spoils the cubics next to it.

    A single wrong lift at equal spacing moves the cubics next to it by two thirds; a bend of a sharp lift by less.
    """
    from scipy.ndimage import median_filter

    differences, weights = _divided_differences(theta, s, 5)
    miss = differences / weights[:, 2]
    mask = np.abs(miss) > _FAR * np.maximum(noise, median_filter(np.abs(miss), _AROUND)) + _BASE * np.quantile(s, _HIGH)
    ratios = -np.stack([miss[:-2], miss[2:]]) / np.where(mask, miss, np.inf)[1:-1]
    return 3 + np.flatnonzero(mask[1:-1] & (np.abs(ratios - _SPOILED) < _BAND).all(axis=0))


_HIGH, _AROUND, _SPOILED, _BAND = 0.9, 17, 2.0 / 3.0, 0.1
"""Quantile of the lifts that a few outliers do not change, rows around an outlier, and share of its neighbours."""


_MIN_POINTS, _MAX_POINTS = 12, 20_000
_MAX_FAULTS = 10
_MIN_RANGE = math.radians(20.0)
"""Minimum cam angle that a table covers; a table of a shorter range usually has its angles in another unit."""

_BASE = 0.01
"""Fraction of the largest lift below which a point is on the base circle, and by which a lift may bend across a gap."""

_SCATTERS = 6.0  # standard deviations of the noise allowed for a point on the base circle: one in 1e9 lies outside
_MIN_LOBE = 0.2  # part of the points with changing lift from which the noise is that of the lobe
_OF_MEDIAN = 1.4826  # ratio of standard deviation to median absolute value of normal noise
_GAP, _GAP_RATIO, _WIDE = math.radians(3.0), 3.0, math.radians(20.0)
"""A step is wide above 3 deg and three times its neighbours, or above 20 deg."""


def find_table_faults(theta: FloatArray, s: FloatArray) -> list[Fault]:
    """Return the faults of a lift table, with rows counted from 1."""
    if len(theta) != len(s):
        given = f"{len(s)} lifts at {len(theta)} angles"
        return [Fault("lift table", given, "one lift per angle", "", "complete or remove the odd row")]
    missing = np.flatnonzero(~(np.isfinite(theta) & np.isfinite(s)))
    faults: list[Fault] = []
    for i in missing[:_MAX_FAULTS].tolist():
        given = f"angle {math.degrees(theta[i]):g} deg, lift {1e3 * s[i]:g} mm"
        faults.append(Fault(f"lift table, row {i + 1}", given, "finite numbers", "", "correct or remove the row"))
    if faults:
        return faults
    if len(theta) < _MIN_POINTS:
        return [Fault("lift table", f"{len(theta)} points", f"{_MIN_POINTS} or more", "", "measure at more angles")]
    if len(theta) > _MAX_POINTS:
        return [Fault("lift table", f"{len(theta)} points", f"up to {_MAX_POINTS}", "", "keep every second row")]
    descending = np.flatnonzero(np.diff(theta) <= 0.0)
    if descending.size:
        i = int(descending[0])
        given = f"{math.degrees(theta[i]):g} deg of cam angle, then {math.degrees(theta[i + 1]):g} deg"
        faults.append(Fault(f"angle, row {i + 2}", given, "angles that ascend", "", "sort the rows, each angle once"))
    elif theta[-1] - theta[0] > math.tau + 1e-9:
        given = f"{math.degrees(theta[-1] - theta[0]):g} deg of cam angle"
        table = 'lift_table = { file = ..., angle = "crank" }'
        remedy = f"shorten the table; for crank angles write crank_deg in its header line, or {table}"
        faults.append(Fault("angle", given, "360 deg at most", "the lift repeats every revolution", remedy))
    elif theta[-1] - theta[0] < _MIN_RANGE:
        given, allowed = f"{math.degrees(theta[-1] - theta[0]):g} deg of cam angle", "20 deg or more"
        remedy = "check the unit of the angles: cam_deg, cam_rad, crank_deg or crank_rad"
        faults.append(Fault("angle", given, allowed, "it is the range of all rows", remedy))
    top, length = float(s.max()), DIMENSIONS["length"]
    if not length.least <= np.abs(s).max() <= length.most or top <= 0.0:
        given, allowed = f"{top + 0.0:g} m as the largest lift", f"{length.least:g} to {length.most:g} m"
        return [*faults, Fault("lift", given, allowed, "", "check the column, its sign and its unit")]
    level = base_level(theta, s) if not faults else _BASE * top
    negative = np.flatnonzero(s < -level)
    if negative.size:
        i = int(negative[0])
        given = f"{1e3 * s[i]:g} mm at {math.degrees(theta[i]):g} deg"
        faults.append(Fault(f"lift, row {i + 1}", given, "zero or more", "a follower cannot enter the base circle",
                           "subtract the reading on the base circle"))  # fmt: skip
    return faults or [*_gaps(theta, s, level), *_periodicity_fault(theta, s, level)]


def base_level(theta: FloatArray, s: FloatArray) -> float:
    """Return the lift below which a point of a table counts as on the base circle, m."""
    return max(_BASE * float(s.max()), _SCATTERS * scatter(theta, s))


def scatter(theta: FloatArray, s: FloatArray) -> float:
    """Return the standard deviation of a table's noise, from the deviation from parabolas through three neighbours.

    Points of equal lift, such as zeros written for the base circle, show no noise and do not count if the lobe has
    its usual width. A narrower lobe has too few points for an estimate.
    """
    differences, weights = _divided_differences(theta, s, 4)
    miss = np.abs(differences) / np.sqrt((weights**2).sum(axis=1))
    changing = np.ptp(sliding_window_view(s, 4), axis=1) > 0.0
    counted = miss[changing] if np.mean(changing) >= _MIN_LOBE else miss
    return _OF_MEDIAN * float(np.median(counted))


def _divided_differences(theta: FloatArray, s: FloatArray, count: int) -> tuple[FloatArray, FloatArray]:
    """Return the divided differences of successive points, shape (m,), and the weights of the points, (m, count)."""
    angles, values = sliding_window_view(theta, count), sliding_window_view(s, count)
    distances = angles[:, :, None] - angles[:, None]
    weights = 1.0 / np.where(np.eye(count, dtype=bool), 1.0, distances).prod(axis=2)
    return (weights * values).sum(axis=1), weights


def _gaps(theta: FloatArray, s: FloatArray, level: float) -> list[Fault]:
    """Return the first gap on the lift; a missing range at the ends of a table is checked elsewhere."""
    lifted = np.maximum(s[:-1], s[1:]) > level
    curved = _max_curvature_deviation(theta, s) > _BASE * float(s.max())
    gap = wide_steps(theta)[:-1] & lifted & (curved | (np.diff(theta) > _WIDE))
    if not gap.any():
        return []
    i = int(np.argmax(gap))
    where, why = f"angle, row {i + 2}", "the lift there is unknown"
    given = f"no point between {math.degrees(theta[i]):g} and {math.degrees(theta[i + 1]):g} deg"
    return [Fault(where, given, "points over the whole lift", why, "measure there")]


def _max_curvature_deviation(theta: FloatArray, s: FloatArray) -> FloatArray:
    """Return the possible deviation of the lift from a straight line in each step, from the slopes on both sides.

    Each slope is taken over the angle of the step itself, which reduces the effect of noise.
    """
    step, slope = np.diff(theta), np.diff(s) / np.diff(theta)
    i = np.arange(len(step))
    before = np.maximum(np.searchsorted(theta, theta[:-1] - step, side="right") - 1, 0)
    after = np.minimum(np.searchsorted(theta, theta[1:] + step), len(theta) - 1)
    left = np.where(before < i, (s[i] - s[before]) / np.where(before < i, theta[i] - theta[before], 1.0), slope)
    inner = after > i + 1
    right = np.where(inner, (s[after] - s[i + 1]) / np.where(inner, theta[after] - theta[i + 1], 1.0), slope)
    return np.maximum(np.abs(slope - left), np.abs(right - slope)) * step / 8.0


def wide_steps(theta: FloatArray) -> NDArray[np.bool_]:
    """Return which steps to the next point, around the revolution, are wide compared with their neighbours."""
    step = np.diff(theta, append=theta[0] + math.tau)
    neighbours = np.maximum(np.roll(step, 1), np.roll(step, -1))
    return (step > _WIDE) | ((step > _GAP) & (step > _GAP_RATIO * neighbours))


def _periodicity_fault(theta: FloatArray, s: FloatArray, level: float) -> list[Fault]:
    """Return the fault of a lift that does not return to its initial value."""
    jump = abs(float(s[-1] - s[0]))
    if theta[-1] - theta[0] > math.tau - 1e-9:  # the last row repeats the first
        closes = jump <= level
    elif wide_steps(theta)[-1]:  # the base circle is omitted
        closes = max(float(s[0]), float(s[-1])) <= level
    else:
        closes = jump <= level + _GAP_RATIO * float(np.abs(np.diff(s)).max())
    if closes:
        return []
    start, end = (f"{1e3 * s[i]:g} mm at {math.degrees(theta[i]):g} deg" for i in (0, -1))
    given, allowed = f"{start}, {end}", "a lift that begins and ends on the base circle or at the same value"
    return [Fault("lift", given, allowed, "the lift repeats every revolution", "measure the whole lift")]
