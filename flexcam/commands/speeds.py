"""Commands about the orders of the camshaft over speed: campbell, orders."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Annotated

import numpy as np
from cyclopts import Parameter

from flexcam.case import Case
from flexcam.checks import refuse, together
from flexcam.commands.app import (
    CaseFile,
    Json,
    Overrides,
    Overwrite,
    Picture,
    app,
    free_picture,
    from_one,
    load,
    load_beams,
    speed_range,
)
from flexcam.commands.targets import free_targets
from flexcam.console.campbell import campbell_json, campbell_table, crossing_table, ended_early, nothing_known
from flexcam.console.orders import orders_csv, orders_json, orders_table
from flexcam.io import write_text
from flexcam.orders import Signal, waterfall
from flexcam.response import Status
from flexcam.runner import prepare, scalar_probe
from flexcam.stability import campbell as find_crossings
from flexcam.terminal import counting, out, print_json
from flexcam.units import shaft_name

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
    read = together(
        lambda: load_beams(case, overrides),
        lambda: _whole_numbers("--orders", orders),
        lambda: free_picture(plot, overwrite),
    )
    scale, numbers = read.turns, _whole_numbers("--orders", orders)
    low, high = speed_range(lowest, highest, count, read.speed, scale)
    speeds = np.linspace(low, high, count).tolist()
    with counting(count, "speeds") as shown:
        found = find_crossings(read, speeds, orders=numbers, modes=modes, contact=contact, advance=shown)
    if plot is not None:
        from flexcam.view import campbell_figure, save_figure, titled

        figure = campbell_figure(found, scale, shaft_name(scale))
        save_figure(titled(figure, read.title), plot, overwrite=overwrite)
    ended = nothing_known(found.statuses)
    if as_json:
        files = [] if plot is None else [str(plot)]
        print_json({"status": _word(ended), **campbell_json(found, scale), "files": files})
        return ended
    out().print(campbell_table(found, scale))
    out().print()
    out().print(crossing_table(found, scale))
    for sentence in ended_early(found.statuses, found.rpm, scale):
        out().print("\n" + sentence)
    if plot is not None:
        out().print(f"\n{plot}")
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
    read = together(
        lambda: load(case, overrides),
        lambda: from_one("--orders", highest_order),
        lambda: free_targets(csv, plot, case, overwrite=overwrite),
    )
    scale = read.turns
    low, high = speed_range(lowest, highest, count, read.speed, scale)
    speeds = np.linspace(low, high, count).tolist()
    with counting(count, "speeds") as shown:
        found = waterfall(read, speeds, signals(read, channels, probes), highest_order, advance=shown)
    if csv is not None:
        write_text(csv, orders_csv(found, scale), overwrite=overwrite)
    if plot is not None:
        from flexcam.view import save_figure, titled, waterfall_figure

        figure = waterfall_figure(found, scale, shaft_name(scale))
        save_figure(titled(figure, read.title), plot, overwrite=overwrite)
    files = [str(path) for path in (csv, plot) if path is not None]
    ended = nothing_known(found[0].statuses)
    if as_json:
        print_json({"status": _word(ended), **orders_json(found, scale), "files": files})
        return ended
    for one in found:
        out().print(orders_table(one, scale))
        out().print()
    for sentence in ended_early(found[0].statuses, found[0].rpm, scale):
        out().print(sentence)
    for path in files:
        out().print(path)
    return ended


def _word(ended: Status | None) -> str:
    return "ok" if ended is None else str(ended.cause)


def signals(case: Case, channels: list[str] | None, probes: list[str] | None) -> list[Signal]:
    """Return the histories asked for: by default the acceleration of the valve and the force of the first cam."""
    if channels is None and probes is None:
        driven = next((name for name, one in case.record.contacts.items() if hasattr(one, "cam")), None)
        channels = [] if driven is None else [f"contacts.{driven}.force"]
        probes = [scalar_probe(prepare(case))]
    return [*(Signal(name, probe=True) for name in probes or []), *(Signal(name) for name in channels or [])]


def _whole_numbers(where: str, text: str) -> list[int]:
    """Return the numbers of an option: ``1:12``, ``1,2,4`` or one."""
    if found := re.fullmatch(r"\s*(\d{1,4})\s*:\s*(\d{1,4})\s*", text):
        first, last = int(found[1]), int(found[2])
        if 1 <= first <= last <= _MOST_ORDERS:
            return list(range(first, last + 1))
    elif re.fullmatch(r"\s*\d{1,4}\s*(,\s*\d{1,4}\s*)*", text):
        numbers = [int(one) for one in text.split(",")]
        if min(numbers) >= 1 and max(numbers) <= _MOST_ORDERS:
            return sorted(set(numbers))
    raise refuse(where, repr(text), f"whole numbers from 1 to {_MOST_ORDERS}: 1:12, or 1,2,4")


_MOST_ORDERS = 1000
"""What a lift has above says nothing: its harmonics are below a thousandth of the largest long before."""
