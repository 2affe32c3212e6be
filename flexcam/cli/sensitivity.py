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
from flexcam.studies.sensitivity import (
    QUANTILES,
    STEP_OFFSETS,
    Method,
    Sensitivity,
    parse_scatters,
    sample_parts,
    scalar_distribution,
)
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
        "--of", help="Result: a value of a run, such as deviation.peak; a natural frequency (frequency.1 is the lowest "
        "above zero); or a speed limit (limits.loss_of_contact). Repeatable.")],
    keys: Annotated[list[str] | None, Parameter(
        "--to", group=_DERIVATIVES, help="Value of the case: KEY; with --sobol KEY=LOW:HIGHunit. Repeatable.")] = None,
    method: Annotated[Method | None, Parameter(
        group=_DERIVATIVES, help="exact: analytic derivatives from one run; differences: finite differences of "
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
        text = "both --to and --tolerance" if keys else "neither --to nor --tolerance"
        raise refuse("sensitivity", text, "--to KEY, or --tolerance KEY=±2%")
    derivatives = tolerances is None and sobol is None
    cli.refuse_without("--tolerance", {"--count": count}, present=tolerances is not None)
    cli.refuse_without("--sobol or --tolerance", {"--seed": seed}, present=not derivatives)
    cli.refuse_without("derivatives", {"--relative-step": relative_step, "--method": method}, present=derivatives)
    cli.refuse_without("differences", {"--relative-step": relative_step}, present=method != "exact")
    options = StudyOptions(
        case, overrides, names, lowest, highest, accuracy, option="--of", workers=workers, allow_large=allow_large
    )
    if tolerances is not None:
        return _tolerance_analysis(options, tolerances, 100 if count is None else count, seed or 0)
    if sobol is not None:
        return _sobol_indices(options, keys or [], sobol, seed or 0)
    return _derivatives(options, keys or [], 0.01 if relative_step is None else relative_step, method)


def _derivatives(
    options: StudyOptions, keys: list[str], relative_step: float, method: Method | None
) -> cli.CommandOutput:
    if interval := next((key for key in keys if "=" in key), None):
        key = interval.partition("=")[0]
        why, remedy = "only --sobol has intervals", "add --sobol, or give the key alone"
        raise refuse("--to", repr(interval), repr(key), why, remedy)
    exact = studies.exact_names(options.case, options.names, method)
    responses = [name for name in options.names if not frequency_number(name) and name not in exact]
    studies.get_numbers(options.case, keys)
    count = 1 + len(STEP_OFFSETS) * len(keys)
    if responses:
        options.initial_quantities(count)
    with options.evaluators(count, responses) as runs:
        interruptible = InterruptibleRuns(runs)
        results = studies.sensitivities(
            options.file, options.fixed, options.names, keys, interruptible, relative_step=relative_step, method=method
        )
    names = list(dict.fromkeys(sens.scalar for sens in results))
    tables = [_derivative_table(name, [sens for sens in results if sens.scalar == name]) for name in names]
    words = [f"{sens.scalar} with respect to {sens.by.key}: {sens.note}" for sens in results if sens.note]
    zero = [(sens.scalar, sens.by.key) for sens in results if _is_analytic(sens) and abs(sens.logarithmic) < _NO_EFFECT]
    words += [
        f"{name} does not depend on {', '.join(key for other, key in zero if other == name)}"
        for name in dict.fromkeys(name for name, _ in zero)
    ]
    words += _name_modes(options.case, names)
    if exact and options.case.record.run.integrator is None:
        words.append(
            "Exact derivatives exist only with Newmark's method; the values above come from such a run, "
            "and those of flexcam run may differ slightly."
        )
    rows = [
        {
            "scalar": sens.scalar, "unit": sens.unit, "value": sens.value,
            "key": sens.by.key, "key_unit": sens.by.unit, "key_value": sens.by.value,
            "derivative": sens.derivative, "error": sens.error, "logarithmic": sens.logarithmic,
            "analytic": _is_analytic(sens), "smooth": sens.smooth, "note": sens.note,
        }
        for sens in results
    ]  # fmt: skip
    head = ("scalar", "unit", "value", "key", "key_unit", "key_value", "derivative", "error", "logarithmic", "smooth")
    table = [[math.nan if row[name] is None else row[name] for name in head] for row in rows]
    csv = format_csv([name.replace("_", " ") for name in head], table)
    finite = [sens for sens in results if not math.isnan(sens.logarithmic)]
    bars = {name: {sens.by.key: sens.logarithmic for sens in finite if sens.scalar == name} for name in names}
    return cli.CommandOutput(
        [*tables, *words], {"derivatives": rows}, csv, status=interruptible.status,
        draw=lambda: plotting.histories.bars_figure(bars, "percent per percent"),
    )  # fmt: skip


def _name_modes(case: Case, names: Sequence[str]) -> list[str]:
    """Return sentences that name the modes of frequencies, such as ``frequency.1``."""
    if not any(map(frequency_number, names)):
        return []
    model_modes = modes(case)
    numbers = {name: model_modes.modes.rigid + number - 1 for name in names if (number := frequency_number(name))}
    moves = "; ".join(f"{name}: {model_modes.words(number)}" for name, number in numbers.items())
    return [f"Frequencies are those with all contacts open. {moves}"]


def _is_analytic(sens: Sensitivity) -> bool:
    return sens.error is None and not math.isnan(sens.derivative)


def _derivative_table(name: str, results: Sequence[Sensitivity]) -> Table:
    ordered = sorted(results, key=lambda sens: -abs(sens.logarithmic) if not math.isnan(sens.logarithmic) else math.inf)
    unit = "" if results[0].unit == "1" else results[0].unit
    rows = [
        (
            sens.by.key,
            f"{format_number(sens.by.value)} {sens.by.unit}".strip(),
            f"{format_number(sens.derivative)} {unit}{f' per {sens.by.unit}' if sens.by.unit else ''}".strip(),
            "exact" if _is_analytic(sens) else format_number(math.nan if sens.error is None else sens.error, 2),
            "-" if math.isnan(sens.logarithmic) else f"{sens.logarithmic:+.4f}",
            "" if sens.smooth else "unknown" if math.isnan(sens.derivative)
            else "equal frequencies" if frequency_number(sens.scalar) else "not smooth",
        )
        for sens in ordered
    ]  # fmt: skip
    title = f"{name} = {format_number(results[0].value)} {unit}".rstrip()
    return plain_table(title, ("key", "value", "derivative", "error of derivative", "% per %", ""), rows)


def _sobol_indices(options: StudyOptions, keys: list[str], count: int, seed: int) -> cli.CommandOutput:
    variables = variables_of(options.case, keys, "--to")
    check_power_of_two("--sobol", count, 2)
    options.initial_quantities(count)
    with options.evaluators(count * (len(variables) + 2)) as runs:
        interruptible = InterruptibleRuns(runs)
        points = PointEvaluator(options.case, variables, interruptible)

        def values(parts: FloatArray) -> FloatArray:
            rows = list(points.rows(points.at(parts)))
            if interruptible.is_interrupted and interruptible.done < _MIN_BASE_POINTS * (len(variables) + 2):
                raise KeyboardInterrupt  # a single base point gives no indices
            return np.column_stack([column(rows, name) for name in options.names])

        indices = dict(zip(options.names, studies.sobol_indices(values, len(variables), count, seed=seed), strict=True))
    words = [
        f"{name}: {sobol.used} of {sobol.asked} base points are used; others failed, or exceed a power of 2"
        for name, sobol in indices.items()
        if sobol.used < sobol.asked
    ]
    words += [f"{name} depends on none of these values" for name, sobol in indices.items() if not sobol.variance]
    words += _name_modes(options.case, options.names)
    intervals = {variable.key: f"{variable.low:g} to {variable.high:g} {variable.unit}" for variable in variables}
    rows = [
        (name, key, float(sobol.first[i]), *sobol.first_interval[:, i].tolist(), float(sobol.total[i]),
         *sobol.total_interval[:, i].tolist())
        for name, sobol in indices.items()
        for i, key in enumerate(intervals)
    ]  # fmt: skip
    tables = [
        plain_table(
            f"Sobol indices of {name} (standard deviation {format_number(math.sqrt(sobol.variance))})",
            ("key", "interval", "first order", "95 %", "total", "95 %"),
            [(key, intervals[key], f"{a:.3f}", f"{b:.3f} to {c:.3f}", f"{d:.3f}", f"{e:.3f} to {f:.3f}")
             for scalar, key, a, b, c, d, e, f in rows if scalar == name],
        )
        for name, sobol in indices.items()
    ]  # fmt: skip
    head = ("scalar", "key", "first", "first_low", "first_high", "total", "total_low", "total_high")
    json = {
        name: {
            "variance": sobol.variance, "used": sobol.used, "asked": sobol.asked,
            "indices": [dict(zip(head[1:], row[1:], strict=True)) for row in rows if row[0] == name],
        }
        for name, sobol in indices.items()
    }  # fmt: skip
    groups = {name: dict(zip(intervals, sobol.total.tolist(), strict=True)) for name, sobol in indices.items()}
    ends = {name: sobol.total_interval for name, sobol in indices.items()}
    return cli.CommandOutput(
        [*tables, *words], {"sobol": json}, format_csv(head, rows), status=interruptible.status,
        draw=lambda: plotting.histories.bars_figure(groups, "share of the variance, total", ends),
    )  # fmt: skip


def _tolerance_analysis(options: StudyOptions, tolerances: list[str], count: int, seed: int) -> cli.CommandOutput:
    scatters = parse_scatters(options.case, tolerances)
    parts = sample_parts(scatters, count, seed)
    initial = options.initial_quantities(count)
    variables = tuple(Variable(tol.key, tol.middle - tol.half, tol.middle + tol.half) for tol in scatters)
    with options.evaluators(count) as runs:
        interruptible = InterruptibleRuns(runs)
        all_rows = list(PointEvaluator(options.case, variables, interruptible).rows(parts))
    run = [row.status.cause is not Cause.INTERRUPTED for row in all_rows]
    rows, parts = list(compress(all_rows, run)), parts[run]
    names = options.names
    values = np.column_stack([column(rows, name) for name in names])
    known_units = [{name: metric.unit for name, metric in initial.items()}, *(row.units for row in rows)]
    units = {name: next((row_units[name] for row_units in known_units if name in row_units), "") for name in names}
    nominal = {name: initial[name].value if name in initial else math.nan for name in names}
    stats = {name: scalar_distribution(parts, values[:, i]) for i, name in enumerate(names)}
    summary = [
        (name, units[name], nominal[name], dist.mean, format_number(dist.deviation, 4),
         *(dist.quantiles[part] for part in QUANTILES), str(dist.missing))
        for name, dist in stats.items()
    ]  # fmt: skip
    head = ("scalar", "unit", "nominal", "mean", "std", *(f"{part:.0%}" for part in QUANTILES), "n/a")
    ranks = [
        (tol.key, *(format_number(float(stats[name].ranks[i]), 3) for name in names)) for i, tol in enumerate(scatters)
    ]
    tables = [
        plain_table(f"Distribution over {len(parts)} samples", head, summary),
        plain_table("Rank correlation with each parameter", ("parameter", *names), ranks),
    ]
    words = [
        f"{name}: {dist.missing} samples have no value: the run failed, or the range of the search has no limit"
        for name, dist in stats.items()
        if dist.missing
    ]
    words += _name_modes(options.case, names)
    keys = [tol.key for tol in scatters]
    table = np.column_stack([parts, values]).tolist()
    body = [(*numbers, row.status.cause) for numbers, row in zip(table, rows, strict=True)]
    json = {
        name: {
            "unit": units[name], "value": nominal[name], "mean": dist.mean, "std": dist.deviation,
            "missing": dist.missing, "count": len(parts),
            "quantiles": {f"{part:g}": value for part, value in dist.quantiles.items()},
            "rank_correlation": dict(zip(keys, dist.ranks, strict=True)),
        }
        for name, dist in stats.items()
    }  # fmt: skip
    finite = {name: samples[~np.isnan(samples)] for name, samples in zip(names, values.T, strict=True)}
    middle = {name: metric.value for name, metric in initial.items()}
    return cli.CommandOutput(
        [*tables, *words], {"scatter": json}, format_csv((*keys, *names, "status"), body), status=interruptible.status,
        draw=lambda: plotting.histories.scatter_figure(finite, units, middle),
    )  # fmt: skip
