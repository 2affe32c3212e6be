"""Fit of values of a case to measured curves: curves of a file and of a run, least squares, confidence intervals."""

# pyright: reportMissingTypeStubs=false, reportUnknownMemberType=false, reportUnknownVariableType=false

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import numpy as np

from flexcam.analysis.model_choice import select_case
from flexcam.analysis.preparation import build_problem, prepare
from flexcam.case.case import Case
from flexcam.core import FloatArray
from flexcam.core.errors import positive, refuse, suggest_name
from flexcam.core.units import conversion_factor
from flexcam.dynamics import SERIES, Outline, RunFailedError, SaveAt, Status, outline, scalar_probes, solve
from flexcam.io.files import ABSCISSAS, find_abscissa, read_mdf
from flexcam.io.number_tables import read_columns
from flexcam.studies.evaluation import get_history, history_units
from flexcam.studies.plan import Row
from flexcam.studies.variables import PointEvaluator


@dataclass(frozen=True, eq=False)
class Curve:
    """Measured history of a channel or of a component of a probe."""

    label: str  #: name as in the heading of a file
    name: str  #: name of the channel, or of the motion of a probe, such as ``probes.valve.velocity``
    unit: str  #: SI unit
    values: FloatArray  #: measured values, SI, shape (m,); NaN where missing
    noise: float | None = None  #: standard deviation of the noise, SI; estimated from the residuals if None


@dataclass(frozen=True, eq=False)
class Measurement:
    """Measured curves over time, or over the cam angle of one revolution."""

    over: Literal["angle", "time"]  #: abscissa
    instants: FloatArray  #: cam angles, rad, or times, s, shape (m,)
    curves: tuple[Curve, ...]  #: curves to be fitted

    def simulate(self, case: Case) -> FloatArray:
        """Return the curves of a run at the measured instants, shape (curves, m); angles are of the last revolution."""
        ready = prepare(select_case(case)[0])
        channels = any(not curve.name.startswith("probes.") for curve in self.curves)
        save = SaveAt(field_every=ready.problem.steps + 1, channels=channels)
        response = solve(ready.problem, ready.scheme, save=save)
        if not response.status.ok:
            raise RunFailedError(response.status)
        times: FloatArray = self.instants
        if self.over == "angle":
            end = float(response.angle[-1])
            if end - response.angle[0] < 2.0 * math.pi * (1.0 - 1e-9):
                given, why = case.record.run.revolutions, "an angle needs a full revolution"
                raise refuse("run.revolutions", given, "1 or more", why)
            turn = np.mod(self.instants - end + 1e-9, 2.0 * math.pi) - 1e-9
            turn[(turn < 1e-9) & (self.instants > self.instants.min() + math.pi)] = 2.0 * math.pi  # the end of it
            times = np.asarray(np.interp(end - 2.0 * math.pi + turn, response.angle, response.time), dtype=float)
        elif times.min() < response.time[0] or times.max() > response.time[-1]:
            given = f"times from {times.min():g} to {times.max():g} s"
            raise refuse("--to", given, f"times of the run, up to {response.time[-1]:g} s", "", "run more revolutions")
        order = np.argsort(times)
        sampled = response.at(times[order])
        return np.array([get_history(sampled, curve.name) for curve in self.curves])[:, np.argsort(order)]


def read_measurement(path: Path, case: Case, only: Sequence[str] = (), noises: Sequence[str] = ()) -> Measurement:
    """Read columns of a CSV or MDF file, all or those named; noises are ``NAME=VALUE`` in the unit of the column."""
    is_mdf = path.suffix.lower() in (".mf4", ".mdf")
    columns = read_mdf(path, "--to", only) if is_mdf else read_columns(path, "--to")
    over, instants = find_abscissa(columns, "--to")
    measured = [name for name in columns if name not in ABSCISSAS]
    if not (selected := list(only) or measured):
        raise refuse("--to", ", ".join(columns), f"{over} and a measured column")
    levels = dict[str, float]()
    for text in noises:
        name, _, size = text.partition("=")
        try:
            levels[name.strip()] = float(size)
        except ValueError:
            allowed = "NAME=VALUE, a standard deviation in the unit of the column"
            raise refuse("--noise", repr(text), allowed, "", "write it as in 'valve displacement=0.005'") from None
    for option, names, known in (("--column", selected, measured), ("--noise", levels, selected)):
        if unknown := [name for name in names if name not in known]:
            near = suggest_name(unknown[0], known)
            raise refuse(option, repr(unknown[0]), ", ".join(known), "there is no such column", near)
    output, curves = outline(build_problem(case)[1]), list[Curve]()
    for name in selected:
        label, history = _find_history(output, name, f"{path.name}, column {name!r}")
        (given, values), unit = columns[name], history_units(output)[history]
        factor = conversion_factor(given, unit, f"--to, column {name!r}")
        noise = positive("--noise", levels[name] * factor, unit) if name in levels else None
        curves.append(Curve(label, history, unit, values * factor, noise))
    return Measurement("time" if over == "time" else "angle", instants, tuple(curves))


_LISTED = 20  # number of results that a message lists


def _find_history(output: Outline, name: str, where: str) -> tuple[str, str]:
    """Return the label and the history of a column: a channel, or a component of a probe with its series."""
    channels, probes = dict(output.channels), scalar_probes(output)
    if name in channels:
        return name, name
    probe, _, series = name.rpartition(" ") if name.rpartition(" ")[2] in SERIES else (name, "", "displacement")
    if probe not in probes:
        known = [*(f"{point} {series}" for point in probes), *channels]
        near = suggest_name(name, [*probes, *known])
        allowed = ", ".join(known[:_LISTED]) + (f" and {len(known) - _LISTED} more" if len(known) > _LISTED else "")
        raise refuse(where, "a name that is no result of the case", f"one of {allowed}", "", near)
    return f"{probe} {series}", f"probes.{probe}.{series}"


def curve_row(case: Case, measured: Measurement) -> Row:
    """Return a row with the simulated curves of a case."""
    return Row(Status(), history=("curves", measured.simulate(case).tobytes()))


_SINGULAR = 1e-3  # singular value of the scaled Jacobian by the largest one, below which values are not determined
_STEP = 1e-3  # step of central differences, relative to the interval of a value
_FAILED = 1e6  # residual, in units of the noise, of a trial whose run fails, so that the search takes a shorter step


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
        return np.sqrt(np.nanmean((curves - [curve.values for curve in measured.curves]) ** 2, axis=1))

    def correlated_pairs(self) -> list[tuple[int, int]]:
        """Return the pairs of values with an absolute correlation above 0.95."""
        undetermined = {i for group in self.undetermined for i in group}
        pairs = np.argwhere(np.tril(np.abs(self.correlation), -1) > 0.95).tolist()
        return [(j, i) for i, j in pairs if not {i, j} & undetermined]


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
        """Return the differences from the measured curves over their noise."""
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
        self.runs += len(parts)
        return list(self.points.rows(self.points.at(parts)))

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
    targets = np.array([curve.values for curve in measured.curves])
    known = ~np.isnan(targets)
    free = int(known.sum()) - len(variables)
    if free < 1:
        given = f"{known.sum()} measured value{'' if known.sum() == 1 else 's'}"
        raise refuse("--to", given, f"at least {len(variables) + 1}", "a fit needs more than values of --vary")
    if outside := [v.key for v in variables if v.start is not None and not 0.0 <= v.start <= 1.0]:
        raise refuse("--vary", outside[0], "an interval that contains the value of the case", "the search begins there")
    begin = np.array([0.5 if v.start is None else v.start for v in variables])
    spread = np.array([np.nanstd(curve.values) or 1.0 for curve in measured.curves])
    stated = np.array([curve.noise or math.nan for curve in measured.curves])
    unknown = np.isnan(stated)
    problem = _Residuals(points, targets, np.where(unknown, spread, stated))

    def search(parts: FloatArray) -> tuple[FloatArray, FloatArray, bool]:
        solution = least_squares(
            problem.residuals, parts, jac=problem.jacobian, bounds=(0.0, 1.0), x_scale="jac", xtol=1e-10, max_nfev=steps
        )
        return solution.x, problem.curves(solution.x), bool(solution.status > 0)

    def noise(curves: FloatArray) -> FloatArray:
        estimated = Fit.rms(measured, curves) * math.sqrt(known.sum() / free)
        return np.where(unknown, np.maximum(estimated, 1e-12 * spread), stated)

    before = problem.curves(begin)
    parts, after, converged = search(begin)
    if unknown.any() and len(stated) > 1:  # again, with the noise estimated by curve
        problem.noise = noise(after)
        parts, after, converged = search(parts)
    problem.noise = noise(after)
    misfit = math.sqrt((problem.residuals(parts) ** 2).sum() / free)
    covariance, undetermined = estimate_covariance(problem.jacobian(parts))
    deviation = np.sqrt(np.diag(covariance))
    scale = np.where(deviation > 0.0, deviation, 1.0)
    factor = misfit if unknown.all() else 1.0
    intervals = student.ppf(0.975, free) * deviation * factor * np.diff(points.ends, axis=0)[0]
    intervals[sorted({i for group in undetermined for i in group})] = math.inf
    residuals = np.where(known, after - targets, 0.0)[:, np.argsort(measured.instants)]
    rounding = (1e-9 * spread[:, None] * known).sum(axis=1) ** 2
    serial = (residuals[:, 1:] * residuals[:, :-1]).sum(axis=1) / ((residuals**2).sum(axis=1) + rounding)
    return Fit(
        points.at(begin), points.at(parts), intervals, covariance / np.outer(scale, scale),
        undetermined, problem.noise, misfit, before, after, serial, problem.runs, converged,
    )  # fmt: skip
