"""Derivatives of results by numbers of a case, exact through the time integration, and the search along them.

Results of a run are derived along its motion (`flexcam.dynamics.tangent`), all others, such as natural frequencies,
static results, Floquet multipliers and properties of a cam, by central differences: contact events add no noise.

Maxima and minima over a revolution have kinks where another instant becomes the extreme one. A step of the search
therefore takes all planes that are known near the best variant, tangents of the goal and of the constraints. It solves
a linear program within a box about the best variant; the box moves with it and shrinks when no better one is found.
This is the cutting-plane method with a trust region: J. E. Kelley, J. SIAM 8 (1960) 703; K. Madsen, J. Inst. Maths
Applics 16 (1975) 321.
"""

# pyright: reportMissingTypeStubs=false, reportUnknownMemberType=false

from __future__ import annotations

import math
from collections.abc import Generator, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

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
from flexcam.dynamics import ProgressCallback, RunFailedError, Scheme, Status, System, Variation, tangent_run
from flexcam.dynamics.massless import FORCE_TOLERANCE, MasslessMotions
from flexcam.studies.evaluation import compute_scalars
from flexcam.studies.executors import open_evaluators
from flexcam.studies.optimization import ROUNDING, Evaluations, OptimizationProblem, ProblemEvaluator
from flexcam.studies.plan import Row, check_seed, make_bundle
from flexcam.studies.quantities import compute_quantities, is_run_scalar, quantity_row
from flexcam.studies.variables import Runs, Variable, WorstCase, interval_widths
from flexcam.valvetrain import Metric

# Change of a number relative to its size: a compromise of rounding, and of contacts that it switches; more for the
# central differences of other results, as periodic states and eigenvalues have rounding errors of 1e-10.
RELATIVE_WIDTH, _WIDTH_WITHOUT_RUN = 1e-6, 1e-4
CHAOTIC_GROWTH = 1e3  # growth of a disturbance over a run above which derivatives say nothing about practical changes
_PERIODIC = 1e-6  # relative residual of a periodic start above which its derivative does not exist
_SIMILAR_RUNS = 10  # number of runs whose time the derivatives of a run take, for the selection of the engine
COUNTED = (".bounces", ".open_on_the_lift")  # ends of the names of results that count, and have no derivative
_RATES = (".velocity", ".acceleration")  # ends of the names of histories that a point without mass does not have
_PROBE_KINDS = {"probes", "deviation"}  # first parts of the names of scalars that need no channels
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
    growth: float
    warning: str = ""


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

    def add(number: Number, width: float, below: Mapping[str, Metric], above: Mapping[str, Metric]) -> None:
        for name in below:
            known = name in above and not name.endswith(COUNTED)
            derivatives[name, number.key] = (above[name].value - below[name].value) / width if known else math.nan

    growth, warning, file = 1.0, "", CaseFile.of(case)
    if of_runs:
        sides = [
            next(_neighbour_cases(file, case, number, RELATIVE_WIDTH * size))
            for number, size in zip(numbers, sizes, strict=True)
        ]
        found, growth, warning = _run_scalars(case, sides, of_runs)
        middle, *rows = [{one.name: one for one in metrics if one.name in of_runs} for metrics in found]
        values |= middle
        for number, (_, width), below, above in zip(numbers, sides, rows[::2], rows[1::2], strict=True):
            add(number, width, below, above)
    if others:
        values |= compute_quantities(case, others)
        for number, size in zip(numbers, sizes, strict=True):
            cases = *_neighbour_cases(file, case, number, _WIDTH_WITHOUT_RUN * size), (case, 0.0)
            (above, more), (below, less) = cases[:2]  # one side alone at the end of the permitted values
            add(number, more - less, compute_quantities(below, others), compute_quantities(above, others))
    return Gradient(values, derivatives, growth, warning)


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
    derive = partial(_derivative_row, names=tuple(names), keys=tuple(one.key for one in variables), sizes=sizes)
    source, conditions = make_bundle(file, None, fixed), worst or WorstCase(((),), {})
    with open_evaluators(source, (row, derive), fixed, workers=workers, advance=advance) as evaluators:
        yield conditions.over(*evaluators)


def _derivative_row(case: Case, names: Sequence[str], keys: Sequence[str], sizes: Sequence[float]) -> Row:
    """Return the derivatives of a variant, or a complete row whose status says why there are none."""
    row = Row(Status())
    try:
        found = compute_gradient(case, names, [get_number(case, key, "--vary") for key in keys], sizes)
    except (InputError, RunFailedError) as failure:  # the variant counts without them
        return replace(row, status=Status(text=str(failure)))
    if found.warning:
        return replace(row, status=Status(text=found.warning))
    slopes = {name: tuple(found.derivatives.get((name, key), math.nan) for key in keys) for name in names}
    return replace(row, derivatives=slopes)


def make_neighbours(case: Case, number: Number, steps: Iterable[float]) -> list[tuple[str, ...]]:
    """Return the overrides of cases with a number at some steps from its value."""
    return [make_overrides(case, {number.key: repr(number.value + step)}) for step in steps]


def _run_scalars(
    case: Case, sides: Sequence[tuple[Case, float]], names: Sequence[str]
) -> tuple[list[list[Metric]], float, str]:
    """Return the scalars of a run and of its neighbours, the growth of disturbances, and a warning.

    `sides` are cases with one changed number each, and the changes.
    """
    if why := exact_refusal(case):
        raise refuse("--method", "exact", "differences", why)
    kinds = {name.partition(".")[0] for name in names}
    case = case.with_newmark()
    ready = _with_channels(prepare(case, runs=_SIMILAR_RUNS), kinds)
    others = [_with_channels(prepare_without_periodic_search(one.with_newmark(), ready), kinds) for one, _ in sides]
    periodic, near = case.record.run.start == "periodic", ready.problem.start
    if not periodic:  # found in the same way as those of the others, so that rounding errors cancel
        ready = replace(ready, problem=set_initial_state(case, ready.model, ready.problem, near=near))
    variations = [Variation(one.problem, width) for one, (_, width) in zip(others, sides, strict=True)]
    period = steps_per_revolution(case, ready.problem) if periodic else None
    accelerations = not kinds <= _WITHOUT_ACCELERATION
    revolution = math.ceil(ready.revolution / ready.problem.step) + _SPARE
    first = 0 if "deviation" in kinds else max(ready.problem.steps - revolution, 0)
    found = tangent_run(
        ready.problem, ready.scheme, variations, period=period, accelerations=accelerations, first=first
    )
    if not found.response.status.ok:
        raise RunFailedError(found.response.status)
    rows = [compute_scalars(ready, found.response, names)]
    for other, (below, above) in zip(others, found.neighbours, strict=True):
        rows += [compute_scalars(ready, below, names), compute_scalars(other, above, names)]
    light = _massless_probes(ready.problem.system)
    rows[1:] = [
        [one for one in row if not (one.name.rpartition(".")[0].endswith(_RATES) and one.name.startswith(light))]
        for row in rows[1:]
    ]
    if found.growth > CHAOTIC_GROWTH:
        return rows, found.growth, f"the motion is chaotic: a small disturbance grows {found.growth:.1g} times"
    residual = (ready.problem.start.periodicity or 0.0) if periodic and ready.problem.start else 0.0
    return rows, found.growth, f"the periodic start repeats only to {residual:.1g}" if residual > _PERIODIC else ""


def _massless_probes(system: System) -> tuple[str, ...]:
    """Return the beginnings of the names of results of points without mass."""
    light = MasslessMotions(system)
    return tuple(
        f"probes.{probe.name}." + (f"{component}." if len(probe.components) > 1 else "")
        for probe in system.probes
        for component, row in zip(probe.components, probe.rows, strict=True)
        if (light.force_on_massless(row[None]) > FORCE_TOLERANCE).any()
    )


def _with_channels(ready: PreparedRun, kinds: set[str]) -> PreparedRun:
    """Return a run with channels of some kinds, or probes, alone; metrics of all parts need those of the contacts."""
    system = ready.problem.system
    needed = set[str]() if kinds <= _PROBE_KINDS else {*kinds, "contacts"}
    channels = tuple(one for one in system.channels if one.name.partition(".")[0] in needed)
    probes = () if kinds <= _WITHOUT_ACCELERATION else system.probes
    return replace(ready, problem=replace(ready.problem, system=replace(system, channels=channels, probes=probes)))


_BOX, _SMALLEST_BOX = 0.1, 1e-3  # first and smallest half width of the box, relative to the intervals
_SHRINK, _GROW = 0.6, 1.5  # factors of the box after a step without and with success at its border
_CORRECTIONS = 1  # steps without success before the box shrinks
_NEAR, _PLANES = 3.0, 16  # distance of the planes that count, in half widths of the box, and their number
_PENALTY = 100.0  # weight of the largest relative violation of a constraint, relative to that of the goal
_INSIDE = 1e-6  # distance from a bound, relative to it, that a step keeps, so that its result satisfies the bound


@dataclass(frozen=True, eq=False)
class Plane:
    """Tangents at a point, by fractions of the intervals."""

    at: FloatArray  #: shape (k,)
    cost: float  #: quantity to be minimized
    cost_slope: FloatArray  #: shape (k,)
    violations: FloatArray  #: relative violations of the constraints, shape (b,)
    violation_slopes: FloatArray  #: shape (b, k)

    @property
    def merit(self) -> tuple[float, float]:
        """Violation of the constraints, then the cost: the smaller pair is the better variant."""
        passed = float(np.maximum(self.violations, 0.0).sum())
        return (passed if passed > ROUNDING else 0.0, self.cost)


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
    first = np.full(count, 0.5) if design.start is None else design.start
    begins = [first, *np.random.default_rng(seed).random((starts - 1, count))]
    tangents = _Tangents(design, judge)

    def search() -> None:
        for i, begin in enumerate(begins):
            _descend(tangents, judge, begin, judge.count + (evaluations - judge.count) // (starts - i))

    found = judge.run_search(search)
    if tangents.warning and judge.count == starts:
        why, remedy = tangents.warning, "use --method evolution"
        raise refuse("--method gradient", "a start without derivatives", "a run with derivatives", why, remedy)
    return replace(found, is_flat=tangents.is_flat)


class _Tangents:
    def __init__(self, design: OptimizationProblem, judge: ProblemEvaluator) -> None:
        self._design, self._judge = design, judge
        self._widths = interval_widths(design.points.case, design.points.variables)
        self.warning = ""  #: why the last variant without derivatives has none
        self.is_flat = False  #: whether the goal has no slope at the first point

    def plane(self, x: FloatArray) -> Plane | None:
        """Return the tangents at a point; None if its run fails or has no derivative."""
        [row] = self._judge.rows(x[None])
        costs, violations = self._judge.judge([row])
        if not (row.status.ok and math.isfinite(costs[0, 0])):
            return None
        if not row.derivatives:
            self.warning = row.status.text
            return None
        goal, bounds = self._design.goals[0], self._design.bounds

        def slope(name: str) -> FloatArray:
            return self._widths * np.array(row.derivatives[name])

        rows = [
            slope(one.name) * (1.0 if one.relation == "<=" else -1.0) / (abs(one.bound(row.units[one.name])) or 1.0)
            for one in bounds
        ]
        cost_slope = (-1.0 if goal.most else 1.0) * slope(goal.name)
        self.is_flat = self.is_flat or (self._judge.count == 1 and not cost_slope.any())
        slopes = np.array(rows).reshape(len(bounds), len(self._widths))
        if not (np.isfinite(cost_slope).all() and np.isfinite(slopes).all()):
            return None
        return Plane(x, float(costs[0, 0]), cost_slope, violations[0, :-1], slopes)


def _descend(tangents: _Tangents, judge: ProblemEvaluator, start: FloatArray, end: int) -> None:
    """Search from a point until the box is small or a number of variants is reached."""
    best = tangents.plane(start)
    if best is None:
        return
    planes, radius, failed = [best], _BOX, 0
    while radius > _SMALLEST_BOX and judge.count < end:
        near = [one for one in planes if np.abs(one.at - best.at).max() <= _NEAR * radius][-_PLANES:]
        x = _lowest(near if best in near else [best, *near], best, radius)
        is_step = np.abs(x - best.at).max() > 0.01 * _SMALLEST_BOX or best.merit[0] > 0.0
        new = tangents.plane(x) if is_step else None
        if new is not None:
            planes.append(new)
        if new is None or new.merit >= best.merit:
            failed += 1  # the planes of a point that is no better correct the next step in the same box
            radius *= _SHRINK if new is None or failed > _CORRECTIONS else 1.0
            continue
        failed = 0
        if np.abs(new.at - best.at).max() > 0.8 * radius:
            radius = min(_GROW * radius, 0.5)
        best = new


def _lowest(planes: list[Plane], best: Plane, radius: float) -> FloatArray:
    """Return the lowest point of all planes in the box about the best variant, shape (k,)."""
    from scipy.optimize import linprog

    size, rows, limits = abs(best.cost) or 1.0, list[list[float]](), list[float]()

    def add(value: float, known: float, slope: FloatArray, at: FloatArray, by_cost: float, by_violation: float) -> None:
        here = min(value + float(slope @ (best.at - at)), known)  # a plane that is too high there is lowered
        rows.append([*slope.tolist(), by_cost, by_violation])
        limits.append(float(slope @ best.at) - here)

    for one in planes:
        add(one.cost / size, best.cost / size, one.cost_slope / size, one.at, -1.0, 0.0)
        for i, slope in enumerate(one.violation_slopes):
            known = float(best.violations[i]) + _INSIDE
            add(float(one.violations[i]) + _INSIDE, known, slope, one.at, 0.0, -1.0)
    box = [(max(one - radius, 0.0), min(one + radius, 1.0)) for one in best.at.tolist()]
    goal, bounds = [*(0.0 * best.at), 1.0, _PENALTY], [*box, (None, None), (0.0, None)]
    found = linprog(goal, A_ub=rows, b_ub=limits, bounds=bounds, method="highs")
    return best.at if found.x is None else np.clip(np.asarray(found.x[:-2], dtype=float), 0.0, 1.0)
