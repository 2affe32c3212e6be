"""Command that finds the best variant of a case: optimize."""

from __future__ import annotations

import math
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

import numpy as np
from cyclopts import Parameter
from rich.table import Table

from flexcam import plotting
from flexcam.analysis.run_checks import check_events
from flexcam.cli import app as cli
from flexcam.cli import study_options as study
from flexcam.cli.study_options import StudyOptions
from flexcam.core.errors import refuse
from flexcam.core.units import conversion_factor, to_display_unit
from flexcam.dynamics import Cause, RunFailedError, Status
from flexcam.report.terminal import facts_table, format_csv, format_decimals, format_number, plain_table, with_unit
from flexcam.studies import optimization
from flexcam.studies.evaluation import evaluate
from flexcam.studies.gradients import optimize_by_gradient
from flexcam.studies.optimization import ROUNDING, Constraint, Evaluations, Goal, OptimizationProblem, row_value
from flexcam.studies.plan import make_plan, parse_axes
from flexcam.studies.quantities import is_run_scalar
from flexcam.studies.sensitivity import exact_names
from flexcam.studies.variables import PointEvaluator, WorstCase, require_units, variables_of
from flexcam.valvetrain import Metric

if TYPE_CHECKING:
    from matplotlib.figure import Figure

# Distance to a variant that violates a constraint, relative to the intervals, below which the constraint is active.
_ACTIVE_DISTANCE = 0.01
_AT_BOUND = 5e-5  # margin, relative to the bound, that is printed as zero: any change may violate the constraint


@cli.command("""\
flexcam optimize case.toml --vary springs.valve.stiffness=30:90kN/m --vary springs.valve.installed_force=300:900N \\
    --least springs.valve.force.largest --subject 'contacts.intake.open_on_the_lift <= 0' --set run.crank_speed=6500rpm
flexcam optimize case.toml --vary cams.intake.rise=60:90deg --least cams.intake.deceleration --most cams.intake.area
flexcam optimize case.toml --method gradient --vary springs.valve.stiffness=30:90kN/m --vary run.crank_speed=5000:7000rpm \\
    --most run.crank_speed --subject 'contacts.intake.nose_force.least >= 50 N' --subject 'springs.valve.stress.largest <= 0.9 GPa'
""")  # noqa: E501 - a command to a line
def optimize(
    case: cli.CaseFile, *,
    vary: study.Vary,
    least: Annotated[list[str] | None, Parameter(
        "--least", help="Minimize this result, named as in flexcam sensitivity --of.")] = None,
    most: Annotated[list[str] | None, Parameter("--most", help="Maximize this result.")] = None,
    subject: Annotated[list[str] | None, Parameter(
        "--subject", help="Constraint: 'NAME <= VALUE' or 'NAME >= VALUE'. Repeatable.")] = None,
    at: Annotated[list[str] | None, Parameter(
        "--at", help="Evaluate every variant at these conditions, such as masses.valve.mass=85:95:5g; each goal "
        "and constraint takes its worst value. Repeatable.")] = None,
    method: Annotated[Literal["evolution", "gradient"], Parameter(
        help="evolution searches the whole intervals without derivatives; gradient starts at the case "
        "and follows exact derivatives to the nearest optimum.")] = "evolution",
    starts: Annotated[int | None, Parameter(
        help="With --method gradient: number of starting points; 1, the case itself, by default.")] = None,
    evaluations: Annotated[int, Parameter(help="Approximate number of variants to run.")] = 200,
    seed: Annotated[int, Parameter(help="Random seed; the same seed gives the same search.")] = 0,
    workers: study.WorkerCount = 1, lowest: study.Lowest = None, highest: study.Highest = None,
    accuracy: study.LimitAccuracy = "10 rpm", target: study.NewCase = None, csv: cli.Csv = None,
    plot: cli.Picture = None, overrides: cli.Overrides = None,
    allow_large: cli.AllowLarge = False, overwrite: cli.Overwrite = False, as_json: cli.Json = False,
) -> cli.CommandOutput:  # fmt: skip
    """Find the best variant of a case under constraints, or the Pareto front of two goals."""
    cli.check_targets(csv, plot, case, overwrite=overwrite, target=target)
    goals, bounds = _parse_goals(least or (), most or ()), optimization.parse_constraints(subject or ())
    names, option = [criterion.name for criterion in (*goals, *bounds)], "--least, --most or --subject"
    options = StudyOptions(
        case, overrides, names, lowest, highest, accuracy, option=option, workers=workers, allow_large=allow_large
    )
    variables = variables_of(options.case, vary, "--vary")
    by_gradient = method == "gradient"
    cli.refuse_without("--method gradient", {"--starts": starts}, present=by_gradient)
    if by_gradient:
        exact_names(options.case, names, "exact", option="--method gradient", other="use --method evolution")
    else:
        optimization.generation_size(len(goals), len(variables), evaluations, seed)
    with suppress(RunFailedError):  # a case that fails may have better variants
        options.initial_quantities(evaluations)
    worst = _worst_case(options, at, goals, bounds, [variable.key for variable in variables]) if at else None
    with options.evaluators(evaluations, variables=variables if by_gradient else (), worst=worst) as runs:
        points = PointEvaluator(options.case, variables, runs)
        design = OptimizationProblem(points, goals, bounds)
        if by_gradient:
            begins = 1 if starts is None else starts
            trials = optimize_by_gradient(design, evaluations=evaluations, starts=begins, seed=seed)
        else:
            trials = optimization.optimize(design, evaluations=evaluations, seed=seed)
    files: list[Path] = []
    if target is not None and trials.best is not None:
        best = (*options.fixed, *design.points.overrides(trials.points[trials.best]))
        title = f"The best variant of {options.file.path.name}:"
        files = study.write_variant(options.file, best, target, title, overwrite=overwrite)
    output = _describe_search(options, design, trials, worst, gradient=by_gradient)
    status = Status()
    if trials.stopped:
        done = f"stopped after {len(trials.rows)} of about {evaluations} variants; the result is their best"
        status = Status(Cause.INTERRUPTED, done, "run the same command with the same --seed again for the whole search")
    elif trials.best is None:
        text, remedy = "no variant meets all constraints", "widen the intervals, or relax a constraint"
        if by_gradient:
            begin = "this start" if starts in (None, 1) else f"any of {starts} starts"
            text = f"the gradient search found no variant that meets all constraints from {begin}"
            other = "start elsewhere (--set, --starts), such as at a speed without contact loss"
            remedy = f"widen the intervals, relax a constraint, {other}, or use --method evolution"
        status = Status(Cause.INFEASIBLE, text, remedy)
    return replace(output, files=files, status=status)


def _describe_search(
    options: StudyOptions, design: OptimizationProblem, trials: Evaluations, worst: WorstCase | None, *, gradient: bool
) -> cli.CommandOutput:
    parts, json = _optimum(design, trials) if len(design.goals) == 1 else _front(design, trials)
    failed = [row.status for row in trials.rows if not row.status.ok]
    json |= {"evaluations": len(trials.rows), "failed": len(failed)}
    if failed:
        parts.append(f"{len(failed)} variants failed and count as violating every constraint; the first: {failed[0]}")
    if gradient and design.start is None:
        parts.append("The case is outside the intervals: the search started from their centre.")
    if trials.is_flat:
        remedy = "Vary a value on which it depends, add --starts, or use --method evolution."
        if design.goals[0].name.startswith("contacts."):
            remedy = f"A lost contact has no force: start with a closed contact (--set). {remedy}"
        parts.append(f"At the start no varied value changes {design.goals[0].name}. {remedy}")
    if not trials.stopped and trials.best is not None and len(design.goals) == 1:
        conditions = worst.conditions if worst else ((),)
        json["warnings"] = _check_variant(options, design.points.overrides(trials.points[trials.best]), conditions)
        parts += json["warnings"]
    return cli.CommandOutput(parts, json, _csv(design, trials), lambda: _search_figure(design, trials))


def _parse_goals(minimized: Sequence[str], maximized: Sequence[str]) -> tuple[Goal, ...]:
    goals = (*map(Goal, minimized), *(Goal(name, most=True) for name in maximized))
    if len(goals) not in (1, 2):
        raise refuse("--least, --most", f"{len(goals) or 'no'} goals", "one goal, or two for a Pareto front")
    if len({goal.name for goal in goals}) < len(goals):
        why = "a Pareto front needs two quantities"
        raise refuse("--least, --most", f"{goals[0].name} twice", "two different quantities", why, "leave one out")
    return goals


def _check_variant(options: StudyOptions, variant: Sequence[str], conditions: Sequence[Sequence[str]]) -> list[str]:
    """Return warnings about events of the best variant, such as contact loss, in each of its conditions."""
    if not any(is_run_scalar(options.case, name) for name in options.names):
        return []
    warnings: list[str] = []
    for condition in conditions:
        row = evaluate(options.file.read((*options.fixed, *variant, *condition)))
        metrics = [Metric(name, value, row.units[name]) for name, value in row.scalars.items()]
        where = " at ".join(["the best variant", *([", ".join(condition)] if condition else [])])
        warnings += [warning.replace("Warning: ", f"Warning: {where}: ", 1) for warning in check_events(metrics)]
    return warnings


def _worst_case(
    options: StudyOptions, at: Sequence[str], goals: Sequence[Goal], bounds: Sequence[Constraint], varied: Sequence[str]
) -> WorstCase:
    """Return the conditions, and which end of every result is its worst one."""
    axes = parse_axes(at, option="--at")
    for axis in axes:
        if axis.key in varied:
            raise refuse("--at", axis.key, "a key that --vary does not name", "it would override the variable")
        if not axis.is_varied:
            allowed = "several values, such as 4000:6000:500rpm or 1,2,5mm"
            raise refuse("--at", axis.where.removeprefix("--at "), allowed, "", "for one condition use --set")
        options.file.read((*options.fixed, f"{axis.key}={axis.values[0].text}"))  # raises an error for an unknown key
        require_units(options.case, [axis])
    largest = {goal.name: not goal.most for goal in goals}
    for bound in bounds:
        upper = bound.relation == "<="
        if largest.setdefault(bound.name, upper) != upper:
            why = "with --at a result has one worst condition"
            raise refuse("--at", f"{bound.name} with an upper and a lower goal", "one of them", why)
    return WorstCase(make_plan(axes).variants, largest)


def _search_figure(design: OptimizationProblem, trials: Evaluations) -> Figure:
    inside = optimization.is_feasible(trials.violations)
    signs = np.array([-1.0 if goal.most else 1.0 for goal in design.goals])
    units = [_unit(design, trials, goal.name) for goal in design.goals]
    labels = [with_unit(goal.name, unit) for goal, (_, unit) in zip(design.goals, units, strict=True)]
    signs *= [factor for factor, _ in units]
    if len(design.goals) > 1:
        return plotting.histories.front_figure(
            trials.costs * signs, inside, optimization.pareto_indices(trials), (labels[0], labels[1])
        )
    costs = trials.costs[:, 0]
    best = np.fmin.accumulate(np.where(inside & np.isfinite(costs), costs, np.nan))
    return plotting.histories.progress_figure(signs[0] * costs, inside, signs[0] * best, labels[0])


def _optimum(design: OptimizationProblem, trials: Evaluations) -> tuple[list[Table | str], dict[str, Any]]:
    """Return the printed output and the JSON of an optimization with one goal."""
    at = trials.nearest if trials.best is None else trials.best
    title = f"Best of {len(trials.rows)} variants" if trials.best is not None else "Variant with the smallest violation"
    point = list(zip(design.points.variables, trials.points[at].tolist(), strict=True))
    rows = [
        (design.goals[0].words, _value(design, trials, at, design.goals[0].name)),
        *((f"--set {v.key}", f"{format_number(x)}{v.unit}") for v, x in point),
    ]
    parts: list[Table | str] = [facts_table(title, rows)]
    if design.bounds:
        parts += [_constraint_table(design, trials, at), _DISTANCE]
        if any(active and violation <= ROUNDING for _, violation, _, active in _constraints(design, trials, at)):
            parts.append("active: the result is within 1 % of its bound, or a change of the values by 1 % violates it")
    if ends := [v.key for v, x in point if min(x - v.low, v.high - x) <= 0.01 * (v.high - v.low)]:
        parts.append(f"At an end of its --vary range: {', '.join(ends)}; a wider range may have a better variant.")
    best = None if trials.best is None else _variant_json(design, trials, trials.best)
    return parts, {"best": best, "nearest": _variant_json(design, trials, at)}


_DISTANCE = (
    "distance to violation: distance of this variant from the nearest evaluated one that violates the constraint, in % "
    "of the --vary intervals; a dash: this variant violates it"
)


def _front(design: OptimizationProblem, trials: Evaluations) -> tuple[list[Table | str], dict[str, Any]]:
    """Return the printed output and the JSON of a search for a Pareto front."""
    best = optimization.pareto_indices(trials)
    units = [(goal, *_unit(design, trials, goal.name)) for goal in design.goals]
    head = (*(with_unit(goal.words, unit) for goal, _, unit in units),
            *(with_unit(variable.key, variable.unit) for variable in design.points.variables))  # fmt: skip
    rows = [
        (*(factor * row_value(trials.rows[i], goal.name) for goal, factor, _ in units), *trials.points[i].tolist())
        for i in best
    ]
    title = f"Pareto front of {len(trials.rows)} variants" if rows else "No variant meets all constraints"
    return [plain_table(title, head, rows)], {"front": [_variant_json(design, trials, i) for i in best]}


def _unit(design: OptimizationProblem, trials: Evaluations, name: str) -> tuple[float, str]:
    """Return the factor from SI to the unit in which a value is varied, and this unit; of a result the SI unit."""
    si = design.unit(name, trials.rows)
    unit = next((variable.unit for variable in design.points.variables if variable.key == name), si)
    return 1.0 if unit == si else 1.0 / conversion_factor(unit, si, "--vary"), unit


def _value(design: OptimizationProblem, trials: Evaluations, at: int, name: str) -> str:
    """Return a value of a variant in the unit in which it is varied, of a result in that of engineers, such as deg."""
    row, si = trials.rows[at], design.unit(name, trials.rows)
    factor, unit = _unit(design, trials, name)
    if unit == si:
        factor, unit = to_display_unit(si)
    return f"{format_number(factor * row_value(row, name))} {unit}".strip()


def _constraint_table(design: OptimizationProblem, trials: Evaluations, at: int) -> Table:
    rows = list[Sequence[str]]()
    for constraint, violation, distance, active in _constraints(design, trials, at):
        if _is_zero(constraint, trials, at):  # nothing to which a margin is relative
            margin = "violated" if violation > ROUNDING else "active" if active else "met"
        elif violation > ROUNDING:
            margin = f"violated by {format_decimals(100.0 * violation, 2)} %"
        else:
            margin = f"{-violation:.2%} (active)" if active else f"{-violation:.1%}"
        away = "-" if violation > ROUNDING else "none found" if math.isinf(distance) else f"{distance:.2%}"
        rows.append((constraint.words, _value(design, trials, at, constraint.name), margin, away))
    head = ("subject to", "value", "margin", "distance to violation")
    return plain_table("Constraints", head, rows)


def _constraints(
    design: OptimizationProblem, trials: Evaluations, at: int
) -> list[tuple[Constraint, float, float, bool]]:
    """Return constraints with their violation, the distance to a variant that violates them, and if they are active."""
    bounds = enumerate(zip(design.bounds, trials.violations[at].tolist(), strict=False))
    rows = [
        (constraint, violation, 0.0 if abs(violation) < _AT_BOUND and not _is_zero(constraint, trials, at)
         else trials.distance_to_violation(at, i))
        for i, (constraint, violation) in bounds
    ]  # fmt: skip
    return [(*row, optimization.is_active(row[1]) or row[2] <= _ACTIVE_DISTANCE) for row in rows]


def _is_zero(constraint: Constraint, trials: Evaluations, at: int) -> bool:
    return constraint.bound(trials.rows[at].units.get(constraint.name, "rpm")) == 0.0


def _variant_json(design: OptimizationProblem, trials: Evaluations, i: int) -> dict[str, object]:
    row, names = trials.rows[i], [criterion.name for criterion in (*design.goals, *design.bounds)]
    return {
        "overrides": list(design.points.overrides(trials.points[i])),
        "values": {name: row_value(row, name) for name in names},
        "units": {name: row.units.get(name, "") for name in names},
        "bounds": [
            {"bound": constraint.words, "slack": -violation, "outside": distance, "active": active}
            for constraint, violation, distance, active in _constraints(design, trials, i)
        ],
    }


def _csv(design: OptimizationProblem, trials: Evaluations) -> str:
    names = list(dict.fromkeys(criterion.name for criterion in (*design.goals, *design.bounds)))
    head = [*(with_unit(v.key, v.unit) for v in design.points.variables), *names, "within all bounds", "status"]
    inside = optimization.is_feasible(trials.violations).tolist()
    rows: list[Sequence[object]] = [
        (*point, *(row_value(row, name) for name in names), "yes" if feasible else "no", row.status.cause)
        for point, row, feasible in zip(trials.points.tolist(), trials.rows, inside, strict=True)
    ]
    return format_csv(head, rows)
