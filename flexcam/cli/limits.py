"""Command that finds speed limits: limits, with maps of limits over two values of a case."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Annotated, Literal

import numpy as np
from cyclopts import Group, Parameter
from rich.table import Table

from flexcam import plotting
from flexcam.analysis.limits import Search, find_limits
from flexcam.analysis.run_metrics import compute_margins
from flexcam.case.reader import CaseFile as OpenCase
from flexcam.cli import app as cli
from flexcam.core.errors import positive, refuse
from flexcam.core.units import shaft_name
from flexcam.report.tables import limits_json, limits_table
from flexcam.report.terminal import finite_numbers, format_csv, format_number, plain_table, show_count, with_unit
from flexcam.studies.executors import count_cores
from flexcam.studies.plan import Axis, parse_axis
from flexcam.studies.quantities import LimitMap, create_evaluator, grid_plan, limit_map, open_speed_runs
from flexcam.studies.sweep import validate_plan
from flexcam.studies.variables import InterruptibleRuns, require_units

_LEGEND = (
    "bracket: the event begins at most this much below the printed speed. persists from: the event also occurs at "
    "every higher speed examined (up to 15 % above the limit). not persistent: the event does not occur at the highest "
    "of these speeds"
)

_MAP = Group("Map over two values", sort_key=1)


@cli.command("""\
flexcam limits cases/pushrod-engine/intake.toml
flexcam limits case.toml --lowest 2000rpm --highest 9000rpm --accuracy 5rpm --json
flexcam limits case.toml --over springs.valve.stiffness=40:70:5kN/m --and masses.valve.mass=80:110:10g --plot map.svg
""")
def limits(
    case: cli.CaseFile, *,
    lowest: Annotated[str | None, Parameter(
        help="Lowest speed of the range; half the speed of the case by default.")] = None,
    highest: Annotated[str | None, Parameter(
        help="Highest speed of the range; twice the speed of the case by default.")] = None,
    accuracy: cli.Accuracy = "10 rpm",
    bounce_height: Annotated[str | None, Parameter(
        help="Minimum height of a bounce; by default the smaller of 0.1 mm and 2 % of the lift.")] = None,
    lift_deviation: Annotated[str | None, Parameter(
        help="Also find the speed at which the valve loft over the nose exceeds this.")] = None,
    low_pass: Annotated[str | None, Parameter(
        help="Also find contact loss in the cam force after a low-pass filter, such as 5kHz.")] = None,
    over: Annotated[str | None, Parameter(
        "--over", group=_MAP, help="First value: KEY=SPEC as in flexcam sweep --set.")] = None,
    beside: Annotated[str | None, Parameter("--and", group=_MAP, help="Second value: KEY=SPEC.")] = None,
    which: Annotated[list[Literal["loss_of_contact", "float", "bounce", "coil_clash", "buckling"]] | None, Parameter(
        "--limit", group=_MAP, help="Limit of the map; loss_of_contact by default. Repeatable.")] = None,
    workers: Annotated[int | None, Parameter(
        "--workers", help="Number of processes; by default one per core, or only one for a map.")] = None,
    csv: Annotated[cli.Csv, Parameter(group=_MAP)] = None,
    plot: Annotated[cli.Picture, Parameter(group=_MAP)] = None,
    overrides: cli.Overrides = None, units: cli.Units = None, overwrite: cli.Overwrite = False,
    as_json: cli.Json = False,
) -> cli.CommandOutput:  # fmt: skip
    """Find the speed limits of a valve train: contact loss, valve float, valve bounce, coil clash, buckling.

    It runs the case at speeds 5 % apart from --lowest to --highest. For each limit it bisects between the first speed
    at which the event occurs and the speed before, and examines the next three speeds. With --over and --and it maps
    the limits over two values of the case. Valve float is contact loss over the nose; valve loft is valve lift above
    that of the rigid train. Speeds are those of the crankshaft if the case gives crank_speed, otherwise those of the
    camshaft.
    """
    read = cli.load_beams(case, overrides)
    scale = read.turns
    low, high = cli.speed_range(lowest, highest, 2, read, most=2.0)
    width = cli.parse_accuracy(accuracy, scale)
    height = cli.parse_optional("--bounce-height", bounce_height, "length", "mm")
    if height is not None:
        positive("--bounce-height", height, "m", zero=True)
    deviation = cli.parse_optional("--lift-deviation", lift_deviation, "length", "mm")
    cutoff = cli.parse_optional("--low-pass", low_pass, "frequency", "Hz")
    search = Search(low, high, width, height, deviation, cutoff)
    cli.check_number("--workers", workers)
    if any(one is not None for one in (over, beside, which, csv, plot)):
        if over is None or beside is None:
            given = "--over alone" if over else "--and alone" if beside else "--limit, --csv or --plot alone"
            raise refuse("limits", given, "--over KEY=SPEC and --and KEY=SPEC", "a map needs two values")
        if deviation is not None or cutoff is not None:
            given = "--lift-deviation or --low-pass with --over"
            raise refuse("limits", given, "one of them", "a map has only the other limits")
        cli.check_targets(csv, plot, case, overwrite=overwrite)
        names = which or ["loss_of_contact"]
        return _map_limits(case, overrides, (over, beside), names, search, 1 if workers is None else workers)
    count = count_cores() if workers is None else workers
    with show_count(None, "runs") as shown, open_speed_runs(read, search, count) as runs:
        found = find_limits(read, search, start=runs, ahead=count, advance=shown)
    margins = compute_margins(read)
    parts: list[Table | str] = [limits_table(found, margins, scale)]
    if any(one.rpm is not None for one in found.limits.values()):
        parts.append(_LEGEND)
    if "loss_of_contact" not in found.limits:
        parts.append('Contact loss is not assessed: it needs a contact with model = "unilateral", which can separate.')
    return cli.CommandOutput(parts, limits_json(found, margins, scale))


def _map_limits(
    path: Path, overrides: cli.Overrides, settings: tuple[str, str], names: Sequence[str], search: Search, workers: int
) -> cli.CommandOutput:
    file = OpenCase.open(path)
    plan = grid_plan(_axis("--over", settings[0]), _axis("--and", settings[1]), overrides or ())
    case = validate_plan(file, plan)
    require_units(case, plan.varied_axes)
    asked = [f"limits.{name}" for name in names]
    with (
        show_count(len(plan), "variants") as shown,
        create_evaluator(file, (), asked, search, plan=plan, workers=workers, runs=len(plan), advance=shown) as runs,
    ):
        kept = InterruptibleRuns(runs)
        found = limit_map(plan, names, kept).with_units(case)
    return replace(limit_map_output(found, shaft_name(case.turns)), status=kept.status)


def _axis(option: str, setting: str) -> Axis:
    key, equals, spec = setting.partition("=")
    if not equals:
        raise refuse(option, repr(setting), f"{option} KEY=SPEC, such as springs.valve.stiffness=40:70:5kN/m")
    if key.strip() in ("run.speed", "run.crank_speed"):
        why = "a limit is a speed, searched from --lowest to --highest; the case's speed has no effect on it"
        raise refuse(option, key.strip(), "another value of the case", why, "vary a part")
    return parse_axis(key.strip(), spec, where=f"{option} {setting}")


def limit_map_output(found: LimitMap, shaft: str) -> cli.CommandOutput:
    """Return the output of a map of limits."""
    first, second = found.axes
    down, across = (with_unit(one.key, one.unit) for one in found.axes)
    tables = [
        plain_table(
            f"{name.replace('_', ' ')}, {shaft} rpm; columns: {across}",
            (down, *(format_number(value.number or 0.0) for value in second.values)),
            [
                (format_number(value.number or 0.0), *(format_number(x) for x in row))
                for value, row in zip(first.values, rpm.tolist(), strict=True)
            ],
        )
        for name, rpm in found.rpm.items()
    ]
    words: list[str] = []
    if any(np.isnan(rpm).any() for rpm in found.rpm.values()):
        words.append("A dash: no limit in the range of the search.")
    if failed := [status for status in found.statuses if not status.ok]:
        words.append(f"{len(failed)} variants failed; the first: {failed[0]}")
    head = (down, across, *(f"{name} [{shaft} rpm]" for name in found.rpm), "status")
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
        "limits_rpm": {name: finite_numbers(rpm) for name, rpm in found.rpm.items()},
        "statuses": [str(status.cause) for status in found.statuses],
    }
    numbers = [np.array([value.number for value in one.values]) for one in found.axes]
    rpm = {f"{name.replace('_', ' ')}\n{shaft} speed, rpm": speeds for name, speeds in found.rpm.items()}
    return cli.CommandOutput(
        [*tables, *words], json, format_csv(head, rows),
        draw=lambda: plotting.histories.map_figure(numbers[1], numbers[0], rpm, (across, down)),
    )  # fmt: skip
