"""Command that fits values of a case to measured curves: fit."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from itertools import chain
from pathlib import Path
from typing import Annotated

import numpy as np
from cyclopts import Parameter

from flexcam import plotting
from flexcam.analysis.run import check_case_resources
from flexcam.case.reader import CaseFile as OpenCase
from flexcam.cli import app as cli
from flexcam.cli.study_options import NewCase, Vary, WorkerCount, write_variant
from flexcam.dynamics import Cause, Status
from flexcam.report.terminal import format_csv, plain_table, show_count, with_unit
from flexcam.studies.executors import open_evaluators
from flexcam.studies.fitting import Fit, Measurement, curve_row, fit_curves, read_measurement
from flexcam.studies.variables import PointEvaluator, Variable, variables_of

_TO = "Measured curves (.csv, .mf4): columns such as 'crank angle [deg]' or 'time [s]', and 'valve displacement [mm]'."


@cli.command("""\
flexcam fit case.toml --to measured.csv --vary springs.valve.stiffness=40:60kN/m --vary cams.intake.phase=100:110deg
flexcam fit case.toml --to measured.csv --vary masses.valve.mass=80:100g --noise 'valve displacement=0.005' --plot f.svg
""")
def fit(
    case: cli.CaseFile, *,
    to: Annotated[Path, Parameter(help=_TO)],
    vary: Vary,
    column: Annotated[list[str] | None, Parameter(
        "--column", help="Column to fit; all by default. Repeatable.")] = None,
    noise: Annotated[list[str] | None, Parameter(
        "--noise", help="Standard deviation of a column, in its unit: NAME=VALUE. Repeatable.")] = None,
    steps: Annotated[int, Parameter(help="Maximum number of steps of the search.")] = 50,
    workers: WorkerCount = 1, target: NewCase = None, csv: cli.Csv = None, plot: cli.Picture = None,
    overrides: cli.Overrides = None, allow_large: cli.AllowLarge = False,
    overwrite: cli.Overwrite = False, as_json: cli.Json = False,
) -> cli.CommandOutput:  # fmt: skip
    """Fit values of a case to measured curves, print 95 % confidence intervals and warn about correlated values.

    Curves over an angle are compared with the last revolution, curves over time with the whole run. Without
    --noise, the residuals of each column are divided by their standard deviation, so that a noisy column counts less.
    """
    cli.check_targets(csv, plot, case, to, overwrite=overwrite, target=target)
    cli.check_number("--steps", steps)
    file, fixed = OpenCase.open(case), tuple(overrides or ())
    read = file.read(fixed)
    cli.warn_ignored_keys(fixed, read)
    if not allow_large:
        check_case_resources(read, together=workers)
    variables, data = variables_of(read, vary, "--vary"), read_measurement(to, read, column or (), noise or ())
    cli.warn_input(read)
    with (
        show_count(None, "runs") as advance,
        open_evaluators(file, fixed, partial(curve_row, measured=data), workers=workers, advance=advance) as (runs,),
    ):
        points = PointEvaluator(read, variables, runs)
        result = fit_curves(points, data, steps=steps)
    best, title = (*fixed, *points.overrides(result.values)), f"{file.path.name}, fitted to {to.name}:"
    files = [] if target is None else write_variant(file, best, target, title, overwrite=overwrite)
    status = Status()
    if not result.converged:
        status = Status(Cause.TOLERANCE, "the search ended before it reached its tolerance", "allow more --steps")
    return replace(_fit_output(variables, data, result), files=files, status=status)


def _fit_output(variables: Sequence[Variable], measured: Measurement, result: Fit) -> cli.CommandOutput:
    keys, curves = [variable.key for variable in variables], measured.curves
    leave = "leave it out of --vary, or " if len(keys) > 1 else ""
    words = [
        f"The curves do not determine {' and '.join(keys[i] for i in group)}: "
        + ("leave some of them out of --vary" if len(group) > 1 else f"they do not depend on it; {leave}fit others")
        for group in result.undetermined
    ]
    words += [
        f"The curves hardly determine {variable.key}: its 95 % interval is wider than its --vary range, "
        f"{variable.low:g} to {variable.high:g} {variable.unit}".rstrip()
        + f"; {leave}fit more curves"
        for variable, half in zip(variables, result.intervals.tolist(), strict=True)
        if variable.high - variable.low < 2.0 * half < math.inf
    ]
    words += [
        f"{keys[i]} and {keys[j]} are correlated ({result.correlation[i, j]:+.3f}): the curves hardly distinguish them"
        for i, j in result.correlated_pairs()
    ]
    words += [
        f"{variable.key} is at an end of its --vary range; a wider range may fit better"
        for variable, x in zip(variables, result.values.tolist(), strict=True)
        if min(x - variable.low, variable.high - x) <= 1e-3 * (variable.high - variable.low)
    ]
    if result.misfit > 2.0:
        words.append(f"The residuals are {result.misfit:.2g} times the noise: the model does not describe the curves.")
    words += [
        f"Successive residuals of {curve.label} are correlated ({r:+.2f}): the model may have a systematic error; "
        "the true intervals may then be wider"
        for curve, r in zip(curves, result.serial, strict=True) if r > 3.0 / np.sqrt(len(measured.instants))
    ]  # fmt: skip
    numbers = np.array([result.start, result.values, result.intervals]).T.tolist()
    rms = np.array([*(result.rms(measured, x) for x in (result.before, result.after)), result.noise]).T.tolist()
    label, at = "time [s]", measured.instants
    if measured.over != "time":
        label, at = "cam angle [deg]", np.degrees(measured.instants)
    head = [label, *(f"{c.label} [{c.unit}], {kind}" for c in curves for kind in ("measured", "before", "after"))]
    panels = {
        f"{c.label}, {c.unit}": (c.values, old, new)
        for c, old, new in zip(curves, result.before, result.after, strict=True)
    }
    json = {
        "values": [
            {"key": variable.key, "unit": variable.unit, "before": a, "value": b, "half_width": half}
            for variable, (a, b, half) in zip(variables, numbers, strict=True)
        ],
        "curves": [
            {"curve": c.label, "unit": c.unit, "rms_before": a, "rms_after": b, "noise": size}
            for c, (a, b, size) in zip(curves, rms, strict=True)
        ],
        "correlation": result.correlation,
        "misfit": result.misfit, "runs": result.runs,
        "undetermined": [[keys[i] for i in group] for group in result.undetermined],
    }  # fmt: skip
    tables = [
        plain_table("Fitted values", ("value", "before", "after", "95 % interval, ±"),
                    [(with_unit(v.key, v.unit), *x) for v, x in zip(variables, numbers, strict=True)]),
        plain_table("Residuals, root mean square", ("curve", "before", "after", "estimated noise"),
                    [(f"{c.label}, {c.unit}", *x) for c, x in zip(curves, rms, strict=True)]),
    ]  # fmt: skip
    return cli.CommandOutput(
        [*tables, *words], json, format_csv(head, np.column_stack([at, *chain(*panels.values())]).tolist()),
        draw=lambda: plotting.histories.fit_figure(at, label, panels),
    )  # fmt: skip
