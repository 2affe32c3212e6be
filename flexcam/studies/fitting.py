"""Fit of values of a case to measured curves: bounded least squares, confidence intervals, identifiability."""

# pyright: reportMissingTypeStubs=false, reportUnknownMemberType=false, reportUnknownVariableType=false

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from flexcam.core import FloatArray
from flexcam.core.errors import refuse
from flexcam.dynamics import RunFailedError
from flexcam.studies.evaluation import Row
from flexcam.studies.evaluators import PointEvaluator
from flexcam.studies.measurement import Measurement

_SINGULAR = 1e-3
"""Singular value of the scaled Jacobian, relative to the largest, below which values cannot be determined."""

_STEP = 1e-3
"""Step of central differences, relative to the interval of a value."""

_FAILED = 1e6
"""Residual, in units of the noise, of a trial whose run fails, so that the search takes a shorter step."""


@dataclass(frozen=True, eq=False)
class Fit:
    """Result of a fit; k values, n measured numbers."""

    start: FloatArray  #: values before, in the units of the variables, shape (k,)
    values: FloatArray  #: fitted values, shape (k,)
    intervals: FloatArray  #: half widths of the 95 % confidence intervals, shape (k,); infinite if not determined
    correlation: FloatArray  #: of the estimates, shape (k, k)
    undetermined: tuple[tuple[int, ...], ...]  #: sets of values that only together, or not at all, change the curves
    noise: FloatArray  #: standard deviations by curve, given or estimated, SI
    misfit: float  #: root mean square of the residuals relative to the noise
    before: FloatArray  #: curves at the start, shape (curves, m)
    after: FloatArray  #: curves at the end
    serial: FloatArray  #: correlation of successive residuals by curve
    runs: int  #: number of runs
    converged: bool  #: whether the search met its tolerance

    @staticmethod
    def rms(measured: Measurement, curves: FloatArray) -> FloatArray:
        """Return the root mean square of the residuals of each curve."""
        return np.sqrt(np.nanmean((curves - [one.values for one in measured.curves]) ** 2, axis=1))

    def correlated_pairs(self) -> list[tuple[int, int]]:
        """Return the pairs of values with an absolute correlation above 0.95."""
        lost = {i for group in self.undetermined for i in group}
        pairs = np.argwhere(np.tril(np.abs(self.correlation), -1) > 0.95).tolist()
        return [(j, i) for i, j in pairs if not {i, j} & lost]


@dataclass
class _Residuals:
    """Residuals of the curves relative to the noise, by values as fractions of their intervals; it counts its runs."""

    points: PointEvaluator
    measured: FloatArray
    noise: FloatArray
    runs: int = 0

    def curves(self, parts: FloatArray) -> FloatArray:
        """Return the curves of one point; raise an error if its run fails."""
        return self._curves(self._rows(parts[None])[0])

    def residuals(self, parts: FloatArray) -> FloatArray:
        known = ~np.isnan(self.measured)
        try:
            return ((self.curves(parts) - self.measured) / self.noise[:, None])[known]
        except RunFailedError:
            return np.full(int(known.sum()), _FAILED)

    def jacobian(self, parts: FloatArray) -> FloatArray:
        """Return the central differences, and those to one side where the run at the other side fails."""
        count = len(parts)
        steps = _STEP * np.eye(count)
        ends = np.clip(np.concatenate([parts + steps, parts - steps]), 0.0, 1.0)
        rows = self._rows(ends)
        if failed := [i for i, row in enumerate(rows) if row.history is None]:
            middle = self._rows(parts[None])[0]
            for i in failed:
                if np.array_equal(ends[(i + count) % (2 * count)], parts):
                    raise RunFailedError(rows[i].status)
                ends[i], rows[i] = parts, middle
        upper, lower = np.split(np.array([self._curves(row) for row in rows]) / self.noise[:, None], 2)
        widths = (ends[:count] - ends[count:]).sum(axis=1)
        return ((upper - lower) / widths[:, None, None])[:, ~np.isnan(self.measured)].T

    def _rows(self, parts: FloatArray) -> list[Row]:
        low, high = np.array([(one.low, one.high) for one in self.points.variables]).T
        self.runs += len(parts)
        return self.points.rows(low + parts * (high - low))

    def _curves(self, row: Row) -> FloatArray:
        if row.history is None:
            raise RunFailedError(row.status)
        return np.frombuffer(row.history[1]).reshape(self.measured.shape)


def estimate_covariance(J: FloatArray) -> tuple[FloatArray, tuple[tuple[int, ...], ...]]:
    """Return the covariance of the estimates for residuals of unit variance, and the sets of undetermined values.

    J is the Jacobian of the residuals, shape (n, k). Directions in which the curves hardly change are left out.
    """
    norms = np.linalg.norm(J, axis=0)
    sizes = np.where(norms > 0.0, norms, 1.0)
    _, singular, directions = np.linalg.svd(J / sizes, full_matrices=False)
    weak = singular <= _SINGULAR * singular.max()
    undetermined = tuple(tuple(np.flatnonzero(np.abs(row) > 0.01).tolist()) for row in directions[weak])
    regular = directions[~weak] / singular[~weak, None]
    return regular.T @ regular / np.outer(sizes, sizes), undetermined


def fit_curves(points: PointEvaluator, measured: Measurement, *, steps: int = 50) -> Fit:
    """Fit the variables of a case to measured curves by weighted least squares within their intervals.

    Trust region reflective: M. A. Branch, T. F. Coleman and Y. Li, SIAM J. Sci. Comput. 21 (1999) 1. The intervals are
    those of the linearized problem, with Student's t: G. A. F. Seber and C. J. Wild, Nonlinear Regression (1989).
    """
    from scipy.optimize import least_squares
    from scipy.stats import t as student

    variables = points.variables
    low, high = np.array([(one.low, one.high) for one in variables]).T
    wanted = np.array([curve.values for curve in measured.curves])
    known = ~np.isnan(wanted)
    free = int(known.sum()) - len(variables)
    if free < 1:
        raise refuse("--to", f"{known.sum()} measured numbers", f"more than the {len(variables)} values to be fitted")
    if outside := [one.key for one in variables if one.start is not None and not 0.0 <= one.start <= 1.0]:
        raise refuse("--vary", outside[0], "an interval that contains the value of the case", "the search begins there")
    begin = np.array([0.5 if one.start is None else one.start for one in variables])
    spread = np.array([np.nanstd(curve.values) or 1.0 for curve in measured.curves])
    given = np.array([curve.noise or math.nan for curve in measured.curves])
    unknown = np.isnan(given)
    problem = _Residuals(points, wanted, np.where(unknown, spread, given))

    def search(parts: FloatArray) -> tuple[FloatArray, FloatArray, bool]:
        found = least_squares(
            problem.residuals, parts, jac=problem.jacobian, bounds=(0.0, 1.0), x_scale="jac", xtol=1e-10, max_nfev=steps
        )
        return found.x, problem.curves(found.x), bool(found.status > 0)

    def noise(curves: FloatArray) -> FloatArray:
        estimated = Fit.rms(measured, curves) * math.sqrt(known.sum() / free)
        return np.where(unknown, np.maximum(estimated, 1e-12 * spread), given)

    before = problem.curves(begin)
    parts, after, converged = search(begin)
    if unknown.any() and len(given) > 1:  # again, with the noise estimated by curve
        problem.noise = noise(after)
        parts, after, converged = search(parts)
    problem.noise = noise(after)
    misfit = math.sqrt((problem.residuals(parts) ** 2).sum() / free)
    covariance, undetermined = estimate_covariance(problem.jacobian(parts))
    deviation = np.sqrt(np.diag(covariance))
    scale = np.where(deviation > 0.0, deviation, 1.0)
    intervals = student.ppf(0.975, free) * deviation * (misfit if unknown.all() else 1.0) * (high - low)
    intervals[sorted({i for group in undetermined for i in group})] = math.inf
    rest = np.where(known, after - wanted, 0.0)[:, np.argsort(measured.instants)]
    rounding = (1e-9 * spread[:, None] * known).sum(axis=1) ** 2
    serial = (rest[:, 1:] * rest[:, :-1]).sum(axis=1) / ((rest**2).sum(axis=1) + rounding)
    return Fit(
        low + begin * (high - low), low + parts * (high - low), intervals, covariance / np.outer(scale, scale),
        undetermined, problem.noise, misfit, before, after, serial, problem.runs, converged,
    )  # fmt: skip
