"""Commands and tables of studies: maps of limits, sensitivity, tolerances, optimization."""

from __future__ import annotations

import math
from collections.abc import Generator, Mapping, Sequence
from contextlib import contextmanager, suppress
from itertools import compress
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import numpy as np
from cyclopts import Parameter
from rich.table import Table

from flexcam.analysis.limits import Search
from flexcam.case.case import Case
from flexcam.case.reader import CaseFile
from flexcam.cli.app import (
    AllowLarge,
    Json,
    Overrides,
    Overwrite,
    Picture,
    app,
    check_figure_path,
    parse_speed_tolerance,
    speed_range,
    warn_ignored_keys,
)
from flexcam.cli.app import CaseFile as CasePath
from flexcam.cli.arguments import StudyAnswer, check_distinct_files, check_targets, write_answer
from flexcam.core import FloatArray
from flexcam.core.errors import refuse
from flexcam.core.units import shaft_name
from flexcam.dynamics import Cause, RunFailedError, Status, reraise_interrupt
from flexcam.io import check_writable, write_text
from flexcam.report.formatting import StudyOutput, finite_or_none, format_csv, format_decimals, format_number
from flexcam.report.terminal import facts_table, plain_table, show_count
from flexcam.studies.evaluation import Row
from flexcam.studies.evaluators import (
    InterruptibleRuns,
    LimitMap,
    PointEvaluator,
    Runs,
    Variable,
    column,
    create_evaluator,
    grid_plan,
    limit_map,
    resolved_case_text,
    variables_of,
)
from flexcam.studies.evaluators import create_evaluator as study_evaluators
from flexcam.studies.optimization import (
    Evaluations,
    Goal,
    OptimizationProblem,
    find_pareto_front,
    is_active,
    is_feasible,
    pareto_indices,
    parse_constraints,
    row_value,
)
from flexcam.studies.optimization import optimize as study_optimize
from flexcam.studies.plan import Axis, parse_axis
from flexcam.studies.quantities import Quantity, check_names, compute_quantities, frequency_number
from flexcam.studies.sensitivity import (
    STEP_OFFSETS,
    Sensitivity,
    SobolIndices,
    check_count,
    get_numbers,
    sensitivities,
    sobol_indices,
)
from flexcam.studies.sweep import check_case_resources, validate_plan
from flexcam.studies.tolerance_analysis import QUANTILES, PartScatter, parse_scatters, sample_parts, scalar_distribution

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def limit_map_output(found: LimitMap, shaft: str) -> StudyOutput:
    """Return the output of a map of limits."""
    first, second = found.axes
    tables = [
        plain_table(
            f"{name.replace('_', ' ')}, {shaft} rpm; along: {describe_axis(second)}",
            (describe_axis(first), *(format_number(value.number or 0.0) for value in second.values)),
            [
                (format_number(value.number or 0.0), *(format_number(x) for x in row))
                for value, row in zip(first.values, rpm.tolist(), strict=True)
            ],
        )
        for name, rpm in found.rpm.items()
    ]
    gaps = sum(not status.ok for status in found.statuses)
    words = (
        ["A dash: not met in the range looked at."]
        if any(_describe_gaps(rpm.tolist()) for rpm in found.rpm.values())
        else []
    )
    if gaps:
        failed = next(status for status in found.statuses if not status.ok)
        words.append(f"{gaps} variants have no numbers; the first: {failed}")
    head = (describe_axis(first), describe_axis(second), *(f"{name} [{shaft} rpm]" for name in found.rpm), "status")
    rows = [
        (one.number or 0.0, other.number or 0.0, *(float(rpm[i, j]) for rpm in found.rpm.values()),
         str(found.statuses[i * len(second.values) + j].cause))
        for i, one in enumerate(first.values)
        for j, other in enumerate(second.values)
    ]  # fmt: skip
    json = {
        "shaft": shaft,
        "over": {"key": first.key, "unit": first.unit, "values": [value.number for value in first.values]},
        "and": {"key": second.key, "unit": second.unit, "values": [value.number for value in second.values]},
        "limits_rpm": {
            name: [[finite_or_none(x) for x in row] for row in rpm.tolist()] for name, rpm in found.rpm.items()
        },
        "statuses": [str(status.cause) for status in found.statuses],
    }
    return StudyOutput(tables, words, json, format_csv(head, rows))


def describe_axis(axis: Axis) -> str:
    """Describe the values along an axis."""
    return f"{axis.key}, {axis.unit}" if axis.unit else axis.key


def _describe_gaps(rows: list[list[float]]) -> bool:
    return any(math.isnan(x) for row in rows for x in row)


def map_limits(
    path: Path, overrides: Overrides, settings: tuple[str | None, str | None], names: Sequence[str], search: Search,
    workers: int, csv: Path | None, plot: Path | None, *, overwrite: bool, as_json: bool,
) -> Status:  # fmt: skip
    """Map limits over two numbers of a case."""
    over, beside = settings
    if over is None or beside is None:
        given = "--over alone" if over else "--and alone" if beside else "--limit, --workers, --csv or --plot alone"
        raise refuse("limits", given, "--over KEY=SPEC and --and KEY=SPEC", "they belong to a map over two numbers")
    check_targets(csv, plot, path, overwrite=overwrite)
    file = CaseFile.open(path)
    plan = grid_plan(_axis("--over", over), _axis("--and", beside), overrides or ())
    case = validate_plan(file, plan)
    shaft = shaft_name(case.turns)
    asked = [f"limits.{name}" for name in names]
    with (
        show_count(len(plan), "variants") as shown,
        create_evaluator(file, (), asked, search, workers=workers, runs=len(plan), advance=shown) as runs,
    ):
        kept = InterruptibleRuns(runs)
        found = limit_map(plan, names, kept).with_units(case)

    def draw() -> Figure:
        from flexcam.plotting.study_curves import map_figure

        first, second = (np.array([value.number for value in one.values]) for one in found.axes)
        labels = [describe_axis(one) for one in found.axes]
        return map_figure(second, first, found.rpm, (labels[1], labels[0]), shaft)

    write_answer((limit_map_output(found, shaft), draw), csv, plot, kept.status, overwrite=overwrite, as_json=as_json)
    return kept.status


def _axis(option: str, setting: str) -> Axis:
    key, equals, spec = setting.partition("=")
    if not equals:
        raise refuse(option, repr(setting), f"{option} KEY=SPEC, such as springs.valve.stiffness=40:70:5kN/m")
    if key.strip() in ("run.speed", "run.crank_speed"):
        why = "a limit is a speed, looked for from --lowest to --highest: that of the case has no part in it"
        raise refuse(option, key.strip(), "another number of the case", why, "vary a part")
    return parse_axis(key.strip(), spec, where=f"{option} {setting}")


def derivative_output(found: Sequence[Sensitivity]) -> StudyOutput:
    """Return the output of derivatives."""
    names = list(dict.fromkeys(one.scalar for one in found))
    tables = [_derivatives(name, [one for one in found if one.scalar == name]) for name in names]
    words = [f"{one.scalar} by {one.by.key}: {one.note}" for one in found if one.note]
    head = ("scalar", "unit", "value", "key", "key unit", "key value", "derivative", "error", "logarithmic", "smooth")
    rows = [
        (one.scalar, one.unit, one.value, one.by.key, one.by.unit, one.by.value, one.derivative,
         math.nan if one.error is None else one.error, one.logarithmic, one.smooth)
        for one in found
    ]  # fmt: skip
    return StudyOutput(tables, words, {"derivatives": [_json(one) for one in found]}, format_csv(head, rows))


def _derivatives(name: str, found: Sequence[Sensitivity]):  # noqa: ANN202 - a table of rich
    ordered = sorted(found, key=lambda one: -abs(one.logarithmic) if not math.isnan(one.logarithmic) else math.inf)
    rows = [
        (
            one.by.key,
            f"{format_number(one.by.value)} {one.by.unit}".strip(),
            f"{format_number(one.derivative)} {_derivative_unit(one)}".strip(),
            "analytic" if one.error is None and not math.isnan(one.derivative) else format_number(_error(one), 2),
            _percent(one.logarithmic),
            "" if one.smooth else _describe_doubt(one),
        )
        for one in ordered
    ]
    title = f"{name} = {format_number(found[0].value)} {_unit(found[0])}".rstrip()
    return plain_table(title, ("by", "at", "derivative", "error", "% per %", ""), rows)


def _unit(one: Sensitivity) -> str:
    """Return the unit of a scalar; empty if it is dimensionless."""
    return "" if one.unit == "1" else one.unit


def _derivative_unit(one: Sensitivity) -> str:
    """Return the unit of a derivative."""
    return f"{_unit(one)} per {one.by.unit}" if one.by.unit else _unit(one)


def _error(one: Sensitivity) -> float:
    return math.nan if one.error is None else one.error


def _describe_doubt(one: Sensitivity) -> str:
    if math.isnan(one.derivative):
        return "not known"
    return "equal frequencies" if one.error is None else "not smooth"


def _percent(value: float) -> str:
    return "-" if math.isnan(value) else f"{value:+.4f}"


def _json(one: Sensitivity) -> dict[str, object]:
    return {
        "scalar": one.scalar,
        "unit": one.unit,
        "value": finite_or_none(one.value),
        "key": one.by.key,
        "key_unit": one.by.unit,
        "key_value": one.by.value,
        "derivative": finite_or_none(one.derivative),
        "error": None if one.error is None else finite_or_none(one.error),
        "logarithmic": finite_or_none(one.logarithmic),
        "analytic": one.error is None and not math.isnan(one.derivative),
        "smooth": one.smooth,
        "note": one.note,
    }


def sobol_output(names: Sequence[str], variables: Sequence[Variable], found: Sequence[SobolIndices]) -> StudyOutput:
    """Return the output of Sobol indices."""
    keys = [one.key for one in variables]
    tables = [
        plain_table(
            f"Shares of the variance of {name} (standard deviation {format_number(math.sqrt(one.variance))})",
            ("by", "interval", "alone", "95 %", "with others", "95 %"),
            [
                (key, f"{variable.low:g} to {variable.high:g} {variable.unit}", f"{one.first[i]:.3f}",
                 _interval(one.first_interval[:, i]), f"{one.total[i]:.3f}", _interval(one.total_interval[:, i]))
                for i, (key, variable) in enumerate(zip(keys, variables, strict=True))
            ],
        )
        for name, one in zip(names, found, strict=True)
    ]  # fmt: skip
    words = [
        f"{name}: {one.used} of {one.asked} base points count: others failed, or their number is no power of 2"
        for name, one in zip(names, found, strict=True)
        if one.used < one.asked
    ]
    rows = [
        (name, key, float(one.first[i]), *one.first_interval[:, i].tolist(), float(one.total[i]),
         *one.total_interval[:, i].tolist())
        for name, one in zip(names, found, strict=True)
        for i, key in enumerate(keys)
    ]  # fmt: skip
    head = ("scalar", "key", "first", "first_low", "first_high", "total", "total_low", "total_high")
    json = {
        name: {
            "variance": one.variance, "used": one.used, "asked": one.asked,
            "indices": [dict(zip(head[1:], row[1:], strict=True)) for row in rows if row[0] == name],
        }
        for name, one in zip(names, found, strict=True)
    }  # fmt: skip
    return StudyOutput(tables, words, {"sobol": json}, format_csv(head, rows))


def _interval(ends: FloatArray) -> str:
    return f"{ends[0]:.3f} to {ends[1]:.3f}"


def _describe_initial_point(middle: Mapping[str, Quantity], name: str) -> float:
    return middle[name].value if name in middle else math.nan


def scatter_output(
    names: Sequence[str],
    scatters: Sequence[PartScatter],
    parts: FloatArray,
    rows: Sequence[Row],
    middle: Mapping[str, Quantity],
) -> StudyOutput:
    """Return the output of a tolerance analysis."""
    values = np.column_stack([column(rows, name) for name in names])
    units = {name: one.unit for name, one in middle.items()}
    units |= {
        name: next((row.units[name] for row in rows if name in row.units), "") for name in names if name not in units
    }
    found = {name: scalar_distribution(parts, values[:, i]) for i, name in enumerate(names)}
    told = [
        (
            name,
            units[name],
            format_number(_describe_initial_point(middle, name)),
            format_number(one.mean),
            format_number(one.deviation, 4),
            *(format_number(one.quantiles[part]) for part in QUANTILES),
            str(one.missing),
        )
        for name, one in found.items()
    ]
    head = ("scalar", "unit", "as it stands", "mean", "std", *(f"{part:.0%}" for part in QUANTILES), "missing")
    ranks = [
        (one.key, *(format_number(float(found[name].ranks[i]), 3) for name in names)) for i, one in enumerate(scatters)
    ]
    tables = [
        plain_table(f"Scatter over {len(parts)} sets of parts", head, told),
        plain_table("Rank correlation with each part: which it follows, and which way", ("part", *names), ranks),
    ]
    words = [
        f"{name}: {one.missing} sets have no number: their run failed, or the limit is not met in the range looked at"
        for name, one in found.items()
        if one.missing
    ]
    keys = [one.key for one in scatters]
    columns = (*keys, *names, "status")
    body = [
        (*point, *value, str(row.status.cause))
        for point, value, row in zip(parts.tolist(), values.tolist(), rows, strict=True)
    ]
    json = {
        name: {
            "unit": units[name],
            "value": finite_or_none(_describe_initial_point(middle, name)),
            "mean": finite_or_none(one.mean),
            "std": finite_or_none(one.deviation),
            "missing": one.missing,
            "count": len(parts),
            "quantiles": {f"{part:g}": finite_or_none(value) for part, value in one.quantiles.items()},
            "rank_correlation": {key: finite_or_none(x) for key, x in zip(keys, one.ranks.tolist(), strict=True)},
        }
        for name, one in found.items()
    }
    return StudyOutput(tables, words, {"scatter": json}, format_csv(columns, body))


_ROUNDING = 1e-9
"""Tolerance of a bound for rounding, relative to the bound."""

_ACTIVE_DISTANCE = 0.01
"""Distance, relative to the intervals, from a variant that violates a constraint for the constraint to be active."""


def optimum_output(design: OptimizationProblem, found: Evaluations) -> StudyOutput:
    """Return the output of an optimization with one goal."""
    best = found.best
    at = found.nearest if best is None else best
    goal, row = design.goals[0], found.rows[at]
    head = (
        f"Best of {len(found.rows)} variants" if best is not None else "Nearest to all bounds, which no variant meets"
    )
    rows = [(goal.words, f"{format_number(row_value(row, goal.name))} {_unit_optimum(row.units, goal.name)}".strip())]
    point = zip(design.points.variables, found.points[at].tolist(), strict=True)
    rows += [(f"--set {one.key}", f"{format_number(x)}{one.unit}") for one, x in point]  # all digits: --json, --csv, -o
    tables = [facts_table(head, rows)]
    if design.bounds:
        tables.append(_bounds(design, found, at))
    words = [_describe_interval_ends(design, found, at), _describe_failures(found)]
    json = {"best": None if best is None else _variant(design, found, best), "nearest": _variant(design, found, at),
            "evaluations": len(found.rows), "failed": _failures(found)}  # fmt: skip
    return StudyOutput(tables, [one for one in words if one], json, _csv(design, found))


def front_output(design: OptimizationProblem, found: Evaluations) -> StudyOutput:
    """Return the output of a Pareto front."""
    best = pareto_indices(found)
    names = [goal.name for goal in design.goals]
    head = (*(f"{goal.words}, {design.unit(goal.name, found.rows)}".rstrip(", ") for goal in design.goals),
            *(_key(one.key, one.unit) for one in design.points.variables))  # fmt: skip
    rows = [
        (
            *(format_number(row_value(found.rows[i], name)) for name in names),
            *(format_number(x) for x in found.points[i].tolist()),
        )
        for i in best
    ]
    title = f"Front of {len(found.rows)} variants: no other is better in both"
    told = plain_table(title if rows else "No variant that was evaluated is within all bounds", head, rows)
    json = {"front": [_variant(design, found, i) for i in best], "evaluations": len(found.rows),
            "failed": _failures(found)}  # fmt: skip
    return StudyOutput([told], [one for one in [_describe_failures(found)] if one], json, _csv(design, found))


def _key(key: str, unit: str) -> str:
    return f"{key}, {unit}" if unit else key


def _unit_optimum(units: Mapping[str, str], name: str) -> str:
    unit = units.get(name, "")
    return "" if unit == "1" else unit


def _bounds(design: OptimizationProblem, found: Evaluations, at: int) -> Table:
    row, passed = found.rows[at], found.violations[at]
    rows = [
        (
            one.words,
            f"{format_number(row_value(row, one.name))} {_unit_optimum(row.units, one.name)}".strip(),
            _closeness(float(passed[i]), found.distance_to_violation(at, i)),
            _step(found.distance_to_violation(at, i)),
        )
        for i, one in enumerate(design.bounds)
    ]
    return plain_table("Bounds", ("subject to", "is", "how close", "first passed, in the intervals"), rows)


def _closeness(passed: float, outside: float) -> str:
    if passed > _ROUNDING:
        return f"passed by {format_decimals(100.0 * passed, 2)} %"
    return f"decides: {-passed:.2%} away" if is_active(passed) or outside <= _ACTIVE_DISTANCE else f"{-passed:.1%} away"


def _step(outside: float) -> str:
    return "nowhere" if math.isinf(outside) else f"{outside:.2%} on"


def _describe_interval_ends(design: OptimizationProblem, found: Evaluations, at: int) -> str:
    """Return which interval limits the best variant has reached: a wider interval may contain a better one."""
    met = [
        one.key
        for one, value in zip(design.points.variables, found.points[at].tolist(), strict=True)
        if min(value - one.low, one.high - value) <= 0.01 * (one.high - one.low)
    ]
    return f"At an end of its interval: {', '.join(met)}; beyond it there may be a better variant." if met else ""


def _failures(found: Evaluations) -> int:
    return sum(not row.status.ok for row in found.rows)


def _describe_failures(found: Evaluations) -> str:
    failed = [row.status for row in found.rows if not row.status.ok]
    if not failed:
        return ""
    return f"{len(failed)} variants have no numbers and count as outside every bound; the first: {failed[0]}"


def _variant(design: OptimizationProblem, found: Evaluations, i: int) -> dict[str, object]:
    row = found.rows[i]
    names = [*(goal.name for goal in design.goals), *(one.name for one in design.bounds)]
    return {
        "overrides": list(design.points.overrides(found.points[i])),
        "values": {name: finite_or_none(row_value(row, name)) for name in names},
        "units": {name: row.units.get(name, "") for name in names},
        "bounds": [
            {
                "bound": one.words,
                "slack": finite_or_none(-float(x)),
                "outside": finite_or_none(found.distance_to_violation(i, k)),
                "active": is_active(float(x)) or found.distance_to_violation(i, k) <= _ACTIVE_DISTANCE,
            }
            for k, (one, x) in enumerate(zip(design.bounds, found.violations[i].tolist(), strict=False))
        ],
    }


def _csv(design: OptimizationProblem, found: Evaluations) -> str:
    """Return all evaluations in their order as CSV text."""
    names = list(dict.fromkeys([*(goal.name for goal in design.goals), *(one.name for one in design.bounds)]))
    head = [*(_key(one.key, one.unit) for one in design.points.variables), *names, "within all bounds", "status"]
    inside = is_feasible(found.violations).tolist()
    rows: list[Sequence[object]] = [
        (*point, *(row_value(row, name) for name in names), "yes" if good else "no", str(row.status.cause))
        for point, row, good in zip(found.points.tolist(), found.rows, inside, strict=True)
    ]
    return format_csv(head, rows)


def goal_history(found: Evaluations) -> list[float]:
    """Return the best goal after every evaluation, for a figure."""
    best, told = math.inf, list[float]()
    for cost, good in zip(found.costs[:, 0].tolist(), is_feasible(found.violations).tolist(), strict=True):
        best = min(best, cost) if good else best
        told.append(math.nan if math.isinf(best) else best)
    return told


Names = Annotated[
    list[str],
    Parameter("--of", negative=(), help="What is asked for: a scalar of a run, frequency.1, limits.loss_of_contact."),
]
Csv = Annotated[Path | None, Parameter("--csv", help="Also write the table here.")]
Seed = Annotated[int, Parameter("--seed", help="Of what is sampled: the same seed gives the same points.")]
WorkerCount = Annotated[int, Parameter("--workers", help="Processes that evaluate variants.")]
Lowest = Annotated[str | None, Parameter("--lowest", help="Speed from which limits are looked for.")]
Highest = Annotated[str | None, Parameter("--highest", help="Speed up to which limits are looked for.")]
Within = Annotated[str, Parameter("--within", help="Width of the bracket of limits.")]


@app.command(
    help_prologue="""\
flexcam sensitivity case.toml --of frequency.1 --to springs.valve.stiffness --to masses.valve.mass
flexcam sensitivity case.toml --of contacts.intake.force.largest --to springs.valve.stiffness --relative-step 0.02
flexcam sensitivity case.toml --of frequency.1 --to springs.valve.stiffness=30:60kN/m --to masses.valve.mass=80:100g --sobol 256
flexcam sensitivity case.toml --of limits.loss_of_contact --tolerance springs.valve.stiffness=±5% --count 100 --plot scatter.svg
"""  # noqa: E501 - a command to a line
)
def sensitivity(
    case: CasePath, *,
    names: Names,
    keys: Annotated[
        list[str] | None, Parameter("--to", negative=(), help="Key of a number; with --sobol KEY=LOW:HIGHunit.")
    ] = None,
    relative_step: Annotated[
        float | None, Parameter(help="Part of each number by which responses are differenced; 0.01 by default.")
    ] = None,
    sobol: Annotated[int | None, Parameter("--sobol", help="Sobol indices; base points, a power of 2.")] = None,
    tolerances: Annotated[
        list[str] | None,
        Parameter("--tolerance", negative=(), help="Scatter of parts: KEY=±2%, KEY=±0.05mm, KEY=normal:±2%."),
    ] = None,
    count: Annotated[int | None, Parameter("--count", help="Sets of scattered parts; 100 by default.")] = None,
    seed: Annotated[int | None, Parameter(help="Of --sobol and --tolerance; 0 by default.")] = None,
    workers: WorkerCount = 1,
    lowest: Lowest = None, highest: Highest = None, within: Within = "10 rpm",
    csv: Csv = None, plot: Picture = None,
    overrides: Overrides = None, allow_large: AllowLarge = False, overwrite: Overwrite = False, as_json: Json = False,
) -> Status:  # fmt: skip
    """Tell how scalars follow the numbers of a case: derivatives, shares of their variance, or the scatter of parts."""
    check_targets(csv, plot, case, overwrite=overwrite)
    if (sobol is not None) + (tolerances is not None) > 1:
        raise refuse("--sobol", "--sobol and --tolerance", "one of them", "they are two questions")
    if (tolerances is not None) == (keys is not None):
        given = "both --to and --tolerance" if keys else "neither --to nor --tolerance"
        raise refuse("sensitivity", given, "--to KEY, or --tolerance KEY=±SPEC")
    _refuse_ignored_option("--count", count, "--tolerance", wanted=tolerances is not None)
    _refuse_ignored_option("--seed", seed, "--sobol or --tolerance", wanted=tolerances is not None or sobol is not None)
    _refuse_ignored_option("--relative-step", relative_step, "derivatives", wanted=tolerances is None and sobol is None)
    asked = _StudyOptions(
        case, overrides, names, lowest, highest, within, option="--of", workers=workers, allow_large=allow_large
    )
    if tolerances is not None:
        answer, ended = _scatter(asked, tolerances, 100 if count is None else count, seed or 0, workers)
    elif sobol is not None:
        answer, ended = _shares(asked, keys or [], sobol, seed or 0, workers)
    else:
        answer, ended = _derivatives_studies(
            asked, keys or [], 0.01 if relative_step is None else relative_step, workers
        )
    write_answer(answer, csv, plot, ended, overwrite=overwrite, as_json=as_json)
    return ended


def _refuse_ignored_option(option: str, given: object, belongs: str, *, wanted: bool) -> None:
    """Raise an error for an option without effect."""
    if given is not None and not wanted:
        raise refuse(option, str(given), f"{option} with {belongs} only", "it would be ignored", "leave it out")


class _StudyOptions:
    """Case and the options of a study."""

    def __init__(
        self, path: Path, overrides: Sequence[str] | None, names: Sequence[str],
        lowest: str | None, highest: str | None, within: str, *, option: str, workers: int, allow_large: bool,
    ) -> None:  # fmt: skip
        self.file, self.fixed = CaseFile.open(path), tuple(overrides or ())
        self.case = self.file.read(self.fixed)
        warn_ignored_keys(self.fixed, self.case)
        self.names = tuple(dict.fromkeys(names))
        of_limits = any(name.startswith("limits.") for name in names)
        for end, given in (("--lowest", lowest), ("--highest", highest)):
            _refuse_ignored_option(end, given, "limits.NAME", wanted=of_limits)
        self.search = search_range(self.case, lowest, highest, within)
        check_names(self.case, self.names, option)
        if not allow_large and any(frequency_number(name) is None for name in names):
            check_case_resources(self.case, together=workers)

    def initial_quantities(self, count: int) -> dict[str, Quantity]:
        """Return the requested quantities of the unchanged case; unknown names raise an error."""
        try:
            return compute_quantities(self.case, self.names, self.search, count)
        except RunFailedError as failure:
            reraise_interrupt(failure.status)
            raise

    @contextmanager
    def evaluators(self, count: int, workers: int, names: Sequence[str] | None = None) -> Generator[Runs]:
        """Yield the function that evaluates variants, with a progress display."""
        asked = self.names if names is None else names
        with (
            show_count(count if asked else 0, "variants") as shown,
            study_evaluators(
                self.file, self.fixed, asked, self.search, workers=workers, runs=count, advance=shown
            ) as runs,
        ):
            yield runs


def search_range(case: Case, lowest: str | None, highest: str | None, within: str) -> Search:
    """Return the search range of limits; from half to twice the case's speed by default."""
    low, high = speed_range(lowest, highest, 2, case.speed, case.turns, most=2.0)
    return Search(low, high, parse_speed_tolerance("--within", within, case.turns))


def _derivatives_studies(
    asked: _StudyOptions, keys: list[str], relative_step: float, workers: int
) -> tuple[StudyAnswer, Status]:
    responses = [name for name in asked.names if not frequency_number(name)]
    get_numbers(asked.case, keys)
    count = 1 + len(STEP_OFFSETS) * len(keys)
    asked.initial_quantities(count)
    with asked.evaluators(count, workers, responses) as runs:
        kept = InterruptibleRuns(runs)
        found = sensitivities(asked.file, asked.fixed, asked.names, keys, kept, relative_step=relative_step)

    def draw() -> Figure:
        from flexcam.plotting.study_curves import bars_figure

        known = [one for one in found if not math.isnan(one.logarithmic)]
        groups = {name: {one.by.key: one.logarithmic for one in known if one.scalar == name} for name in asked.names}
        return bars_figure(groups, "percent per percent")

    return (derivative_output(found), draw), kept.status


def _shares(asked: _StudyOptions, keys: list[str], count: int, seed: int, workers: int) -> tuple[StudyAnswer, Status]:
    variables = variables_of(asked.case, keys, "--to")
    check_count(count)
    asked.initial_quantities(count)
    low, high = (np.array([getattr(one, end) for one in variables]) for end in ("low", "high"))
    with asked.evaluators(count * (len(variables) + 2), workers) as runs:
        kept = InterruptibleRuns(runs)
        points = PointEvaluator(asked.case, variables, kept)

        def values(parts: FloatArray) -> FloatArray:
            rows = points.rows(low + parts * (high - low))
            if kept.is_interrupted and kept.done < _MIN_BASE_POINTS * (len(variables) + 2):
                raise KeyboardInterrupt  # a single base point gives no indices
            return np.column_stack([column(rows, name) for name in asked.names])

        found = sobol_indices(values, len(variables), count, seed=seed)

    def draw() -> Figure:
        from flexcam.plotting.study_curves import bars_figure

        keyed = [one.key for one in variables]
        pairs = list(zip(asked.names, found, strict=True))
        groups = {name: dict(zip(keyed, one.total.tolist(), strict=True)) for name, one in pairs}
        return bars_figure(
            groups, "share of the variance, with others", {name: one.total_interval for name, one in pairs}
        )

    return (sobol_output(asked.names, variables, found), draw), kept.status


_MIN_BASE_POINTS = 2
"""Minimum number of base points for shares of a variance."""


def _scatter(
    asked: _StudyOptions, tolerances: list[str], count: int, seed: int, workers: int
) -> tuple[StudyAnswer, Status]:
    scatters = parse_scatters(asked.case, tolerances)
    parts = sample_parts(scatters, count, seed)
    middle = asked.initial_quantities(count)
    variables = tuple(Variable(one.key, one.middle - one.half, one.middle + one.half) for one in scatters)
    with asked.evaluators(count, workers) as runs:
        kept = InterruptibleRuns(runs)
        every = PointEvaluator(asked.case, variables, kept).rows(parts)
    run = [row.status.cause is not Cause.INTERRUPTED for row in every]
    rows, parts = list(compress(every, run)), parts[run]

    def draw() -> Figure:
        from flexcam.plotting.study_curves import scatter_figure

        values = {name: column(rows, name) for name in asked.names}
        units = {name: row.units[name] for row in rows for name in row.units}
        known = {name: one[~np.isnan(one)] for name, one in values.items()}
        return scatter_figure(known, units, {name: one.value for name, one in middle.items()})

    return (scatter_output(asked.names, scatters, parts, rows, middle), draw), kept.status


@app.command(
    help_prologue="""\
flexcam optimize case.toml --vary springs.valve.stiffness=30:90kN/m --vary springs.valve.installed_force=300:900N \\
    --least springs.valve.force.largest --subject 'contacts.intake.open_on_the_lift <= 0' --set run.crank_speed=6500rpm
flexcam optimize case.toml --vary cams.intake.rise=60:90deg --least cams.intake.deceleration --most cams.intake.area
"""
)
def optimize(
    case: CasePath, *,
    vary: Annotated[list[str], Parameter("--vary", negative=(), help="A number and its interval: KEY=LOW:HIGHunit.")],
    least: Annotated[list[str] | None, Parameter("--least", negative=(), help="What is to be small.")] = None,
    most: Annotated[list[str] | None, Parameter("--most", negative=(), help="What is to be large.")] = None,
    subject: Annotated[
        list[str] | None, Parameter("--subject", negative=(), help="A bound: 'NAME <= VALUE' or 'NAME >= VALUE'.")
    ] = None,
    evaluations: Annotated[int, Parameter(help="About how many variants may be run.")] = 200,
    seed: Seed = 0, workers: WorkerCount = 1,
    lowest: Lowest = None, highest: Highest = None, within: Within = "10 rpm",
    target: Annotated[Path | None, Parameter(["-o", "--output"], help="Case file (.toml) of the best variant.")] = None,
    csv: Csv = None, plot: Picture = None,
    overrides: Overrides = None, allow_large: AllowLarge = False, overwrite: Overwrite = False, as_json: Json = False,
) -> Status:  # fmt: skip
    """Find the best variant of a case within bounds; of two goals, those of which none is better in both."""
    check_distinct_files({"--output": target, "--csv": csv, "--plot": plot}, [case])
    check_figure_path(plot, overwrite)
    for path in (csv, target):
        if path is not None:
            check_writable("output", path, overwrite=overwrite)
    if target is not None and target.suffix != ".toml":
        raise refuse("--output", str(target), "a name that ends in .toml", "it is a case file")
    goals = (*(Goal(name) for name in least or ()), *(Goal(name, most=True) for name in most or ()))
    if len(goals) not in (1, 2):
        raise refuse("goals", f"{len(goals)} of --least and --most", "one, or two for a front")
    if len({goal.name for goal in goals}) < len(goals):
        why = "of one quantity there is no front: every variant would be on it"
        raise refuse("--least, --most", f"{goals[0].name} twice", "two different quantities", why, "leave one out")
    bounds = parse_constraints(subject or ())
    names = [*(goal.name for goal in goals), *(bound.name for bound in bounds)]
    options = "--least, --most or --subject"
    asked = _StudyOptions(
        case, overrides, names, lowest, highest, within, option=options, workers=workers, allow_large=allow_large
    )
    variables = variables_of(asked.case, vary, "--vary")
    with suppress(RunFailedError):  # a case that fails may have better variants
        asked.initial_quantities(evaluations)
    with asked.evaluators(evaluations, workers) as runs:
        points = PointEvaluator(asked.case, variables, runs)
        search = study_optimize if len(goals) == 1 else find_pareto_front
        design = OptimizationProblem(points, goals, bounds)
        found = search(design, evaluations=evaluations, seed=seed)
    best = found.best
    written: list[Path] = []
    if target is not None and best is not None:
        _write_best(asked, points.overrides(found.points[best]), target, overwrite=overwrite)
        written.append(target)
    one = len(goals) == 1
    told = optimum_output(design, found) if one else front_output(design, found)
    ended = _interrupted_status(len(found.rows), evaluations) if found.stopped else Status()
    drawn = told, lambda: _search_figure(design, found)
    write_answer(drawn, csv, plot, ended, overwrite=overwrite, as_json=as_json, written=written)
    if not ended.ok:
        return ended
    return ended if best is not None else _NOTHING


def _interrupted_status(done: int, evaluations: int) -> Status:
    """Return the status of an interrupted search; its evaluations are printed and written."""
    text = f"stopped by the user after {done} of about {evaluations} variants; what is told is the best of these"
    return Status(Cause.INTERRUPTED, text, "the same command with the same --seed finds these again, and goes on")


def _search_figure(design: OptimizationProblem, found: Evaluations) -> Figure:
    """Return the figure of a search: progress of one goal, or the Pareto front of two."""
    from flexcam.plotting.study_curves import front_figure, progress_figure

    inside = is_feasible(found.violations)
    signs = np.array([-1.0 if goal.most else 1.0 for goal in design.goals])
    labels = [f"{goal.name}, {design.unit(goal.name, found.rows)}".rstrip(", ") for goal in design.goals]
    if len(design.goals) == 1:
        best = np.array(goal_history(found))
        return progress_figure(signs[0] * found.costs[:, 0], inside, signs[0] * best, labels[0])
    return front_figure(found.costs * signs, inside, pareto_indices(found), (labels[0], labels[1]))


_NOTHING = Status(
    Cause.TOLERANCE, "no variant that was evaluated is within all bounds", "widen the intervals, or loosen a bound"
)


def _write_best(asked: _StudyOptions, best: Sequence[str], target: Path, *, overwrite: bool) -> None:
    case = asked.file.read((*asked.fixed, *best))
    told = (f"The best variant of {asked.file.path.name}:", *(f"  --set {one}" for one in (*asked.fixed, *best)))
    write_text(target, resolved_case_text(case, target, told), overwrite=overwrite)
