"""Command that relates results to the values of a case: sensitivity, with derivatives, Sobol indices and tolerances."""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import compress
from typing import Annotated

import numpy as np
from cyclopts import Group, Parameter
from rich.table import Table

from flexcam import plotting
from flexcam.analysis.natural_modes import modes
from flexcam.case.case import Case
from flexcam.cli import app as cli
from flexcam.cli.study_options import Highest, LimitAccuracy, Lowest, StudyOptions, WorkerCount
from flexcam.core import FloatArray
from flexcam.core.errors import refuse
from flexcam.dynamics import Cause
from flexcam.report.terminal import format_csv, format_number, plain_table
from flexcam.studies import sensitivity as studies
from flexcam.studies.plan import check_power_of_two
from flexcam.studies.quantities import frequency_number
from flexcam.studies.sensitivity import STEP_OFFSETS, Method, Sensitivity
from flexcam.studies.tolerance_analysis import QUANTILES, parse_scatters, sample_parts, scalar_distribution
from flexcam.studies.variables import InterruptibleRuns, PointEvaluator, Variable, column, variables_of

_NO_EFFECT = 1e-9  # relative change of a result per relative change of a value that is rounding
_MIN_BASE_POINTS = 2  # for shares of a variance
_DERIVATIVES = Group("Derivatives or Sobol indices", sort_key=1)
_TOLERANCES = Group("Tolerances of parts", sort_key=1)


@cli.command("""\
flexcam sensitivity case.toml --of frequency.1 --to springs.valve.stiffness --to masses.valve.mass
flexcam sensitivity case.toml --of contacts.intake.force.largest --to springs.valve.stiffness --to run.crank_speed
flexcam sensitivity case.toml --of frequency.1 --to springs.valve.stiffness=30:60kN/m --to masses.valve.mass=80:100g --sobol 256
flexcam sensitivity case.toml --of limits.loss_of_contact --tolerance springs.valve.stiffness=±5% --count 100 --plot scatter.svg
""")  # noqa: E501 - a command to a line
def sensitivity(
    case: cli.CaseFile, *,
    names: Annotated[list[str], Parameter(
        "--of", help="Result: a scalar of a run, a natural frequency, counted from the lowest above zero "
        "(frequency.1), or a speed limit (limits.loss_of_contact). Repeatable.")],
    keys: Annotated[list[str] | None, Parameter(
        "--to", group=_DERIVATIVES, help="Value of the case: KEY; with --sobol KEY=LOW:HIGHunit. Repeatable.")] = None,
    method: Annotated[Method | None, Parameter(
        group=_DERIVATIVES, help="exact: differentiate along the motion of one run; differences: compare "
        "several runs. Default: exact where possible. Frequencies are always exact.")] = None,
    relative_step: Annotated[float | None, Parameter(
        group=_DERIVATIVES, help="Step of differences, relative to the value; 0.01 by default.")] = None,
    sobol: Annotated[int | None, Parameter(
        "--sobol", group=_DERIVATIVES, help="Sobol indices from this many base points, a power of 2.")] = None,
    tolerances: Annotated[list[str] | None, Parameter(
        "--tolerance", group=_TOLERANCES, help="Tolerance of a part: KEY=±2%, KEY=±0.05mm, or "
        "KEY=normal:±2%. Repeatable.")] = None,
    count: Annotated[int | None, Parameter(
        "--count", group=_TOLERANCES, help="Number of samples; 100 by default.")] = None,
    seed: Annotated[int | None, Parameter(help="Random seed of --sobol and --tolerance; 0 by default.")] = None,
    workers: WorkerCount = 1, lowest: Lowest = None, highest: Highest = None, accuracy: LimitAccuracy = "10 rpm",
    csv: cli.Csv = None, plot: cli.Picture = None, overrides: cli.Overrides = None, allow_large: cli.AllowLarge = False,
    overwrite: cli.Overwrite = False, as_json: cli.Json = False,
) -> cli.CommandOutput:  # fmt: skip
    """Compute how results depend on values of the case: derivatives, Sobol indices, or the effect of tolerances.

    Use --to to see which value matters most, --sobol for large ranges and interactions, --tolerance for the scatter of
    manufactured parts.
    """
    cli.check_targets(csv, plot, case, overwrite=overwrite)
    if sobol is not None and tolerances is not None:
        raise refuse("--sobol", "--sobol and --tolerance", "one of them", "they are different studies")
    if (tolerances is not None) == (keys is not None):
        given = "both --to and --tolerance" if keys else "neither --to nor --tolerance"
        raise refuse("sensitivity", given, "--to KEY, or --tolerance KEY=±SPEC")
    derivatives = tolerances is None and sobol is None
    cli.refuse_without("--tolerance", {"--count": count}, present=tolerances is not None)
    cli.refuse_without("--sobol or --tolerance", {"--seed": seed}, present=not derivatives)
    cli.refuse_without("derivatives", {"--relative-step": relative_step, "--method": method}, present=derivatives)
    cli.refuse_without("differences", {"--relative-step": relative_step}, present=method != "exact")
    asked = StudyOptions(
        case, overrides, names, lowest, highest, accuracy, option="--of", workers=workers, allow_large=allow_large
    )
    if tolerances is not None:
        return _tolerance_analysis(asked, tolerances, 100 if count is None else count, seed or 0)
    if sobol is not None:
        return _sobol_indices(asked, keys or [], sobol, seed or 0)
    return _derivatives(asked, keys or [], 0.01 if relative_step is None else relative_step, method)


def _derivatives(
    asked: StudyOptions, keys: list[str], relative_step: float, method: Method | None
) -> cli.CommandOutput:
    if interval := next((key for key in keys if "=" in key), None):
        key = interval.partition("=")[0]
        why, remedy = "only --sobol has intervals", "add --sobol, or give the key alone"
        raise refuse("--to", repr(interval), repr(key), why, remedy)
    exact = studies.exact_names(asked.case, asked.names, method)
    responses = [name for name in asked.names if not frequency_number(name) and name not in exact]
    studies.get_numbers(asked.case, keys)
    count = 1 + len(STEP_OFFSETS) * len(keys)
    if responses:
        asked.initial_quantities(count)
    with asked.evaluators(count, responses) as runs:
        kept = InterruptibleRuns(runs)
        found = studies.sensitivities(
            asked.file, asked.fixed, asked.names, keys, kept, relative_step=relative_step, method=method
        )
    names = list(dict.fromkeys(one.scalar for one in found))
    tables = [_derivative_table(name, [one for one in found if one.scalar == name]) for name in names]
    words = [f"{one.scalar} with respect to {one.by.key}: {one.note}" for one in found if one.note]
    still = [(one.scalar, one.by.key) for one in found if _is_analytic(one) and abs(one.logarithmic) < _NO_EFFECT]
    words += [
        f"{name} does not depend on {', '.join(key for other, key in still if other == name)}"
        for name in dict.fromkeys(name for name, _ in still)
    ]
    words += _name_modes(asked.case, names)
    if exact and asked.case.record.run.integrator is None:
        words.append(
            "Exact derivatives exist only with Newmark's method; the values above come from such a run, "
            "and those of flexcam run may differ slightly."
        )
    rows = [
        {
            "scalar": one.scalar, "unit": one.unit, "value": one.value,
            "key": one.by.key, "key_unit": one.by.unit, "key_value": one.by.value,
            "derivative": one.derivative, "error": one.error, "logarithmic": one.logarithmic,
            "analytic": _is_analytic(one), "smooth": one.smooth, "note": one.note,
        }
        for one in found
    ]  # fmt: skip
    head = ("scalar", "unit", "value", "key", "key_unit", "key_value", "derivative", "error", "logarithmic", "smooth")
    table = [[math.nan if row[name] is None else row[name] for name in head] for row in rows]
    csv = format_csv([name.replace("_", " ") for name in head], table)
    known = [one for one in found if not math.isnan(one.logarithmic)]
    bars = {name: {one.by.key: one.logarithmic for one in known if one.scalar == name} for name in names}
    return cli.CommandOutput(
        [*tables, *words], {"derivatives": rows}, csv, status=kept.status,
        draw=lambda: plotting.histories.bars_figure(bars, "percent per percent"),
    )  # fmt: skip


def _name_modes(case: Case, names: Sequence[str]) -> list[str]:
    """Return sentences that name the modes of frequencies, such as ``frequency.1``."""
    if not any(map(frequency_number, names)):
        return []
    found = modes(case)
    numbers = {name: found.modes.rigid + number - 1 for name in names if (number := frequency_number(name))}
    moves = "; ".join(f"{name}: {found.words(number)}" for name, number in numbers.items())
    return [f"Frequencies are those with all contacts open. {moves}"]


def _is_analytic(one: Sensitivity) -> bool:
    return one.error is None and not math.isnan(one.derivative)


def _derivative_table(name: str, found: Sequence[Sensitivity]) -> Table:
    ordered = sorted(found, key=lambda one: -abs(one.logarithmic) if not math.isnan(one.logarithmic) else math.inf)
    unit = "" if found[0].unit == "1" else found[0].unit
    rows = [
        (
            one.by.key,
            f"{format_number(one.by.value)} {one.by.unit}".strip(),
            f"{format_number(one.derivative)} {unit}{f' per {one.by.unit}' if one.by.unit else ''}".strip(),
            "exact" if _is_analytic(one) else format_number(math.nan if one.error is None else one.error, 2),
            "-" if math.isnan(one.logarithmic) else f"{one.logarithmic:+.4f}",
            "" if one.smooth else "unknown" if math.isnan(one.derivative)
            else "equal frequencies" if one.error is None else "not smooth",
        )
        for one in ordered
    ]  # fmt: skip
    title = f"{name} = {format_number(found[0].value)} {unit}".rstrip()
    return plain_table(title, ("key", "value", "derivative", "error of derivative", "% per %", ""), rows)


def _sobol_indices(asked: StudyOptions, keys: list[str], count: int, seed: int) -> cli.CommandOutput:
    variables = variables_of(asked.case, keys, "--to")
    check_power_of_two("--sobol", count, 2)
    asked.initial_quantities(count)
    low, high = (np.array([getattr(one, end) for one in variables]) for end in ("low", "high"))
    with asked.evaluators(count * (len(variables) + 2)) as runs:
        kept = InterruptibleRuns(runs)
        points = PointEvaluator(asked.case, variables, kept)

        def values(parts: FloatArray) -> FloatArray:
            rows = points.rows(low + parts * (high - low))
            if kept.is_interrupted and kept.done < _MIN_BASE_POINTS * (len(variables) + 2):
                raise KeyboardInterrupt  # a single base point gives no indices
            return np.column_stack([column(rows, name) for name in asked.names])

        found = dict(zip(asked.names, studies.sobol_indices(values, len(variables), count, seed=seed), strict=True))
    words = [
        f"{name}: {one.used} of {one.asked} base points are used; others failed, or exceed a power of 2"
        for name, one in found.items()
        if one.used < one.asked
    ]
    words += [f"{name} depends on none of these values" for name, one in found.items() if not one.variance]
    words += _name_modes(asked.case, asked.names)
    intervals = {by.key: f"{by.low:g} to {by.high:g} {by.unit}" for by in variables}
    rows = [
        (name, key, float(one.first[i]), *one.first_interval[:, i].tolist(), float(one.total[i]),
         *one.total_interval[:, i].tolist())
        for name, one in found.items()
        for i, key in enumerate(intervals)
    ]  # fmt: skip
    tables = [
        plain_table(
            f"Sobol indices of {name} (standard deviation {format_number(math.sqrt(one.variance))})",
            ("key", "interval", "first order", "95 %", "total", "95 %"),
            [(key, intervals[key], f"{a:.3f}", f"{b:.3f} to {c:.3f}", f"{d:.3f}", f"{e:.3f} to {f:.3f}")
             for scalar, key, a, b, c, d, e, f in rows if scalar == name],
        )
        for name, one in found.items()
    ]  # fmt: skip
    head = ("scalar", "key", "first", "first_low", "first_high", "total", "total_low", "total_high")
    json = {
        name: {
            "variance": one.variance, "used": one.used, "asked": one.asked,
            "indices": [dict(zip(head[1:], row[1:], strict=True)) for row in rows if row[0] == name],
        }
        for name, one in found.items()
    }  # fmt: skip
    groups = {name: dict(zip(intervals, one.total.tolist(), strict=True)) for name, one in found.items()}
    ends = {name: one.total_interval for name, one in found.items()}
    return cli.CommandOutput(
        [*tables, *words], {"sobol": json}, format_csv(head, rows), status=kept.status,
        draw=lambda: plotting.histories.bars_figure(groups, "share of the variance, total", ends),
    )  # fmt: skip


def _tolerance_analysis(asked: StudyOptions, tolerances: list[str], count: int, seed: int) -> cli.CommandOutput:
    scatters = parse_scatters(asked.case, tolerances)
    parts = sample_parts(scatters, count, seed)
    initial = asked.initial_quantities(count)
    variables = tuple(Variable(one.key, one.middle - one.half, one.middle + one.half) for one in scatters)
    with asked.evaluators(count) as runs:
        kept = InterruptibleRuns(runs)
        every = PointEvaluator(asked.case, variables, kept).rows(parts)
    run = [row.status.cause is not Cause.INTERRUPTED for row in every]
    rows, parts = list(compress(every, run)), parts[run]
    names = asked.names
    values = np.column_stack([column(rows, name) for name in names])
    known_units = [{name: one.unit for name, one in initial.items()}, *(row.units for row in rows)]
    units = {name: next((one[name] for one in known_units if name in one), "") for name in names}
    nominal = {name: initial[name].value if name in initial else math.nan for name in names}
    found = {name: scalar_distribution(parts, values[:, i]) for i, name in enumerate(names)}
    summary = [
        (name, units[name], nominal[name], one.mean, format_number(one.deviation, 4),
         *(one.quantiles[part] for part in QUANTILES), str(one.missing))
        for name, one in found.items()
    ]  # fmt: skip
    head = ("scalar", "unit", "nominal", "mean", "std", *(f"{part:.0%}" for part in QUANTILES), "n/a")
    ranks = [
        (one.key, *(format_number(float(found[name].ranks[i]), 3) for name in names)) for i, one in enumerate(scatters)
    ]
    tables = [
        plain_table(f"Distribution over {len(parts)} samples", head, summary),
        plain_table("Rank correlation with each parameter", ("parameter", *names), ranks),
    ]
    words = [
        f"{name}: {one.missing} samples have no value: the run failed, or the range of the search has no limit"
        for name, one in found.items()
        if one.missing
    ]
    words += _name_modes(asked.case, names)
    keys = [one.key for one in scatters]
    table = np.column_stack([parts, values]).tolist()
    body = [(*numbers, row.status.cause) for numbers, row in zip(table, rows, strict=True)]
    json = {
        name: {
            "unit": units[name], "value": nominal[name], "mean": one.mean, "std": one.deviation,
            "missing": one.missing, "count": len(parts),
            "quantiles": {f"{part:g}": value for part, value in one.quantiles.items()},
            "rank_correlation": dict(zip(keys, one.ranks, strict=True)),
        }
        for name, one in found.items()
    }  # fmt: skip
    known = {name: one[~np.isnan(one)] for name, one in zip(names, values.T, strict=True)}
    middle = {name: one.value for name, one in initial.items()}
    return cli.CommandOutput(
        [*tables, *words], {"scatter": json}, format_csv((*keys, *names, "status"), body), status=kept.status,
        draw=lambda: plotting.histories.scatter_figure(known, units, middle),
    )  # fmt: skip
