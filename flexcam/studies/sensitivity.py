"""Sensitivity: derivatives of quantities with respect to numbers of a case, Sobol indices, and tolerances of parts.

Derivatives of natural frequencies follow from derivatives of the matrices, those of runs from the tangent of the time
integration where it applies, all others from central differences of two step sizes with an error estimate.
"""

from __future__ import annotations

import math
import re
import warnings
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Literal

import numpy as np

from flexcam.case.builder import build_model
from flexcam.case.case import Case
from flexcam.case.reader import CaseFile
from flexcam.case.variants import Number, get_number, make_overrides, number_after_override
from flexcam.core import FloatArray, IntArray, Triplets
from flexcam.core.errors import InputError, parse_all, refuse
from flexcam.core.units import DIMENSIONS, parse
from flexcam.dynamics import RunFailedError, modes
from flexcam.studies.gradients import COUNTED, RESIDUALS, compute_gradient, exact_refusal, make_neighbours
from flexcam.studies.plan import Row, Sample, check_power_of_two, check_seed
from flexcam.studies.quantities import compute_quantities, frequency_number, is_run_scalar, require_complete
from flexcam.studies.variables import Runs, column, duplicate_key_faults
from flexcam.valvetrain import Metric, build_structure

STEP_OFFSETS = (-1.0, -0.5, 0.5, 1.0)  # offsets of the evaluated points, in steps
_LARGE_ERROR = 0.05  # relative error of a derivative from which it is reported
_KINK_RATIO = 0.8  # ratio of the jumps of the slope at half and full step from which it is a kink; 1/2 if smooth
_ROUNDING = 1e-9  # relative change of a function below which it is rounding


@dataclass(frozen=True)
class Derivative:
    """Derivative of a function of one variable."""

    value: float  #: Richardson extrapolation of two central differences: fourth order in the step
    error: float  #: change by the extrapolation
    smooth: bool  #: whether the function appears smooth; otherwise the derivative is unreliable regardless of the error


def central_derivative(middle: float, beside: FloatArray, step: float) -> Derivative:
    """Return the derivative of a function from values at neighbouring points.

    Exact for polynomials of up to the fourth degree. L. F. Richardson, Phil. Trans. R. Soc. A 210 (1911) 307.
    """
    far_below, below, above, far_above = (float(x) for x in beside)
    whole, half = (far_above - far_below) / (2.0 * step), (above - below) / step
    value = (4.0 * half - whole) / 3.0
    error = abs(value - half)
    pairs = ((far_above, far_below, step), (above, below, 0.5 * step))
    jumps = [abs(up - 2.0 * middle + down) / h for up, down, h in pairs]
    size = max(abs(value), _ROUNDING * abs(middle) / step, float(np.finfo(float).tiny))
    kink = jumps[1] > _LARGE_ERROR * size and jumps[1] > _KINK_RATIO * jumps[0]
    return Derivative(value, error, not (kink or error > _LARGE_ERROR * size))


_REPEATED_TOLERANCE = 1e-6  # relative difference below which frequencies count as repeated
_EXTRA_MODES = 6  # additional modes beyond the highest requested one, which contain its repeated frequencies

MatrixPair = tuple[Triplets, Triplets]  # mass and stiffness matrices


@dataclass(frozen=True, eq=False)
class FrequencyDerivative:
    """Derivatives of natural frequencies."""

    frequencies: FloatArray  #: natural frequencies, Hz, shape (k,)
    values: FloatArray  #: derivatives, Hz per unit of the parameter, shape (k,)
    #: whether each frequency is repeated: repeated frequencies split, and the derivatives of a group are those of its
    #: branches in ascending order
    repeated: tuple[bool, ...]


def frequency_derivatives(
    middle: MatrixPair, beside: Sequence[MatrixPair], step: float, count: int, free: FloatArray | None = None
) -> FrequencyDerivative:
    """Return the derivatives of the lowest natural frequencies, without rigid-body modes.

    With mass-orthonormal shapes, ``d(omega^2)/dp = x^T (dK/dp - omega^2 dM/dp) x``: R. L. Fox and M. P. Kapoor, AIAA
    J. 6 (1968) 2426. For repeated frequencies, the derivatives are the eigenvalues of that matrix projected on their
    shapes. The derivatives of the matrices are finite differences, exact if the entries are polynomials of up to the
    fourth degree in the parameter, as most are.
    """
    solution = modes(*middle, None if free is None else free.shape[1] + count + _EXTRA_MODES, free=free)
    omegas, shapes = solution.omegas[solution.rigid :], solution.shapes[:, solution.rigid :]
    dM, dK = (_finite_difference([pair[i] for pair in beside], step) for i in (0, 1))
    values = np.zeros(len(omegas))
    repeated = np.zeros(len(omegas), dtype=bool)
    starts = np.flatnonzero(np.diff(omegas) > _REPEATED_TOLERANCE * omegas[1:]) + 1
    for group in np.split(np.arange(len(omegas)), starts):
        x, square = shapes[:, group], float(np.mean(omegas[group])) ** 2
        projected = x.T @ dK.multiply(x) - square * (x.T @ dM.multiply(x))
        slopes = np.linalg.eigvalsh(0.5 * (projected + projected.T))
        values[group] = slopes / (2.0 * math.sqrt(square))
        repeated[group] = len(group) > 1
    turn = 2.0 * math.pi
    return FrequencyDerivative(omegas[:count] / turn, values[:count] / turn, tuple(repeated[:count].tolist()))


def _finite_difference(matrices: Sequence[Triplets], step: float) -> Triplets:
    """Return the finite difference derivative of a matrix; constant entries cancel exactly."""
    far_below, below, above, far_above = (matrix.dense() for matrix in matrices)
    whole, half = (far_above - far_below) / (2.0 * step), (above - below) / step
    return Triplets.from_dense((4.0 * half - whole) / 3.0)


_MATRIX_STEP = 1e-3  # relative step for derivatives of matrices: truncation error 1e-12, rounding 1e-13
RELATIVE_STEP = 0.01  # relative step for derivatives of responses: their maxima contain noise of the time step


@dataclass(frozen=True)
class Sensitivity:
    """Derivative of a quantity of a case."""

    scalar: str  #: name of the quantity, its unit and value
    unit: str
    value: float
    by: Number  #: number of the case
    derivative: float  #: derivative in the scalar's unit per the number's unit; NaN if there is none
    error: float | None  #: estimated error; None for an analytic derivative
    smooth: bool  #: whether the scalar appears smooth there; False for repeated frequencies that split
    note: str  #: remark; empty if there is none

    @property
    def logarithmic(self) -> float:
        """Percent of the scalar per percent of the number; NaN if the scalar is zero."""
        return self.by.value * self.derivative / self.value if self.value != 0.0 else math.nan


def get_numbers(case: Case, keys: Sequence[str]) -> list[Number]:
    """Return the numbers with respect to which derivatives are computed."""

    def read(key: str) -> Number:
        number = get_number(case, key, "--to")
        if number.value == 0.0:
            why, remedy = "the step is a fraction of the number", f"give it a small value first: --set {key}=..."
            raise refuse("--to", f"{key} = 0", "a number that is not zero", why, remedy)
        return number

    return parse_all(read, dict.fromkeys(keys))


Method = Literal["exact", "differences"]  # methods for derivatives of runs: along the motion, or by differences of runs


def exact_names(
    case: Case, names: Sequence[str], method: Method | None, *, option: str = "--method exact",
    other: str = "use --method differences",
) -> list[str]:  # fmt: skip
    """Return the scalars whose derivatives follow from the tangent of the time integration.

    With the method ``exact`` a scalar of a run for which it does not apply raises an error; None selects it where it
    applies.
    """
    of_runs = [name for name in names if is_run_scalar(case, name)]
    if method == "differences":
        return []
    counted = [name for name in of_runs if name.endswith(COUNTED) or name.startswith(RESIDUALS)]
    if method is None:
        return [] if exact_refusal(case) else [name for name in of_runs if name not in counted]
    if why := exact_refusal(case):
        raise refuse(option, case.name, "a case whose runs have exact derivatives", why, other)
    limits = [name for name in names if name.startswith("limits.")]
    for name in (counted + limits)[:1]:
        why = "it is a residual" if name.startswith(RESIDUALS) else "it counts events or instants"
        why = "a limit is the result of a search" if name in limits else why
        raise refuse(option, name, "a result with an exact derivative", why, other)
    return of_runs


def sensitivities(
    file: CaseFile, fixed: Sequence[str], names: Sequence[str], keys: Sequence[str], runs: Runs,
    *, relative_step: float = RELATIVE_STEP, method: Method | None = None,
) -> list[Sensitivity]:  # fmt: skip
    """Return the derivatives of several scalars with respect to several numbers."""
    if not 1e-8 <= relative_step <= 0.2:
        raise refuse("--relative-step", relative_step, "1e-8 to 0.2", "it is a fraction of each number")
    case = file.read(fixed)
    numbers = get_numbers(case, keys)
    frequencies = {name: number for name in names if (number := frequency_number(name))}
    exact = exact_names(case, names, method)
    responses = [name for name in names if name not in frequencies and name not in exact]
    rows = list[Sensitivity]()
    if frequencies:
        rows += _frequency_sensitivities(file, fixed, case, frequencies, numbers)
    if exact:
        rows += _exact_sensitivities(file, fixed, case, exact, numbers)
    if responses:
        rows += _response_sensitivities(case, responses, numbers, runs, relative_step)
    results = {(row.scalar, row.by.key): row for row in rows}
    return [results[name, number.key] for name in dict.fromkeys(names) for number in numbers]


def _frequency_sensitivities(
    file: CaseFile, fixed: Sequence[str], case: Case, frequencies: Mapping[str, int], numbers: Sequence[Number]
) -> Iterator[Sensitivity]:
    structure = build_structure(build_model(case))
    for number in numbers:
        step, pairs = abs(number.value) * _MATRIX_STEP, list[MatrixPair]()
        for variant in make_neighbours(case, number, (part * step for part in STEP_OFFSETS)):
            neighbour = build_structure(build_model(file.read((*fixed, *variant))))
            if neighbour.mass.size != structure.mass.size:
                allowed, why = "a number that does not change the unknowns", "their matrices are compared"
                raise refuse("--to", variant[-1], allowed, why)
            pairs.append((neighbour.mass, neighbour.stiffness))
        middle, count = (structure.mass, structure.stiffness), max(frequencies.values())
        result = frequency_derivatives(middle, pairs, step, count, structure.free)
        for name, i in frequencies.items():
            if i > (size := len(result.frequencies)):
                raise refuse("--of", name, f"frequency.1 to frequency.{size}", "the model has no more modes")
            value, slope, repeated = (each[i - 1] for each in (result.frequencies, result.values, result.repeated))
            note = "one of several equal frequencies: the slopes are those of their branches" if repeated else ""
            yield Sensitivity(name, "Hz", float(value), number, float(slope), None, not repeated, note)


def _exact_sensitivities(
    file: CaseFile, fixed: Sequence[str], case: Case, names: Sequence[str], numbers: Sequence[Number]
) -> Iterator[Sensitivity]:
    gradient = compute_gradient(case, names, numbers)
    warning = f"no derivative: {gradient.warning}; --method differences shows what remains" if gradient.warning else ""
    derived = [
        n for n in numbers if not any(math.isnan(gradient.derivatives.get((name, n.key), 0.0)) for name in names)
    ]
    changes = {} if warning else _joint_changes(file, fixed, case, names, derived)
    for name in names:
        if name not in gradient.values:
            raise refuse("--of", name, "a result that this run has", "the run did not give it")
        metric, doubt = gradient.values[name], ""
        parts = [] if warning else [_JOINT_STEP * abs(n.value) * gradient.derivatives[name, n.key] for n in derived]
        size, change = float(np.abs(parts).sum()), changes.get(name, math.nan)
        if abs(change - sum(parts)) > _JOINT_ERROR * size + _JOINT_NOISE * abs(metric.value):
            joint = f"{100.0 * _JOINT_STEP:g} % more of all numbers changes it by {change:.3g} {metric.unit}"
            doubt = f"not smooth here: {joint}, and its derivatives predict {sum(parts):.3g}"
            doubt += "; use --method differences, or more steps per revolution"
        for number in numbers:
            slope = math.nan if warning else gradient.derivatives[name, number.key]
            known = not math.isnan(slope)
            note = warning or (doubt if known else "no exact derivative: use --method differences")
            yield Sensitivity(name, metric.unit, metric.value, number, slope, None, known and not doubt, note)


# Fraction of all numbers by which two runs check their exact derivatives: steps of integration and contact events may
# leave a motion smooth for much smaller changes alone. Allowed error, relative to the sum of the changes by each
# number, and to the result.
_JOINT_STEP, _JOINT_ERROR, _JOINT_NOISE = 0.005, 0.3, 1e-4


def _joint_changes(
    file: CaseFile, fixed: Sequence[str], case: Case, names: Sequence[str], numbers: Sequence[Number]
) -> dict[str, float]:
    """Return half the change of results of runs with all numbers a little above and below; none if a run fails."""
    ends = list[Mapping[str, Metric]]()
    for part in (_JOINT_STEP, -_JOINT_STEP):
        values = {number.key: repr(number.value + part * abs(number.value)) for number in numbers}
        try:
            side = file.read((*fixed, *make_overrides(case, values))).with_newmark()
            ends.append(compute_quantities(side, names))
        except (InputError, RunFailedError):  # beyond a permitted value, or a result that a neighbour lacks
            return {}
    return {name: 0.5 * (ends[0][name].value - ends[1][name].value) for name in names}


def _response_sensitivities(
    case: Case, names: Sequence[str], numbers: Sequence[Number], runs: Runs, relative_step: float
) -> Iterator[Sensitivity]:
    steps, variants = [abs(number.value) * relative_step for number in numbers], list[tuple[str, ...]]()
    for number, step in zip(numbers, steps, strict=True):
        variants += make_neighbours(case, number, (part * step for part in STEP_OFFSETS))
    middle, *rows = runs([(), *variants])
    require_complete(middle)
    for number, step in zip(numbers, steps, strict=True):
        neighbours, rows = rows[: len(STEP_OFFSETS)], rows[len(STEP_OFFSETS) :]
        for name in names:
            yield _response(name, middle, neighbours, number, step)


def _response(name: str, middle: Row, neighbours: Sequence[Row], number: Number, step: float) -> Sensitivity:
    value, unit = middle.scalars.get(name, math.nan), middle.units.get(name, "")
    values = column(neighbours, name)
    if math.isnan(value) or np.isnan(values).any():
        failed = next((row.status for row in (middle, *neighbours) if not row.status.ok), None)
        place = "at the nominal value" if math.isnan(value) else f"after a finite-difference step of {number.key}"
        outside = f"{place} the limit lies outside the search range; lower --lowest or raise --highest"
        note = f"no derivative: {failed or outside}"
        return Sensitivity(name, unit, value, number, math.nan, None, False, note)
    derivative = central_derivative(value, values, step)
    doubt = "not smooth here: contacts open or close, or the values have noise; the derivative is unreliable"
    note = "" if derivative.smooth else doubt
    return Sensitivity(name, unit, value, number, derivative.value, derivative.error, derivative.smooth, note)


@dataclass(frozen=True, eq=False)
class SobolIndices:
    """Sobol indices of one scalar."""

    first: FloatArray  #: share of the variance due to a variable alone, and including all its interactions, shape (k,)
    total: FloatArray
    first_interval: FloatArray  #: lower and upper ends of the 95 % bootstrap intervals, shape (2, k)
    total_interval: FloatArray
    variance: float  #: variance of the scalar; the indices are zero if it is zero
    used: int  #: number of base points used: a power of two, without points at which a run failed
    asked: int  #: number of base points requested


def sobol_indices(
    function: Callable[[FloatArray], FloatArray], dimensions: int, count: int, *, seed: int = 0
) -> list[SobolIndices]:
    """Return the Sobol indices of scalars over the unit cube.

    `function` returns s scalars, shape (m, s), of points, shape (m, k); NaN for missing values.
    Variables are independent and uniformly distributed over their intervals. Points are from a scrambled Sobol
    sequence; the estimators are those of A. Saltelli et al., Comput. Phys. Commun. 181 (2010) 259, with bootstrap
    intervals by `scipy.stats.bootstrap`.
    """
    from scipy.stats import qmc

    check_power_of_two("--sobol", count, 2)
    check_seed(seed)
    both = qmc.Sobol(2 * dimensions, seed=np.random.default_rng(seed)).random(count)
    a, b = both[:, :dimensions], both[:, dimensions:]
    mixed = [np.where(chosen, b, a) for chosen in np.eye(dimensions, dtype=bool)]  # A with one column of B
    samples = np.stack([a, b, *mixed], axis=1)  # ordered by base point: an interrupted study has complete base points
    parts = function(samples.reshape(-1, dimensions)).reshape(count, dimensions + 2, -1)
    return [_compute_indices(parts[:, :, i].T, count, seed) for i in range(parts.shape[2])]


def _compute_indices(values: FloatArray, requested: int, seed: int) -> SobolIndices:
    """Return the indices from values at A, B and the mixed points, shape (k + 2, n)."""
    from scipy import stats

    complete = values[:, ~np.isnan(values).any(axis=0)]
    used = 1 << (complete.shape[1].bit_length() - 1) if complete.shape[1] else 0
    if used < 2:
        given = f"{complete.shape[1]} of {requested} base points with a number"
        raise refuse("--sobol", given, "two or more", "the others failed", "narrow the intervals, or use more points")
    a, b, *mixed = complete[:, :used] - complete[:2, :used].mean()
    k, variance = len(mixed), float(np.var([a, b]))
    if variance <= 0.0:
        zeros = np.zeros(k)
        return SobolIndices(zeros, zeros, np.zeros((2, k)), np.zeros((2, k)), 0.0, used, requested)

    def indices(rows: IntArray) -> FloatArray:
        """Return first-order and total indices of some base points, shape (2, k)."""
        fa, fb, mixed_values = a[rows], b[rows], np.array(mixed)[:, rows]
        shares = [(fb * (mixed_values - fa)).mean(axis=1), 0.5 * ((fa - mixed_values) ** 2).mean(axis=1)]
        return np.array(shares) / np.var([fa, fb])

    first, total = indices(np.arange(used))
    with np.errstate(all="ignore"), warnings.catch_warnings():
        warnings.simplefilter("ignore")  # a variable without effect has nothing to resample
        ends = stats.bootstrap([np.arange(used)], indices, n_resamples=499, rng=np.random.default_rng(seed))
    low, high = ends.confidence_interval
    both = np.where(np.isfinite([low, high]), [low, high], [[first, total]] * 2)  # the index if resampling gave none
    return SobolIndices(first, total, both[:, 0], both[:, 1], variance, used, requested)


_SPEC = re.compile(r"\s*(?:(normal)\s*:|uniform\s*:)?\s*(?:±|\+-|\+/-)\s*(\S.*?)\s*$")
_SIGMAS = 3.0  # half width of a normal scatter in standard deviations: 99.7 % of the parts lie within
_TRUNCATION = 5.0  # truncation of a normal scatter in standard deviations: one part in two million lies beyond

QUANTILES = (0.01, 0.05, 0.5, 0.95, 0.99)  # reported quantiles


@dataclass(frozen=True)
class PartScatter:
    """Scatter of a number of a case from part to part."""

    key: str  #: key of the case
    middle: float  #: centre and half width, SI
    half: float
    #: distribution: uniform between both ends, or normal with the ends at three standard deviations
    kind: Literal["uniform", "normal"]

    def value(self, part: float) -> float:
        """Return the quantile for a probability from 0 to 1; `_TRUNCATION` deviations limit a normal scatter."""
        if self.kind == "uniform":
            return self.middle + self.half * (2.0 * part - 1.0)
        from statistics import NormalDist

        tail = NormalDist().cdf(-_TRUNCATION)
        return self.middle + self.half / _SIGMAS * NormalDist().inv_cdf(min(max(part, tail), 1.0 - tail))


def parse_scatters(case: Case, settings: Sequence[str]) -> list[PartScatter]:
    """Parse the scatter of several ``KEY=±SPEC`` texts."""
    read = partial(_parse_scatter, case)
    return parse_all(read, settings, lambda found: duplicate_key_faults("--tolerance", [s.key for s in found]))


def _parse_scatter(case: Case, setting: str) -> PartScatter:
    where = f"--tolerance {setting}"
    key, equals, spec = setting.partition("=")
    match = _SPEC.match(spec)
    if not equals or match is None:
        allowed, remedy = "KEY=±2%, ±0.05mm, or normal:±2%", "write it as in springs.valve.stiffness=±5%"
        raise refuse(where, repr(spec or setting), allowed, "", remedy)
    number = get_number(case, key.strip(), where)
    dimension = next((name for name, entry in DIMENSIONS.items() if entry.si == number.unit), None)
    if match[2].endswith("%"):
        half = abs(number.value) * parse(match[2], "number", where)
    elif dimension is None:
        why = "the unit of this number depends on other keys"
        raise refuse(where, repr(match[2]), "a percentage such as ±2%", why)
    else:
        half = parse(match[2], dimension, where)
        if number.unit and match[2][-1] in "0123456789.":
            allowed = f"a percentage or a number with its unit, such as ±2% or ±{match[2]} {number.unit}"
            raise refuse(where, repr(match[2]), allowed, "the unit is missing", "write the unit after the number")
    if not half > 0.0:
        raise refuse(where, repr(spec), "a width above zero", "the value would not vary")
    scatter = PartScatter(number.key, number.value, half, "normal" if match[1] else "uniform")
    maximum = 100.0 if scatter.kind == "uniform" else 100.0 * _SIGMAS / _TRUNCATION
    if match[2].endswith("%") and half >= 0.01 * maximum * abs(number.value):
        why = "some parts would have zero or the other sign"
        raise refuse(where, repr(spec), f"less than ±{maximum:g} %", why, f"give less, such as {key}=±5%")
    for end in (0.0, 1.0):
        number_after_override(case, number.key, repr(scatter.value(end)), where)  # raises an error for an invalid value
    return scatter


def sample_parts(scatters: Sequence[PartScatter], count: int, seed: int = 0) -> FloatArray:
    """Return sampled numbers of parts, shape (count, scatters)."""
    if count < 8:
        raise refuse("--count", count, "a whole number, at least 8", "mean and spread need more samples")
    parts = Sample("lhs", count, check_seed(seed)).points(len(scatters))
    return np.array([[scatter.value(part) for scatter, part in zip(scatters, row, strict=True)] for row in parts])


@dataclass(frozen=True, eq=False)
class ScalarDistribution:
    """Distribution of a scalar."""

    values: FloatArray  #: values of the valid sets of parts, shape (n,)
    missing: int  #: number of sets without a value: their run failed, or a limit was not met
    mean: float  #: mean and standard deviation
    deviation: float
    quantiles: Mapping[float, float]  #: quantiles for `QUANTILES`
    ranks: FloatArray  #: Spearman rank correlation with each number, shape (k,): sign and strength of its influence


def scalar_distribution(points: FloatArray, values: FloatArray) -> ScalarDistribution:
    """Return the distribution of a scalar over sets of parts."""
    known = ~np.isnan(values)
    data = values[known]
    missing = len(values) - len(data)
    if len(data) < 2:
        empty, ranks = dict.fromkeys(QUANTILES, math.nan), np.full(points.shape[1], math.nan)
        return ScalarDistribution(data, missing, math.nan, math.nan, empty, ranks)
    from scipy.stats import rankdata

    quantiles = dict(zip(QUANTILES, np.quantile(data, QUANTILES).tolist(), strict=True))
    x, y = (rank - rank.mean(axis=0) for rank in (rankdata(points[known], axis=0), rankdata(data)))
    sizes = np.sqrt((x * x).sum(axis=0) * (y @ y))
    ranks = np.divide(x.T @ y, sizes, out=np.zeros(len(sizes)), where=sizes > 0.0)
    return ScalarDistribution(data, missing, float(data.mean()), float(data.std(ddof=1)), quantiles, ranks)
