"""Commands that compare models: compare, trade."""

from __future__ import annotations

from dataclasses import asdict
from pathlib import Path
from typing import Annotated

import numpy as np
from cyclopts import Group, Parameter

from flexcam import plotting
from flexcam.analysis import comparison
from flexcam.analysis.model_choice import evaluate_ladder, model_ladder
from flexcam.analysis.preparation import prepare, scalar_probe
from flexcam.analysis.run import run as run_case
from flexcam.case.case import Case
from flexcam.cli import app as cli
from flexcam.cli.sources import Source
from flexcam.core.errors import collect_errors, positive, refuse, suggest_name
from flexcam.core.units import RPM, parse, shaft_name
from flexcam.dynamics import Response, reraise_interrupt
from flexcam.report import fidelity_tables as fidelity
from flexcam.report.tables import comparison_table, describe_comparison, describe_contacts
from flexcam.report.terminal import format_csv, format_decimals, plain_table, show_count

_SPEEDS = Group("Contact forces over speed", sort_key=1)


@cli.command("""\
flexcam compare case.toml
flexcam compare case.toml --probe valve --set run.speed=4000rpm
flexcam compare case.toml --against sdof
flexcam compare one.vtkhdf --against other.vtkhdf
flexcam compare case.toml --lowest 2000rpm --highest 7000rpm --count 6 --plot forces.svg
""")
def compare(
    case: Annotated[Path, Parameter(help="Case file (.toml), or result file (.vtkhdf) with --against.")], *,
    probe: cli.Probe = None,
    against: Annotated[str | None, Parameter(
        help="Model of the same case, such as sdof (flexcam trade lists the models), or another case or result; the "
        "rigid model by default.")] = None,
    lowest: Annotated[cli.Lowest, Parameter(group=_SPEEDS)] = None,
    highest: Annotated[cli.Highest, Parameter(group=_SPEEDS)] = None,
    count: Annotated[int | None, Parameter(
        group=_SPEEDS, help="Number of speeds, evenly spaced; 8 by default.")] = None,
    tolerance: Annotated[str | None, Parameter(
        group=_SPEEDS, help="Two models count as different if their minimum or maximum contact forces differ by more "
        "than this share of the larger of the two maximum forces; 5 % by default.")] = None,
    contact: Annotated[str | None, Parameter(group=_SPEEDS, help="Cam contact, if a case has several.")] = None,
    plot: Annotated[Path | None, Parameter(
        group=_SPEEDS, help="Also draw the forces over speed (.svg, .png or .pdf).")] = None,
    overrides: cli.Overrides = None, overwrite: cli.Overwrite = False, as_json: cli.Json = False,
) -> cli.CommandOutput:  # fmt: skip
    """Compare the flexible model with the rigid one, or any two models, cases or results.

    With --lowest, --highest or --plot it compares the contact forces of three models over a range of speeds: rigid,
    flexible with a contact that never opens (bilateral), and flexible with one that can open (unilateral). It prints
    the speed above which the models differ.
    Speeds are those of the crankshaft if the case gives crank_speed, otherwise those of the camshaft.
    """
    over_speed = any(option is not None for option in (lowest, highest, plot))
    of_speeds = {"--count": count, "--tolerance": tolerance, "--contact": contact}
    cli.refuse_without("--lowest, --highest or --plot", of_speeds, present=over_speed)
    if over_speed:
        why = "not allowed with --lowest, --highest or --plot, which compare all three models"
        cli.refuse_options({"--probe": probe, "--against": against}, why)
        part = positive("--tolerance", parse(tolerance or "5 %", "number", "--tolerance"), "1", zero=True)
        if part >= 1.0:
            raise refuse("--tolerance", tolerance, "a share below 1, such as 0.05 or '5 %'", "", "write it as in '5 %'")
        read = cli.load_beams(case, overrides)
        speeds = cli.spaced_speeds(lowest, highest, 8 if count is None else count, read)
        cli.check_targets(None, plot, overwrite=overwrite)
        cli.warn_input(read)
        return _compare_over_speed(read, speeds, part, contact)
    if against is not None:
        return _compare_pair(case, against, probe, overrides)
    if Source(case).is_result:
        remedy = "add --against with another result or a case, or give the case file of this result"
        raise refuse("compare", str(case), "a case file (.toml), or a result with --against", "", remedy)
    read = cli.load_beams(case, overrides)
    at = scalar_probe(prepare(read), probe)
    cli.warn_input(read)
    result = comparison.deviation(read, at)
    published = any(contact.model == "published-load" for contact in read.record.contacts.values())
    mode_hz = comparison.excited_mode(read) if published else None
    json = {**_comparison_json(result), "loaded_mode_hz": mode_hz}
    parts = [comparison_table(result, read.turns), *describe_comparison(result, mode_hz), *describe_contacts(read)]
    return cli.CommandOutput(parts, json, status=result.status)


def _compare_pair(case: Path, against: str, probe: str | None, overrides: cli.Overrides) -> cli.CommandOutput:
    first, second = (Source(path, tuple(overrides or ())) for path in (case, Path(against)))
    if overrides and first.is_result and second.is_result:
        why = "results cannot be changed"
        raise refuse("--set", overrides[0], "--set only with a case", why, "give the case, or leave --set out")
    if not first.is_result:
        cli.warn_input(first.case)
    run = first.response if first.is_result else _run(first.case)
    at = scalar_probe(first.ready, probe)
    if second.is_result:
        reference = second.response
    elif second.path.suffix == ".toml":
        reference = _run(second.case)
    else:
        models = {} if first.is_result else {model.name: model.case for model in model_ladder(first.case)}
        if against not in models:
            allowed = f"a case, a result, or one of {', '.join(models)}" if models else "a case or a result"
            raise refuse("--against", repr(against), allowed, "", suggest_name(against, list(models)))
        reference = _run(models[against])
    pairs = (case.stem, second.path.stem), (case.name, second.path.name), (str(case), against)
    names = next((pair for pair in pairs if pair[0] != pair[1]), pairs[0])
    angle, duration = (float(series[-1] - series[0]) for series in (run.angle, run.time))
    rpm = angle / duration / RPM if duration > 0.0 else 0.0
    result = comparison.compare_responses(run, reference, at, rpm, names)
    json = {**_comparison_json(result), "compared": list(result.names)}
    common = comparison.describe_common_part(run, reference, names)
    parts = [comparison_table(result, first.case.turns), *describe_comparison(result, None), *common]
    return cli.CommandOutput(parts, json, status=result.status)


def _comparison_json(result: comparison.Comparison) -> dict[str, object]:
    return {
        "status": result.status.cause, "probe": result.probe, "speed_rpm": result.speed_rpm,
        "peak_deviation": result.peak_deviation, "rms_deviation": result.rms_deviation,
        "peak_acceleration_ratio": result.peak_acceleration_ratio, "residual_vibration": result.residual,
        "deviations": [{**asdict(row), "of_rigid": row.relative_peak} for row in result.deviations],
    }  # fmt: skip


def _run(case: Case) -> Response:
    response = run_case(case)
    reraise_interrupt(response.status)
    return response


def _compare_over_speed(case: Case, speeds: list[float], tolerance: float, contact: str | None) -> cli.CommandOutput:
    scale, shaft = case.turns, shaft_name(case.turns)
    with show_count(len(speeds), "speeds") as advance:
        points = comparison.compare_models_over_speed(case, speeds, contact=contact, advance=advance)
    words, divergences = list[str](), dict[str, float | None]()
    for first, second in (("rigid", "bilateral"), ("bilateral", "unilateral")):
        rpm = comparison.divergence_speed(points, first, second, tolerance)
        when = "at none of these speeds"
        if rpm is not None:
            begin, end = ("already at the lowest speed,", "") if rpm == points[0].rpm else ("from", " upward")
            when = f"{begin} {scale * rpm:.6g} {shaft} rpm{end}"
        words.append(f"The {first} and {second} forces differ by more than {tolerance:.0%} {when}.")
        divergences[f"{first}_{second}_part_rpm"] = None if rpm is None else scale * rpm
    head = (f"{shaft} rpm", *(f"{name}, N" for name in comparison.MODELS))
    rpm = np.array([scale * point.rpm for point in points])
    of_model = {name: [point.forces[name] for point in points] for name in comparison.MODELS}
    forces = {name: [f and (f.least, f.largest) for f in found] for name, found in of_model.items()}
    cells = [
        [" to ".join(format_decimals(end, 0) for end in pair) if pair else "did not finish" for pair in pairs]
        for pairs in forces.values()
    ]
    rows = zip((f"{speed:.6g}" for speed in rpm), *cells, strict=True)
    ranges = {name: np.array([pair or (np.nan, np.nan) for pair in pairs]).T for name, pairs in forces.items()}
    title = "Min and max contact force while the lift is above the ramp (or lash) plus 5 % of the lift"
    return cli.CommandOutput(
        [plain_table(title, head, rows), " ".join(words)],
        {"shaft": shaft, "rpm": rpm, "forces_n": forces, **divergences, "tolerance": tolerance}, title=case.title,
        draw=lambda: plotting.spectra.force_figure(rpm, ranges, shaft),
    )  # fmt: skip


@cli.command("""\
flexcam trade cases/tayeb/model-3-shm.toml
flexcam trade case.toml --csv trade.csv --plot trade.svg --repeats 5
""")
def trade(
    case: cli.CaseFile, *,
    probe: cli.Probe = None,
    repeats: Annotated[int, Parameter(help="Runs of every model; their median time is shown.")] = 3,
    csv: cli.Csv = None, plot: cli.Picture = None, overrides: cli.Overrides = None, overwrite: cli.Overwrite = False,
    as_json: cli.Json = False,
) -> cli.CommandOutput:  # fmt: skip
    """Compare error and run time of all models of a case, from rigid to flexible.

    Use it to choose the settings in [fidelity] and the number of elements. The reference is a run of the flexible
    model with more elements and steps; the last row is this reference with its estimated error. Models: rigid; sdof
    (one mass); chain 3 (a chain of three masses); modes N (the beams, reduced to N modes); beams N (N elements per
    span of a member); beams (the case itself); beams x2 (twice as many elements as the case).
    """
    read, _ = collect_errors(
        lambda: cli.load_case(case, overrides),
        lambda: cli.check_number("--repeats", repeats),
        lambda: cli.check_targets(csv, plot, case, overwrite=overwrite),
    )
    at = scalar_probe(prepare(read), probe)
    cli.warn_input(read)
    with show_count(None, "models") as advance:
        reference, models = evaluate_ladder(read, at, repeats=repeats, advance=advance)
    warnings, errors = fidelity.trade_warnings(reference, models), fidelity.reference_errors(reference)
    data = {"steps_per_revolution": reference.steps, "errors": errors, "sizes": reference.size}
    head = ("model", "steps_per_revolution", "unknowns", "work", "cpu_s", *errors, "best", "status")
    rows = [
        (model.rung, model.steps, model.unknowns, model.work, model.seconds,
         *(model.errors.get(kind, "") for kind in errors), model.best, model.status.cause)
        for model in models
    ]  # fmt: skip
    return cli.CommandOutput(
        [fidelity.trade_table(reference, models), fidelity.trade_legend(reference), *warnings],
        {"reference": data, "rungs": [fidelity.evaluation_json(model) for model in models], "warnings": warnings},
        format_csv(head, rows), title=read.title,
        draw=lambda: plotting.histories.work_precision_figure(models),
    )  # fmt: skip
