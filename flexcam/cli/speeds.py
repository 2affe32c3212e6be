"""Commands over speeds: campbell, orders."""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Annotated

import numpy as np
from cyclopts import Parameter
from rich.table import Table

from flexcam.analysis.campbell import Campbell
from flexcam.analysis.campbell import campbell as find_crossings
from flexcam.analysis.orders import Signal, Waterfall, largest_orders, waterfall
from flexcam.analysis.preparation import prepare, scalar_probe
from flexcam.case.case import Case
from flexcam.cli.app import (
    CaseFile,
    Json,
    Overrides,
    Overwrite,
    Picture,
    app,
    check_figure_path,
    check_positive,
    load_beams,
    load_case,
    speed_range,
)
from flexcam.cli.arguments import check_targets
from flexcam.core import FloatArray
from flexcam.core.errors import collect_errors, refuse
from flexcam.core.units import shaft_name
from flexcam.dynamics import Status
from flexcam.io import write_text
from flexcam.report.formatting import NOISE, format_mm
from flexcam.report.terminal import plain_table, print_json, result_console, show_count


def campbell_table(found: Campbell, scale: float) -> Table:
    """Return the table of the modes over speed, one row per mode."""
    low, high = (f"Hz at {scale * found.rpm[i]:.6g}" for i in (0, -1))
    rows = [
        (str(i + 1), _hz(column[0]), _hz(column[-1]), "yes" if reached else "no", words)
        for i, (column, reached, words) in enumerate(zip(found.frequencies.T, found.reached, found.words, strict=True))
    ]
    title = f"Modes at full lift of {found.contact} over {shaft_name(scale)} rpm"
    return plain_table(title, ("mode", low, high, "felt", "what moves"), rows)


def _hz(value: float) -> str:
    return "-" if math.isnan(value) else f"{value:.5g}"


def crossing_table(found: Campbell, scale: float) -> Table:
    """Return the table of the crossings of orders and modes in ascending order of speed."""
    rows = [
        (
            f"{scale * one.rpm:.6g}",
            str(one.harmonic),
            str(one.mode + 1),
            f"{one.frequency:.5g}",
            format_mm(one.amplitude, 3),
            _force(one.load),
            one.words,
        )
        for one in found.crossings
    ]
    title = "Where orders of the camshaft meet modes that are felt at the contact"
    head = (f"{shaft_name(scale)} rpm", "order", "mode", "Hz", "in the lift, mm", "in the force, N", "what moves")
    return plain_table(title if rows else f"{title}: nowhere between these speeds", head, rows)


def _force(value: float) -> str:
    return "-" if math.isnan(value) else f"{value:.3g}"


def campbell_json(found: Campbell, scale: float) -> dict[str, object]:
    """Return a Campbell diagram for ``--json``."""
    modes = [
        {"frequencies_hz": [_or_none(x) for x in column.tolist()], "reached": reached, "moves": words}
        for column, reached, words in zip(found.frequencies.T, found.reached, found.words, strict=True)
    ]
    met = [
        {**asdict(one), "rpm": scale * one.rpm, "mode": one.mode + 1, "load": _or_none(one.load)}
        for one in found.crossings
    ]
    return {
        "shaft": shaft_name(scale), "contact": found.contact, "rpm": (scale * found.rpm).tolist(), "modes": modes,
        "lift_amplitudes_m": {str(n): size for n, size in found.lifts.items()},
        "force_amplitudes_n": {
            str(n): [_or_none(x) for x in column.tolist()] for n, column in zip(found.lifts, found.loads.T, strict=True)
        },
        "crossings": met, "ended": [str(one.cause) for one in found.statuses],
    }  # fmt: skip


def _or_none(value: float) -> float | None:
    return None if math.isnan(value) else value


def failed_status(statuses: Sequence[Status]) -> Status | None:
    """Return the status of a command over speeds if no speed was computed."""
    if any(one.ok for one in statuses):
        return None
    first = statuses[0]
    return Status(first.cause, f"none of {len(statuses)} speeds was completed; the first: {first.text}", first.remedy)


def describe_incomplete_runs(statuses: Sequence[Status], rpm: FloatArray, scale: float) -> list[str]:
    """Return sentences about incomplete runs."""
    return [
        f"Warning: nothing is known at {scale * speed:.6g} {shaft_name(scale)} rpm: {status}"
        for status, speed in zip(statuses, rpm.tolist(), strict=True)
        if not status.ok
    ]


_MAX_TABLE_ORDERS = 8
"""Number of orders in the table: those with the largest amplitudes."""


def orders_table(found: Waterfall, scale: float) -> Table:
    """Return the table of the largest orders of a history over speed."""
    shown = sorted(largest_orders(found, _MAX_TABLE_ORDERS))
    rounding = NOISE * float(np.nanmax(found.amplitudes)) if shown else 0.0
    rows = [
        (f"{scale * rpm:.6g}", *(_number(found.amplitudes[i, n], rounding) for n in (0, *shown)), _part(found, i))
        for i, rpm in enumerate(found.rpm.tolist())
    ]
    what = f"acceleration of {found.signal.name}" if found.signal.probe else found.signal.name
    title = f"Orders of {what}, {found.unit}, in the last revolution: the largest of {found.amplitudes.shape[1] - 1}"
    head = (f"{shaft_name(scale)} rpm", "mean", *(f"order {n}" for n in shown), "not periodic by")
    return plain_table(title, head, rows)


def _number(value: float, rounding: float) -> str:
    """Format an amplitude; rounding noise of the largest gives zero."""
    return "-" if math.isnan(value) else f"{0.0 if value < rounding else value:.4g}"


def _part(found: Waterfall, i: int) -> str:
    size = float(found.amplitudes[i, 1:].max())
    return "-" if math.isnan(size) or size <= 0.0 else f"{found.gaps[i] / size:.1%}"


def orders_csv(found: Sequence[Waterfall], scale: float) -> str:
    """Return amplitudes as CSV text, a row per history, speed and order, without incomplete runs."""
    lines = [f"history,unit,{shaft_name(scale)} speed [rpm],order,amplitude,not periodic by"]
    for one in found:
        for i, rpm in enumerate((scale * one.rpm).tolist()):
            for n, size in enumerate(one.amplitudes[i].tolist()):
                if not math.isnan(size):
                    lines.append(f"{one.signal.name},{one.unit},{rpm:.10g},{n},{size:.17g},{one.gaps[i]:.17g}")
    return "\n".join(lines) + "\n"


def orders_json(found: Sequence[Waterfall], scale: float) -> dict[str, object]:
    """Return the orders for ``--json``."""
    histories = {
        one.signal.name: {
            "unit": one.unit, "amplitudes": [_or_null(row) for row in one.amplitudes], "open_by": _or_null(one.gaps),
        }
        for one in found
    }  # fmt: skip
    first = found[0]
    ended = [str(status.cause) for status in first.statuses]
    return {
        "shaft": shaft_name(scale),
        "rpm": (scale * first.rpm).tolist(),
        "histories": histories,
        "ended": ended,
    }


def _or_null(values: FloatArray) -> list[float | None]:
    return [None if math.isnan(one) else one for one in np.asarray(values).tolist()]


Lowest = Annotated[str | None, Parameter("--lowest", help="Lowest speed; half the case's by default.")]
Highest = Annotated[str | None, Parameter("--highest", help="Highest speed; one and a half of the case's by default.")]
Count = Annotated[int, Parameter("--count", help="Speeds, evenly between both.")]


@app.command(
    help_prologue="""\
flexcam campbell cases/tayeb/model-3-shm.toml --lowest 1000rpm --highest 6000rpm --plot campbell.svg
flexcam campbell case.toml --orders 1:12 --modes 4 --count 21 --json
"""
)
def campbell(
    case: CaseFile, *,
    lowest: Lowest = None, highest: Highest = None, count: Count = 9,
    orders: Annotated[str, Parameter(help="Orders of the camshaft: 1:24, or 1,2,4.")] = "1:24",
    modes: Annotated[int, Parameter(help="How many of the lowest modes.")] = 8,
    contact: Annotated[str | None, Parameter(help="Whose cam, where a case has several.")] = None,
    plot: Picture = None, overrides: Overrides = None, overwrite: Overwrite = False, as_json: Json = False,
) -> Status | None:  # fmt: skip
    """Draw natural frequencies over speed with the orders of a cam, and list where they meet.

    Speeds are those of the crankshaft where the case gives crank_speed, else those of the camshaft.
    """
    read = collect_errors(
        lambda: load_beams(case, overrides),
        lambda: _parse_integers("--orders", orders),
        lambda: check_figure_path(plot, overwrite),
    )
    scale, numbers = read.turns, _parse_integers("--orders", orders)
    low, high = speed_range(lowest, highest, count, read.speed, scale)
    speeds = np.linspace(low, high, count).tolist()
    with show_count(count, "speeds") as shown:
        found = find_crossings(read, speeds, orders=numbers, modes=modes, contact=contact, advance=shown)
    if plot is not None:
        from flexcam.plotting.figures import add_title, save_figure
        from flexcam.plotting.spectra import campbell_figure

        figure = campbell_figure(found, scale, shaft_name(scale))
        save_figure(add_title(figure, read.title), plot, overwrite=overwrite)
    ended = failed_status(found.statuses)
    if as_json:
        files = [] if plot is None else [str(plot)]
        print_json({"status": _word(ended), **campbell_json(found, scale), "files": files})
        return ended
    result_console().print(campbell_table(found, scale))
    result_console().print()
    result_console().print(crossing_table(found, scale))
    for sentence in describe_incomplete_runs(found.statuses, found.rpm, scale):
        result_console().print("\n" + sentence)
    if plot is not None:
        result_console().print(f"\n{plot}")
    return ended


@app.command(
    help_prologue="""\
flexcam orders cases/pushrod-engine/intake.toml --lowest 3000rpm --highest 7000rpm --count 21 --plot orders.svg
flexcam orders case.toml --channel contacts.intake.force --probe valve --orders 24 --csv orders.csv
"""
)
def orders(
    case: CaseFile, *,
    lowest: Lowest = None, highest: Highest = None, count: Count = 9,
    channels: Annotated[
        list[str] | None,
        Parameter("--channel", negative=(), help="Channel; the force of the first cam by default. May be repeated."),
    ] = None,
    probes: Annotated[
        list[str] | None,
        Parameter("--probe", negative=(), help="Probe whose acceleration counts; the valve by default."),
    ] = None,
    highest_order: Annotated[int, Parameter("--orders", help="Highest order.")] = 24,
    csv: Annotated[Path | None, Parameter("--csv", help="Also write the amplitudes here.")] = None,
    plot: Picture = None, overrides: Overrides = None, overwrite: Overwrite = False, as_json: Json = False,
) -> Status | None:  # fmt: skip
    """Tell the orders of acceleration and contact force over speed: harmonics of the last revolution.

    Speeds are those of the crankshaft where the case gives crank_speed, else those of the camshaft.
    """
    read = collect_errors(
        lambda: load_case(case, overrides),
        lambda: check_positive("--orders", highest_order),
        lambda: check_targets(csv, plot, case, overwrite=overwrite),
    )
    scale = read.turns
    low, high = speed_range(lowest, highest, count, read.speed, scale)
    speeds = np.linspace(low, high, count).tolist()
    with show_count(count, "speeds") as shown:
        found = waterfall(read, speeds, select_signals(read, channels, probes), highest_order, advance=shown)
    if csv is not None:
        write_text(csv, orders_csv(found, scale), overwrite=overwrite)
    if plot is not None:
        from flexcam.plotting.figures import add_title, save_figure
        from flexcam.plotting.spectra import waterfall_figure

        figure = waterfall_figure(found, scale, shaft_name(scale))
        save_figure(add_title(figure, read.title), plot, overwrite=overwrite)
    files = [str(path) for path in (csv, plot) if path is not None]
    ended = failed_status(found[0].statuses)
    if as_json:
        print_json({"status": _word(ended), **orders_json(found, scale), "files": files})
        return ended
    for one in found:
        result_console().print(orders_table(one, scale))
        result_console().print()
    for sentence in describe_incomplete_runs(found[0].statuses, found[0].rpm, scale):
        result_console().print(sentence)
    for path in files:
        result_console().print(path)
    return ended


def _word(ended: Status | None) -> str:
    return "ok" if ended is None else str(ended.cause)


def select_signals(case: Case, channels: list[str] | None, probes: list[str] | None) -> list[Signal]:
    """Return the requested histories: by default the acceleration of the valve and the force of the first cam."""
    if channels is None and probes is None:
        driven = next((name for name, one in case.record.contacts.items() if hasattr(one, "cam")), None)
        channels = [] if driven is None else [f"contacts.{driven}.force"]
        probes = [scalar_probe(prepare(case))]
    return [*(Signal(name, probe=True) for name in probes or []), *(Signal(name) for name in channels or [])]


def _parse_integers(where: str, text: str) -> list[int]:
    """Parse the integers of an option: ``1:12``, ``1,2,4`` or one."""
    if found := re.fullmatch(r"\s*(\d{1,4})\s*:\s*(\d{1,4})\s*", text):
        first, last = int(found[1]), int(found[2])
        if 1 <= first <= last <= _MAX_ORDER:
            return list(range(first, last + 1))
    elif re.fullmatch(r"\s*\d{1,4}\s*(,\s*\d{1,4}\s*)*", text):
        numbers = [int(one) for one in text.split(",")]
        if min(numbers) >= 1 and max(numbers) <= _MAX_ORDER:
            return sorted(set(numbers))
    raise refuse(where, repr(text), f"whole numbers from 1 to {_MAX_ORDER}: 1:12, or 1,2,4")


_MAX_ORDER = 1000
"""Maximum order: harmonics of a lift are below a thousandth of the largest long before."""
