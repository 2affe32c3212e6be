"""Commands on natural modes, and on the orders that excite them: modes, campbell."""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from dataclasses import replace
from itertools import chain, pairwise, zip_longest
from pathlib import Path
from typing import Annotated, Literal

import numpy as np
from cyclopts import Group, Parameter
from rich.table import Table

from flexcam import plotting
from flexcam.analysis import natural_modes
from flexcam.analysis.orders import Signal, Waterfall, largest_orders, waterfall
from flexcam.analysis.preparation import prepare, scalar_probe
from flexcam.analysis.run import output_geometry
from flexcam.analysis.stability import MIN_HARMONIC_RATIO
from flexcam.case.builder import build_model
from flexcam.case.case import Case
from flexcam.case.reader import read_case
from flexcam.cli import app as cli
from flexcam.core import FloatArray
from flexcam.core.errors import collect_errors, refuse
from flexcam.core.units import shaft_name, to_display_unit
from flexcam.dynamics import Status
from flexcam.io import check_folder_name, create_folder, write_modes
from flexcam.report.tables import mode_table
from flexcam.report.terminal import NOISE, format_csv, format_number, plain_table, show_count
from flexcam.valvetrain import ModelModes, explain_planes


def _elastic_modes(modes: ModelModes, count: int) -> list[tuple[float, str]]:
    """Return the frequencies, Hz, of the lowest modes above zero, and what moves in them."""
    frequencies: list[float] = modes.modes.frequencies.tolist()
    first = modes.modes.rigid
    return [(frequencies[i], modes.words(i)) for i in range(len(frequencies))[first : first + count]]


_EQUAL = 1e-6  # relative difference of frequencies that is rounding


def _explain_equal_frequencies(states: Sequence[Sequence[tuple[float, str]]]) -> list[str]:
    """Explain equal frequencies of adjacent modes in which the same member bends."""
    for (low, first), (high, second) in chain.from_iterable(map(pairwise, states)):
        member, bends, _ = first.partition(" bending ")
        member = member.rpartition(", ")[2]
        if bends and f"{member} bending " in second and high - low <= _EQUAL * high:
            why = "with equal stiffness and supports in two planes"
            return [f"Equal frequencies: a member {why}, such as {member}, bends in both at the same frequency."]
    return []


def _closed_mode_table(contact: str, states: Sequence[list[tuple[float, str]]], turns: float) -> Table:
    table = plain_table(f"Modes with closed contacts, cam of contact {contact}", ("no.",), ())
    cells: list[list[tuple[str, ...]]] = []
    for place, modes in zip(("base circle", "full lift"), states, strict=True):
        table.add_column(f"{place}\nHz", justify="right", no_wrap=True)
        table.add_column(f"{shaft_name(turns)}\nrpm", justify="right", no_wrap=True)
        table.add_column("what moves", justify="left", overflow="fold")
        cells.append([(f"{hertz:.2f}", f"{60.0 * turns * hertz:.0f}", words) for hertz, words in modes])
    for number, row in enumerate(zip_longest(*cells, fillvalue=("", "", "")), start=1):
        table.add_row(str(number), *chain.from_iterable(row))
    return table


def _describe_mac(likeness: FloatArray, nodes: int) -> tuple[Table, str]:
    cells = [["-" if math.isnan(value) else f"{value:.2f}" for value in row] for row in likeness.tolist()]
    rows = [(str(i), *row) for i, row in enumerate(cells, start=1)]
    head = ("here / there", *map(str, range(1, likeness.shape[1] + 1)))
    few = nodes < max(likeness.shape)
    doubt = ", fewer than the modes: the table means little; give both models nodes at the same places" if few else ""
    unmoved = " A dash: the mode moves none of the common nodes; points of rockers and springs are not compared."
    words = f"The models have {nodes} moving node{'s' * (nodes != 1)} in common{doubt}."
    return plain_table("Modal assurance criterion", head, rows), words + unmoved * bool(np.isnan(likeness).any())


@cli.command("""\
flexcam modes case.toml
flexcam modes case.toml --count 20 --prestress rest
flexcam modes case.toml -o results
flexcam modes case.toml --mac finer.toml
""")
def modes(
    case: cli.CaseFile, *,
    count: Annotated[int, Parameter(help="Number of modes, from the lowest.")] = 12,
    prestress: Annotated[Literal["rest", "equilibrium"] | None, Parameter(
        help="Axial forces included in the modes with open contacts: as installed (rest), or under all loads "
        "(equilibrium); none by default. This option does not affect the modes with closed contacts, which always "
        "include the axial forces in members that have geometric_stiffness.")] = None,
    mac: Annotated[Path | None, Parameter(
        help="Second case file, whose modes are compared by the modal assurance criterion.")] = None,
    folder: Annotated[Path | None, Parameter(
        ["-o", "--output"], help="Also write the mode shapes for ParaView to this folder.")] = None,
    overrides: cli.Overrides = None, units: cli.Units = None, overwrite: cli.Overwrite = False,
    as_json: cli.Json = False,
) -> cli.CommandOutput:  # fmt: skip
    """Compute natural frequencies and mode shapes, and name the parts that move in each mode.

    It prints the modes with all contacts open. For each contact of a cam it also prints the modes with closed contacts
    at two angles: on the base circle and at full lift.
    """
    read, _ = collect_errors(
        lambda: cli.load_case(case, overrides),
        lambda: cli.check_number("--count", count),
        lambda: None if folder is None else check_folder_name(folder),
    )
    cli.warn_input(read, integrates=False)
    model_modes = natural_modes.modes(read, count, prestress=prestress)
    warnings = [*filter(None, [model_modes.modes.describe_rounding()])]
    criterion, node_count = None, 0
    if mac is not None:
        other = read_case(mac)
        other_modes = natural_modes.modes(other, count, prestress=prestress)
        criterion, node_count = natural_modes.modal_assurance(read, model_modes, other, other_modes)
    files: list[Path] = []
    if folder is not None:
        path = create_folder(folder) / f"{read.name}-modes.vtkhdf"
        drawn = output_geometry(build_model(read))
        files = write_modes(path, drawn, model_modes.modes.frequencies, model_modes.modes.shapes, overwrite=overwrite)
    closed, remarks = natural_modes.closed_modes(read)
    moves = [model_modes.words(i) for i in range(len(model_modes.shares))]
    states = {cam.contact: [_elastic_modes(state, count) for state in (cam.base_circle, cam.full_lift)]
              for cam in closed}  # fmt: skip
    listed = [_elastic_modes(model_modes, len(moves)), *chain.from_iterable(states.values())]
    first = model_modes.modes.rigid + 1
    columns = f"ux, uy, uz {to_display_unit('kg')[1]}: effective mass of the mode for base excitation along x, y, z. "
    columns += f"{shaft_name(read.turns)} rpm: speed at which the camshaft turns once per period of the mode."
    note = f" For sensitivity and optimize, frequency.1 is no. {first}, the first mode above zero." if first > 1 else ""
    table = mode_table(model_modes, f"{read.title}: modes, contacts open", read.turns)
    none = "no modes with contacts open. A mode needs a mass, or a member with density, that can move."
    parts = [
        *([table, columns + note] if moves else [f"{read.title}: {none}"]),
        *(_closed_mode_table(contact, of_cam, read.turns) for contact, of_cam in states.items()),
        *explain_planes([*moves, *(words for elastic in listed for _, words in elastic)]),
        *_explain_equal_frequencies(listed),
        *warnings,
        *remarks,
    ]
    if criterion is not None:
        parts += _describe_mac(criterion, node_count)
    if files:
        parts.append(f"{files[0]}: choose a mode in Warp By Vector and press play; {files[1]} has the static shapes")
    closed_hz = {
        contact: {"base_circle_hz": [hertz for hertz, _ in base], "full_lift_hz": [hertz for hertz, _ in lifted]}
        for contact, (base, lifted) in states.items()
    }
    json = {
        "title": read.record.title,
        "frequencies_hz": model_modes.modes.frequencies, "free_motions": model_modes.modes.rigid,
        "effective_masses": model_modes.effective, "lost": model_modes.modes.lost,
        "rounding": model_modes.modes.rounding, "warnings": warnings,
        "moves": moves,
        "mac": criterion, "mac_nodes": node_count,
        "closed": closed_hz, "files": files,
    }  # fmt: skip
    return cli.CommandOutput(parts, json)


_MODES, _RESPONSE = Group("Natural modes", sort_key=1), Group("Orders of the response", sort_key=2)
_MAX_ORDER = 1000  # the harmonics of a lift are below a thousandth of the maximum long before
_MAX_TABLE_ORDERS = 8  # in the table: those with the largest amplitudes
_DASH = (
    "-: the mode does not exist at this speed, because a different set of contacts is closed at full lift. A mode with "
    "- at both ends exists only at speeds in between."
)


def _modes_table(chart: natural_modes.Campbell, scale: float) -> Table:
    low, high = (f"Hz at {scale * chart.rpm[i]:.6g}" for i in (0, -1))

    def cell(column: FloatArray, i: int) -> str:
        return format_number(column[i], 5) if chart.statuses[i].ok else "failed"

    modes = zip(chart.frequencies.T, chart.reached, chart.words, strict=True)
    rows = [
        (str(i), cell(column, 0), cell(column, -1), "yes" if reached else "no", words)
        for i, (column, reached, words) in enumerate(modes, start=1)
    ]
    title = f"Natural frequencies over {shaft_name(scale)} rpm, {chart.contact} at full lift (rigid-body modes omitted)"
    return plain_table(title, ("mode", low, high, "excitable", "what moves"), rows)


def _crossing_table(chart: natural_modes.Campbell, scale: float) -> Table | str:
    rows = [
        (f"{scale * crossing.rpm:.6g}", str(crossing.harmonic), str(crossing.mode + 1), f"{crossing.frequency:.5g}",
         format_number(1e3 * crossing.amplitude, 3), format_number(crossing.load, 3), crossing.words)
        for crossing in chart.crossings
    ]  # fmt: skip
    if not rows:
        return "Resonances in this speed range: none"
    title = "Resonances: speeds at which an order of the cam force coincides with a natural frequency"
    what = ("order", "mode", "Hz", "lift amplitude, mm", "cam force amplitude, N", "what moves")
    return plain_table(title, (f"{shaft_name(scale)} rpm", *what), rows)


def _describe_incomplete_runs(statuses: Sequence[Status], rpm: FloatArray, scale: float) -> list[str]:
    return [
        f"Warning: no result at {scale * speed:.6g} {shaft_name(scale)} rpm: {status}"
        for status, speed in zip(statuses, rpm.tolist(), strict=True)
        if not status.ok
    ]


def _orders_table(result: Waterfall, scale: float) -> Table:
    orders = sorted(largest_orders(result, _MAX_TABLE_ORDERS))
    rounding = NOISE * float(np.nanmax(result.amplitudes)) if orders else 0.0
    rows: list[tuple[str, ...]] = []
    for rpm, sizes, gap in zip(result.rpm.tolist(), result.amplitudes, result.gaps.tolist(), strict=True):
        largest = float(sizes[1:].max())
        shares = f"{gap / largest:.1%}" if largest > 0.0 else "-"
        cells = (format_number(0.0 if sizes[n] < rounding else sizes[n], 4) for n in (0, *orders))
        rows.append((f"{scale * rpm:.6g}", *cells, shares))
    what = f"acceleration of {result.signal.name}" if result.signal.probe else result.signal.name
    count = f"the largest {len(orders)} of {result.amplitudes.shape[1] - 1}"
    title = f"Orders of {what}, {result.unit}, in the last revolution: {count}"
    head = (f"{shaft_name(scale)} rpm", "mean", *(f"order {n}" for n in orders), "change per revolution")
    return plain_table(title, head, rows)


def _orders_csv(results: Sequence[Waterfall], scale: float) -> str:
    """Return a row per history, speed and order, without incomplete runs."""
    head = ("history", "unit", f"{shaft_name(scale)} speed [rpm]", "order", "amplitude", "change per revolution")
    rows = [
        (result.signal.name, result.unit, f"{scale * rpm:.10g}", n, size, gap)
        for result in results
        for rpm, sizes, gap in zip(result.rpm, result.amplitudes.tolist(), result.gaps.tolist(), strict=True)
        for n, size in enumerate(sizes)
        if not math.isnan(size)
    ]
    return format_csv(head, rows)


@cli.command("""\
flexcam campbell cases/tayeb/model-3-shm.toml --lowest 1000rpm --highest 6000rpm --plot campbell.svg
flexcam campbell case.toml --orders 1:12 --modes 4 --count 21 --json
flexcam campbell case.toml --response --lowest 3000rpm --highest 7000rpm --plot orders.svg --csv orders.csv
flexcam campbell case.toml --response --channel contacts.intake.force --probe valve --orders 1:40
""")
def campbell(
    case: cli.CaseFile, *,
    lowest: cli.Lowest = None, highest: cli.Highest = None, count: cli.Count = 9,
    orders: Annotated[str, Parameter(
        help="Orders of the camshaft, such as 1:24 or 1,2,4; with --response they must start at 1, "
        "without gaps, such as 1:40.")] = "1:24",
    modes: Annotated[int | None, Parameter(
        group=_MODES, help="Number of modes, from the lowest; 8 by default.")] = None,
    contact: Annotated[str | None, Parameter(
        group=_MODES, help="Contact whose cam excites the modes, if there are several.")] = None,
    response: Annotated[bool, Parameter(
        group=_RESPONSE, help="Run each speed and show the orders of its last revolution.")] = False,
    channels: Annotated[list[str] | None, Parameter(
        "--channel", group=_RESPONSE, help="Channel such as a contact force; that of the first cam by "
        "default. Repeatable.")] = None,
    probes: Annotated[list[str] | None, Parameter(
        "--probe", group=_RESPONSE, help=f"Probe whose acceleration is shown; {cli.DEFAULT_PROBE}. "
        "Repeatable.")] = None,
    csv: Annotated[cli.Csv, Parameter(group=_RESPONSE)] = None, plot: cli.Picture = None,
    overrides: cli.Overrides = None, overwrite: cli.Overwrite = False, as_json: cli.Json = False,
) -> cli.CommandOutput:  # fmt: skip
    """Compute natural frequencies over speed and the orders of the cam that excite them, or the orders of the response.

    Use it to find resonances (Campbell diagram). With --response it runs the case at every speed and shows the
    harmonics of acceleration and contact force instead (waterfall diagram). Speeds are those of the crankshaft if the
    case gives crank_speed, otherwise those of the camshaft.
    """
    if response:
        why = "not allowed with --response, which needs no modes"
        cli.refuse_options({"--modes": modes, "--contact": contact}, why)
    of_response = {"--channel": channels, "--probe": probes, "--csv": csv}
    cli.refuse_without("--response", of_response, present=response)
    read, numbers = collect_errors(
        lambda: cli.load_case(case, overrides) if response else cli.load_beams(case, overrides),
        lambda: _parse_orders(orders, response),
        lambda: cli.check_number("--modes", modes),
        lambda: cli.check_targets(csv, plot, case, overwrite=overwrite),
    )
    speeds = cli.spaced_speeds(lowest, highest, count, read)
    cli.warn_input(read, integrates=response)
    if response:
        return _orders_of_response(read, speeds, _select_signals(read, channels, probes), numbers[-1])
    return modes_over_speed(read, speeds, numbers, 8 if modes is None else modes, contact)


def modes_over_speed(
    case: Case, speeds: list[float], orders: Sequence[int], count: int = 8, contact: str | None = None
) -> cli.CommandOutput:
    """Return natural modes over speed and their crossings with orders of the cam."""
    scale = case.turns
    with show_count(None, "speeds") as advance:  # and those of the crossings
        chart = natural_modes.campbell(case, speeds, orders=orders, modes=count, contact=contact, advance=advance)
    weak = ", ".join(str(n) for n in orders if n not in chart.lifts)
    below = f"{100.0 * MIN_HARMONIC_RATIO:g} % of the largest"
    left_out = f"Left out, because their amplitude in the lift acceleration is below {below}: orders {weak}"
    dash = [_DASH] if any(np.isnan(chart.frequencies[i]).any() for i in (0, -1) if chart.statuses[i].ok) else []
    parts = [
        _modes_table(chart, scale), *dash, _crossing_table(chart, scale), *([left_out] if weak else []),
        *explain_planes(chart.words), *_describe_incomplete_runs(chart.statuses, chart.rpm, scale),
    ]  # fmt: skip
    modes = [
        {"frequencies_hz": column, "reached": reached, "moves": words}
        for column, reached, words in zip(chart.frequencies.T, chart.reached, chart.words, strict=True)
    ]
    json = {
        "shaft": shaft_name(scale), "contact": chart.contact, "rpm": scale * chart.rpm, "modes": modes,
        "lift_amplitudes_m": chart.lifts, "force_amplitudes_n": dict(zip(chart.lifts, chart.loads.T, strict=True)),
        "crossings": [replace(c, rpm=scale * c.rpm, mode=c.mode + 1) for c in chart.crossings],
        "ended": [status.cause for status in chart.statuses],
    }  # fmt: skip
    return cli.CommandOutput(
        parts, json, title=case.title, status=cli.joint_status(chart.statuses, "speeds"),
        draw=lambda: plotting.spectra.campbell_figure(chart, scale, shaft_name(scale)),
    )  # fmt: skip


def _orders_of_response(
    case: Case, speeds: list[float], signals: list[Signal], highest_order: int
) -> cli.CommandOutput:
    """Run every speed and return the orders of the last revolution."""
    scale = case.turns
    with show_count(len(speeds), "speeds") as advance:
        results = waterfall(case, speeds, signals, highest_order, advance=advance)
    rpm, statuses, shaft = results[0].rpm, results[0].statuses, shaft_name(scale)
    parts = [*(_orders_table(result, scale) for result in results), *_describe_incomplete_runs(statuses, rpm, scale)]
    histories = {
        result.signal.name: {"unit": result.unit, "amplitudes": result.amplitudes, "open_by": result.gaps}
        for result in results
    }
    return cli.CommandOutput(
        parts,
        {"shaft": shaft, "rpm": scale * rpm, "histories": histories, "ended": [status.cause for status in statuses]},
        _orders_csv(results, scale), title=case.title, status=cli.joint_status(statuses, "speeds"),
        draw=lambda: plotting.spectra.waterfall_figure(results, scale, shaft),
    )  # fmt: skip


def _select_signals(case: Case, channels: list[str] | None, probes: list[str] | None) -> list[Signal]:
    """Return the requested histories: by default the acceleration of the valve and the force of the first cam."""
    if channels is None and probes is None:
        driven = next((name for name, contact in case.record.contacts.items() if hasattr(contact, "cam")), None)
        channels = [] if driven is None else [f"contacts.{driven}.force"]
        probes = [scalar_probe(prepare(case))]
    return [*(Signal(name, probe=True) for name in probes or []), *(Signal(name) for name in channels or [])]


def _parse_orders(text: str, response: bool) -> list[int]:
    """Parse orders: ``1:12``, ``1,2,4`` or one; those of a response begin with 1 and have no gaps."""
    numbers: list[int] = []
    if match := re.fullmatch(r"\s*(\d{1,4})\s*:\s*(\d{1,4})\s*", text):
        numbers = list(range(int(match[1]), int(match[2]) + 1))
    elif re.fullmatch(r"\s*\d{1,4}\s*(,\s*\d{1,4}\s*)*", text):
        numbers = sorted({int(number) for number in text.split(",")})
    if not numbers or numbers[0] < 1 or numbers[-1] > _MAX_ORDER:
        raise refuse("--orders", repr(text), f"whole numbers from 1 to {_MAX_ORDER}: 1:12, or 1,2,4")
    if response and len(numbers) != numbers[-1]:
        why = "the response has all orders from 1"
        raise refuse("--orders", repr(text), "1:N with --response", why, f"write 1:{numbers[-1]}")
    return numbers
