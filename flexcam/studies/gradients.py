"""Derivatives of results by numbers of a case, exact through the time integration, and the search along them.

Results of a run are derived along its motion (`flexcam.dynamics.tangent`), all others, such as natural frequencies,
static results, Floquet multipliers and properties of a cam, by central differences: contact events add no noise.

Maxima and minima over a revolution have kinks where another instant becomes the extreme one. The search therefore
uses the derivatives of constraints at several local extremes of a history. A step takes these planes, at the best
variant and at points near it, and solves a linear program within a box about the best variant. The box grows with steps
that reduce the merit as predicted, and shrinks with others. A violation of a constraint has a price, so that the search
may follow a curved constraint from outside: R. Fletcher and E. Sainz de la Maza, Math. Program. 43 (1989) 235; K.
Madsen, J. Inst. Maths Applics 16 (1975) 321.
"""

# pyright: reportMissingTypeStubs=false, reportUnknownMemberType=false

from __future__ import annotations

import math
from collections.abc import Generator, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from numpy.typing import NDArray

from flexcam.analysis.preparation import (
    PreparedRun,
    prepare,
    prepare_without_periodic_search,
    set_initial_state,
)
from flexcam.case.case import Case
from flexcam.case.problem_builder import steps_per_revolution
from flexcam.case.reader import CaseFile
from flexcam.case.variants import Number, get_number, make_overrides
from flexcam.core import FloatArray
from flexcam.core.errors import InputError, refuse
from flexcam.dynamics import (
    ProgressCallback,
    Response,
    RunFailedError,
    Scheme,
    Status,
    System,
    TangentRun,
    Variation,
    tangent_run,
)
from flexcam.dynamics.massless import FORCE_TOLERANCE, MasslessMotions
from flexcam.studies.evaluation import compute_scalars
from flexcam.studies.executors import open_evaluators
from flexcam.studies.optimization import Evaluations, OptimizationProblem, ProblemEvaluator
from flexcam.studies.plan import Planes, Row, check_seed
from flexcam.studies.quantities import compute_quantities, is_run_scalar, quantity_row
from flexcam.studies.variables import Runs, Variable, WorstCase, interval_widths
from flexcam.valvetrain import Metric, extreme_history

# Change of a number relative to its size: a compromise of rounding, and of contacts that it switches; more for the
# central differences of other results, as periodic states and eigenvalues have rounding errors of 1e-10.
RELATIVE_WIDTH, _WIDTH_WITHOUT_RUN = 1e-6, 1e-4
CHAOTIC_GROWTH = 1e3  # growth of a disturbance over a run above which derivatives say nothing about practical changes
_PERIODIC = 1e-6  # relative residual of a periodic start above which its derivative does not exist
_SIMILAR_RUNS = 10  # number of runs whose time the derivatives of a run take, for the selection of the engine
COUNTED = (".bounces", ".open_on_the_lift")  # ends of the names of results that count, and have no derivative
RESIDUALS = ("energy.", "periodicity")  # beginnings of the names of results that are not derived along the motion
_RATES = (".velocity", ".acceleration")  # ends of the names of histories that a point without mass does not have
_PROBE_KINDS = {"probes", "deviation"}  # first parts of the names of scalars that need no channels
_EXTREMES = 8  # number of other local extremes of a history that a search uses
_SPARE = 2  # steps before the last revolution, to which all results but deviations refer
_WITHOUT_ACCELERATION = {"contacts", "springs"}  # first parts of those that need neither accelerations nor probes


@dataclass(frozen=True, eq=False)
class Gradient:
    """Results of a case and their derivatives.

    `growth` is that of a small disturbance over the run (`flexcam.dynamics.tangent.TangentRun`), 1 without a run;
    `warning` says why the derivatives of the run say nothing.
    """

    values: Mapping[str, Metric]  #: results by name
    #: by name of the result and key of the number, SI; NaN for a result that a neighbouring case lacks
    derivatives: Mapping[tuple[str, str], float]
    extremes: Mapping[str, Planes]  #: other local extremes of the history whose extreme a result is
    growth: float
    warning: str = ""


# A neighbouring case, results with half the change below and above the run, and the change.
_NeighbourRun = tuple[PreparedRun, Response, Response, float]


def exact_refusal(case: Case) -> str:
    """Return why the runs of a case cannot be derived; empty if they can."""
    fidelity, scheme = case.record.fidelity, case.record.run.integrator
    if fidelity.model != "beams" or fidelity.modes is not None or fidelity.tolerances:
        return "the model is reduced (fidelity)"
    if scheme is not None and not (isinstance(scheme.part, Scheme) and scheme.part.average):
        return "the integrator is not newmark with beta 1/4 and gamma 1/2"
    return "the steps are adaptive" if case.record.run.adaptive else ""


def compute_gradient(
    case: Case, names: Sequence[str], numbers: Sequence[Number], sizes: Sequence[float] | None = None
) -> Gradient:
    """Return results of a case and their derivatives by some of its numbers.

    `names` are scalars of a run, natural frequencies, properties of cams, or keys, but no speed limits; `sizes` are the
    usual sizes of the numbers, SI, instead of their values, which must not be zero then. A case whose runs cannot be
    derived, or a number that changes the structure of the equations, raises `InputError`, a run that fails
    `RunFailedError`. Example: ``compute_gradient(case, ["springs.valve.force.largest"], get_numbers(case, keys))``.
    """
    sizes = [abs(size) for size in sizes or [number.value for number in numbers]]
    of_runs = [name for name in names if is_run_scalar(case, name)]
    others = [name for name in names if name not in of_runs]
    values, derivatives = dict[str, Metric](), dict[tuple[str, str], float]()
    growth, warning, file, extremes = 1.0, "", CaseFile.of(case), dict[str, Planes]()
    if of_runs:
        sides = [
            next(_neighbour_cases(file, case, number, RELATIVE_WIDTH * size))
            for number, size in zip(numbers, sizes, strict=True)
        ]
        scalars, planes, growth, warning = _run_planes(case, sides, of_runs)
        values |= scalars
        for name, ((_, *slopes), *further) in planes.items():
            extremes[name] = tuple(further)
            derivatives |= {(name, number.key): slope for number, slope in zip(numbers, slopes, strict=True)}
    if others:
        values |= compute_quantities(case, others)
        for number, size in zip(numbers, sizes, strict=True):
            cases = *_neighbour_cases(file, case, number, _WIDTH_WITHOUT_RUN * size), (case, 0.0)
            (above, up), (below, down) = cases[:2]  # one side alone at the end of the permitted values
            low, high = compute_quantities(below, others), compute_quantities(above, others)
            derivatives |= {(name, number.key): _difference(name, low, high, up - down) for name in others}
    return Gradient(values, derivatives, extremes, growth, warning)


def _difference(name: str, below: Mapping[str, Metric], above: Mapping[str, Metric], width: float) -> float:
    known = name in below and name in above and not name.endswith(COUNTED)
    return (above[name].value - below[name].value) / width if known else math.nan


def _neighbour_cases(file: CaseFile, case: Case, number: Number, step: float) -> Iterator[tuple[Case, float]]:
    """Yield the cases with a number above and below its value, if permitted, and its change; at least one."""
    refusals = list[InputError]()
    for change in (step, -step):
        [variant] = make_neighbours(case, number, [change])
        try:
            side = file.read((*case.overrides, *variant))
        except InputError as refusal:
            refusals.append(refusal)
        else:
            yield side, change
    if len(refusals) > 1:
        raise refusals[0]


@contextmanager
def gradient_evaluator(
    file: CaseFile, fixed: Sequence[str], names: Sequence[str], variables: Sequence[Variable],
    *, worst: WorstCase | None = None, workers: int = 1, advance: ProgressCallback | None = None,
) -> Generator[Runs]:  # fmt: skip
    """Yield a function that evaluates variants of a file, with derivatives by some variables in the worst case."""
    sizes = interval_widths(file.read(fixed), variables).tolist()
    row = partial(quantity_row, names=tuple(names))
    derive = partial(_derivative_row, names=tuple(names), keys=tuple(v.key for v in variables), sizes=sizes)
    with open_evaluators(file, fixed, row, derive, workers=workers, advance=advance) as evaluators:
        yield (worst or WorstCase(((),), {})).over(*evaluators)


def _derivative_row(case: Case, names: Sequence[str], keys: Sequence[str], sizes: Sequence[float]) -> Row:
    """Return the derivatives of a variant, or a complete row whose status says why there are none."""
    row = Row(Status())
    try:
        gradient = compute_gradient(case, names, [get_number(case, key, "--vary") for key in keys], sizes)
    except (InputError, RunFailedError) as failure:  # the variant counts without them
        return replace(row, status=Status(text=str(failure)))
    if gradient.warning:
        return replace(row, status=Status(text=gradient.warning))
    slopes = {name: tuple(gradient.derivatives.get((name, key), math.nan) for key in keys) for name in names}
    return replace(row, derivatives=slopes, extremes=gradient.extremes)


def make_neighbours(case: Case, number: Number, steps: Iterable[float]) -> list[tuple[str, ...]]:
    """Return the overrides of cases with a number at some steps from its value."""
    return [make_overrides(case, {number.key: repr(number.value + step)}) for step in steps]


def _run_planes(
    case: Case, sides: Sequence[tuple[Case, float]], names: Sequence[str]
) -> tuple[dict[str, Metric], dict[str, Planes], float, str]:
    """Return the scalars of a run, their planes, the growth of disturbances, and a warning.

    `sides` are cases with one changed number each, and the changes. The first plane is that of the scalar itself.
    """
    if why := exact_refusal(case):
        raise refuse("--method", "exact", "differences", why)
    kinds = {name.partition(".")[0] for name in names}
    case = case.with_newmark()
    ready = _with_channels(prepare(case, runs=_SIMILAR_RUNS), kinds)
    others = [_with_channels(prepare_without_periodic_search(side.with_newmark(), ready), kinds) for side, _ in sides]
    periodic, near = case.record.run.start == "periodic", ready.problem.start
    if not periodic:  # found in the same way as those of the others, so that rounding errors cancel
        ready = replace(ready, problem=set_initial_state(case, ready.model, ready.problem, near=near))
    variations = [Variation(other.problem, width) for other, (_, width) in zip(others, sides, strict=True)]
    period = steps_per_revolution(case, ready.problem) if periodic else None
    accelerations = not kinds <= _WITHOUT_ACCELERATION
    revolution = math.ceil(ready.revolution / ready.problem.step) + _SPARE
    first = 0 if "deviation" in kinds else max(ready.problem.steps - revolution, 0)
    tangent = tangent_run(
        ready.problem, ready.scheme, variations, period=period, accelerations=accelerations, first=first,
        select=partial(_select_extremes, ready, names),
    )  # fmt: skip
    if not tangent.response.status.ok:
        raise RunFailedError(tangent.response.status)
    scalars = {m.name: m for m in compute_scalars(ready, tangent.response, names) if m.name in names}
    runs = [(other, *pair, width) for other, pair, (_, width) in zip(others, tangent.neighbours, sides, strict=True)]
    planes = {name: _extreme_planes(ready, tangent, runs, name) for name in scalars}
    if missing := [name for name, known in planes.items() if not known]:
        planes |= _other_planes(ready, runs, missing)
    residual = (ready.problem.start.periodicity or 0.0) if periodic and ready.problem.start else 0.0
    warning = f"the periodic start repeats only to {residual:.1g}" if residual > _PERIODIC else ""
    if tangent.growth > CHAOTIC_GROWTH:
        why = "the motion is chaotic, or the run needs more steps per revolution"
        warning = f"a small disturbance grows {tangent.growth:.1g} times: {why}"
    return scalars, planes, tangent.growth, warning


def _select_extremes(ready: PreparedRun, names: Sequence[str], part: Response) -> NDArray[np.bool_]:
    """Return the local extremes of the histories of scalars in a part of a run; all instants for other scalars."""
    histories = [history for name in names if (history := extreme_history(ready.model, part, name)) is not None]
    if len(histories) < len(names):
        return np.ones(len(part.time), dtype=bool)
    mask, problem = np.zeros(len(part.time), dtype=bool), ready.problem
    end = (problem.start.time if problem.start else 0.0) + problem.step * problem.steps
    begin = np.searchsorted(part.time, end - ready.revolution)  # the first instants of the last revolution
    mask[[0, -1, *np.minimum([begin, begin + 1], len(mask) - 1)]] = True
    for history in histories:
        mask |= _local_maxima(history)
    return mask


def _local_maxima(history: FloatArray) -> NDArray[np.bool_]:
    mask = np.zeros(len(history), dtype=bool)
    mask[1:-1] = (history[1:-1] >= history[:-2]) & (history[1:-1] > history[2:])
    return mask


def _extreme_planes(ready: PreparedRun, tangent: TangentRun, runs: Sequence[_NeighbourRun], name: str) -> Planes:
    """Return the largest local extremes of the history of a scalar, the scalar first; none for other scalars."""
    history = extreme_history(ready.model, tangent.response, name)
    if history is None:
        return ()
    last = tangent.response.latest(ready.revolution)[tangent.instants]
    values = np.where(last, history[tangent.instants], -np.inf)
    maxima = np.flatnonzero(_local_maxima(history)[tangent.instants] & last | (values == values.max()))
    extremes = maxima[np.argsort(-values[maxima], kind="stable")][: _EXTREMES + 1]
    planes = [values[extremes] - values[extremes[0]]]
    for other, below, above, width in runs:
        low = extreme_history(ready.model, below, name, window=False)
        high = extreme_history(other.model, above, name, window=False)
        if low is None or high is None:
            return ()
        planes.append((high[extremes] - low[extremes]) / width)
    sign = -1.0 if name.endswith("least") else 1.0
    return tuple(map(tuple, (sign * np.column_stack(planes)).tolist()))


def _other_planes(ready: PreparedRun, runs: Sequence[_NeighbourRun], names: Sequence[str]) -> dict[str, Planes]:
    """Return the planes of scalars that are no extremes of a history, from the scalars of both sides."""
    prefixes, slopes = _massless_probes(ready.problem.system), list[list[float]]()
    unknown = {name for name in names if name.rpartition(".")[0].endswith(_RATES) and name.startswith(prefixes)}
    for other, below, above, width in runs:
        low = {metric.name: metric for metric in compute_scalars(ready, below, names) if metric.name not in unknown}
        high = {metric.name: metric for metric in compute_scalars(other, above, names)}
        slopes.append([_difference(name, low, high, width) for name in names])
    return {name: ((0.0, *row),) for name, row in zip(names, np.transpose(slopes).tolist(), strict=True)}


def _massless_probes(system: System) -> tuple[str, ...]:
    """Return the beginnings of the names of results of points without mass."""
    massless = MasslessMotions(system)
    return tuple(
        f"probes.{probe.name}." + (f"{component}." if len(probe.components) > 1 else "")
        for probe in system.probes
        for component, row in zip(probe.components, probe.rows, strict=True)
        if (massless.force_on_massless(row[None]) > FORCE_TOLERANCE).any()
    )


def _with_channels(ready: PreparedRun, kinds: set[str]) -> PreparedRun:
    """Return a run with channels of some kinds, or probes, alone; metrics of all parts need those of the contacts."""
    system = ready.problem.system
    needed = set[str]() if kinds <= _PROBE_KINDS else {*kinds, "contacts"}
    channels = tuple(channel for channel in system.channels if channel.name.partition(".")[0] in needed)
    probes = () if kinds <= _WITHOUT_ACCELERATION else system.probes
    return replace(ready, problem=replace(ready.problem, system=replace(system, channels=channels, probes=probes)))


_BOX, _SMALLEST_BOX, _LARGEST_BOX = 0.1, 1e-3, 0.5  # half widths of the box, relative to the intervals
_SHRINK, _GROW = 0.5, 2.0  # factors of the box after a bad and after a good step
_BAD, _GOOD = 0.25, 0.75  # gains of such steps relative to those expected
_NO_GAIN = 1e-12  # gain relative to the goal that is rounding
_AT_BORDER = 0.8  # length of a step relative to the box above which a good one makes it larger
_NEAR, _PLANES = 3.0, 16  # distance of the points whose planes count, in half widths of the box, and their number
_PENALTY = 100.0  # weight of the largest relative violation of a constraint, relative to that of the goal
_LEAST_PRICE, _PRICE_MARGIN = 1.0, 2.0  # price of a violation relative to the goal, and to that of the linear program
# Distance from a bound, relative to it, that a step keeps: the least; the most after a violation, relative to the box;
# the most from a variant that violates it.
_LEAST_INSIDE, _INSIDE, _MOST_INSIDE = 1e-6, 0.01, 0.1


@dataclass(frozen=True, eq=False)
class Plane:
    """Tangents at a point, by fractions of the intervals."""

    at: FloatArray  #: shape (k,)
    cost: float  #: quantity to be minimized
    cost_slope: FloatArray  #: shape (k,)
    violations: FloatArray  #: relative violations of the constraints, shape (b,)
    #: tangents of the constraints, one or more each: index, relative violation and slope, shape (k,)
    cuts: Sequence[tuple[int, float, FloatArray]]

    @property
    def violation(self) -> float:
        """Largest relative violation of a constraint."""
        return float(self.violations.max(initial=0.0))

    def merit(self, price: float) -> float:
        """Return the cost with the price of the violation: the smaller, the better the variant."""
        return self.cost + price * self.violation


def optimize_by_gradient(
    design: OptimizationProblem, *, evaluations: int = 200, starts: int = 1, seed: int = 0
) -> Evaluations:
    """Search for the best variant with exact gradients, which the rows of the points have (`gradient_evaluator`).

    The search starts from the case, or the centre of the intervals, and then from random points.
    """
    if len(design.goals) != 1:
        raise refuse("goals", len(design.goals), "one", "a gradient search has one goal")
    if starts < 1:
        raise refuse("--starts", starts, "1 or more")
    check_seed(seed)
    judge, count = ProblemEvaluator(design), len(design.points.variables)
    tangents = _Tangents(judge)
    first = np.full(count, 0.5) if design.start is None else design.start
    begins = [first, *np.random.default_rng(seed).random((starts - 1, count))]

    def search() -> None:
        for i, begin in enumerate(begins):
            _descend(tangents, begin, judge.count + (evaluations - judge.count) // (starts - i))

    result = judge.run_search(search)
    if tangents.warning and judge.count == starts:
        why, remedy = tangents.warning, "use --method evolution"
        raise refuse("--method gradient", "a start without derivatives", "a run with derivatives", why, remedy)
    return replace(result, is_flat=tangents.is_flat)


class _Tangents:
    def __init__(self, judge: ProblemEvaluator) -> None:
        self.judge, points = judge, judge.design.points
        self._widths = interval_widths(points.case, points.variables)
        self.warning = ""  #: why the last variant without derivatives has none
        self.is_flat = False  #: whether the goal has no slope at the first point

    def plane(self, x: FloatArray) -> Plane | None:
        """Return the tangents at a point; None if its run fails or has no derivative."""
        [row] = self.judge.rows(x[None])
        costs, violations = self.judge.judge([row])
        if not (row.status.ok and math.isfinite(costs[0, 0])):
            return None
        if not row.derivatives:
            self.warning = row.status.text
            return None
        goal, bounds = self.judge.design.goals[0], self.judge.design.bounds

        def slope(name: str) -> FloatArray:
            return self._widths * np.array(row.derivatives[name])

        cuts = list[tuple[int, float, FloatArray]]()
        for i, limit in enumerate(bounds):
            sign = (1.0 if limit.relation == "<=" else -1.0) / (abs(limit.bound(row.units[limit.name])) or 1.0)
            value = float(violations[0, i])
            cuts.append((i, value, sign * slope(limit.name)))
            cuts += [
                (i, value + sign * offset, sign * self._widths * np.array(slopes))
                for offset, *slopes in row.extremes.get(limit.name, ())
                if sign * offset < 0.0
            ]
        cost_slope = (-1.0 if goal.most else 1.0) * slope(goal.name)
        self.is_flat = self.is_flat or (self.judge.count == 1 and not cost_slope.any())
        if not all(np.isfinite(gradient).all() for gradient in (cost_slope, *(gradient for _, _, gradient in cuts))):
            return None
        return Plane(x, float(costs[0, 0]), cost_slope, violations[0, :-1], cuts)


def _descend(tangents: _Tangents, start: FloatArray, end: int) -> None:
    """Search from a point until the box is small or a number of variants is reached."""
    judge, best = tangents.judge, tangents.plane(start)
    if best is None:
        return
    planes, radius, margin, is_corrected = [best], _BOX, _LEAST_INSIDE, False
    while radius > _SMALLEST_BOX and judge.count < end:
        near = [plane for plane in planes if np.abs(plane.at - best.at).max() <= _NEAR * radius][-_PLANES:]
        step = _lowest(near if best in near else [best, *near], best, radius, margin)
        count = judge.count
        new = tangents.plane(step.to) if step.gain > 0.0 or best.violation > 0.0 else None
        new = new if judge.count > count else None  # an evaluated point is no progress: two could alternate
        gain = -math.inf if new is None else best.merit(step.price) - new.merit(step.price)
        ratio = gain / max(step.gain, _NO_GAIN * (abs(best.cost) or 1.0))
        # The planes of a point that is not much worse than the best one correct the next step in the same box.
        is_corrected = -1.0 < ratio <= 0.0 and not is_corrected
        if ratio < _BAD and not is_corrected:
            radius *= _SHRINK
        elif ratio > _GOOD and np.abs(step.to - best.at).max() > _AT_BORDER * radius:
            radius = min(_GROW * radius, _LARGEST_BOX)
        if new is not None:
            maximum = _INSIDE * radius if best.violation <= 0.0 else _MOST_INSIDE
            margin = min(max(new.violation, _LEAST_INSIDE), maximum)
            planes.append(new)
            best = new if gain > 0.0 else best


@dataclass(frozen=True, eq=False)
class _Step:
    """Step from the best variant."""

    to: FloatArray  #: shape (k,)
    price: float  #: of a relative violation, as in `Plane.merit`
    gain: float  #: expected reduction of the merit


def _lowest(planes: list[Plane], best: Plane, radius: float, margin: float) -> _Step:
    """Return the step to the lowest point of all planes in the box about the best variant.

    The price is above what a violation gains, so that a search that pays it ends without violation.
    """
    from scipy.optimize import linprog

    size, rows, limits = abs(best.cost) or 1.0, list[list[float]](), list[float]()

    def add(value: float, known: float, slope: FloatArray, at: FloatArray, by_cost: float, by_violation: float) -> None:
        height = value + float(slope @ (best.at - at))
        if height <= known:  # otherwise the plane is not below the quantity, which has another curvature
            rows.append([*slope.tolist(), by_cost, by_violation])
            limits.append(float(slope @ best.at) - height)

    for plane in planes:
        add(plane.cost / size, best.cost / size, plane.cost_slope / size, plane.at, -1.0, 0.0)
        for i, violation, slope in plane.cuts:
            add(violation + margin, float(best.violations[i]) + margin, slope, plane.at, 0.0, -1.0)
    box = [(max(x - radius, 0.0), min(x + radius, 1.0)) for x in best.at.tolist()]
    goal, bounds = [*(0.0 * best.at), 1.0, _PENALTY], [*box, (None, None), (0.0, None)]
    solution = linprog(goal, A_ub=rows, b_ub=limits, bounds=bounds, method="highs")
    if solution.x is None:
        return _Step(best.at, 0.0, 0.0)
    *to, cost, violation = np.asarray(solution.x, dtype=float).tolist()
    marginals = -np.asarray(solution.ineqlin.marginals)[[row[-1] < 0.0 for row in rows]]
    price = size * min(max(_PRICE_MARGIN * float(marginals.sum()), _LEAST_PRICE), _PENALTY)
    return _Step(np.clip(to, 0.0, 1.0), price, best.merit(price) - size * cost - price * max(violation - margin, 0.0))
