"""Command that computes natural modes: modes."""

from __future__ import annotations

from itertools import chain, zip_longest
from pathlib import Path
from typing import Annotated, Literal

from cyclopts import Parameter
from rich.table import Table

from flexcam.analysis.natural_modes import ClosedModes, closed_modes, modal_assurance
from flexcam.analysis.natural_modes import modes as case_modes
from flexcam.analysis.run import output_geometry
from flexcam.analysis.run_checks import check_modes
from flexcam.case.builder import build_model
from flexcam.case.reader import read_case
from flexcam.cli import app as cli
from flexcam.core.errors import collect_errors
from flexcam.core.units import shaft_name
from flexcam.io import check_folder_name, create_folder, write_modes
from flexcam.report.tables import describe_mac, mac_table, mode_table
from flexcam.report.terminal import plain_table
from flexcam.valvetrain import ModelModes


def _elastic(found: ModelModes, count: int) -> list[int]:
    return list(range(len(found.modes.frequencies)))[found.modes.rigid :][:count]


def _closed_mode_table(found: ClosedModes, count: int, turns: float) -> Table:
    made = plain_table(f"Modes with closed contacts, cam of contact {found.contact}", ("no.",), ())
    columns = {"base circle": found.base_circle, "full lift": found.full_lift}
    cells: list[list[tuple[str, ...]]] = []
    for place, modes in columns.items():
        made.add_column(f"{place}\nHz", justify="right")
        made.add_column(f"{shaft_name(turns)}\nrpm", justify="right")
        made.add_column("what moves", justify="left", overflow="fold")
        found_hz = ((float(modes.modes.frequencies[i]), modes.words(i)) for i in _elastic(modes, count))
        cells.append([(f"{hertz:.2f}", f"{60.0 * turns * hertz:.0f}", words) for hertz, words in found_hz])
    for number, row in enumerate(zip_longest(*cells, fillvalue=("", "", "")), start=1):
        made.add_row(str(number), *chain.from_iterable(row))
    return made


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
        help="Include axial forces: as installed (rest), or under all loads (equilibrium).")] = None,
    mac: Annotated[Path | None, Parameter(
        help="Second case file, whose modes are compared by the modal assurance criterion.")] = None,
    folder: Annotated[Path | None, Parameter(
        ["-o", "--output"], help="Also write the mode shapes for ParaView to this folder.")] = None,
    overrides: cli.Overrides = None, units: cli.Units = None, overwrite: cli.Overwrite = False,
    as_json: cli.Json = False,
) -> cli.CommandOutput:  # fmt: skip
    """Compute natural frequencies and mode shapes, and name the parts that move in each mode.

    It prints the modes with all contacts open, and for each cam those with the contacts closed on the base circle and
    at full lift.
    """
    read, _ = collect_errors(
        lambda: cli.load_case(case, overrides),
        lambda: cli.check_number("--count", count),
        lambda: None if folder is None else check_folder_name(folder),
    )
    found = case_modes(read, count, prestress=prestress)
    criterion, compared = None, 0
    if mac is not None:
        other = read_case(mac)
        criterion, compared = modal_assurance(read, found, other, case_modes(other, count, prestress=prestress))
    files: list[Path] = []
    if folder is not None:
        path = create_folder(folder) / f"{read.name}-modes.vtkhdf"
        drawn = output_geometry(build_model(read))
        files = write_modes(path, drawn, found.modes.frequencies, found.modes.shapes, overwrite=overwrite)
    closed, missing = closed_modes(read)
    parts = [
        mode_table(found, f"{read.title}: modes, contacts open", read.turns),
        *(_closed_mode_table(one, count, read.turns) for one in closed),
        *check_modes(found),
        *filter(None, [missing]),
    ]
    if criterion is not None:
        parts += [mac_table(criterion), describe_mac(criterion, compared)]
    if files:
        parts.append(f"{files[0]}: choose a mode in Warp By Vector and press play; {files[1]} has the static shapes")
    closed_hz = {
        one.contact: {
            key: modes.modes.frequencies[_elastic(modes, count)]
            for key, modes in (("base_circle_hz", one.base_circle), ("full_lift_hz", one.full_lift))
        }
        for one in closed
    }
    json = {
        "title": read.record.title,
        "frequencies_hz": found.modes.frequencies, "free_motions": found.modes.rigid,
        "effective_masses": found.effective, "lost": found.modes.lost,
        "rounding": found.modes.rounding, "warnings": check_modes(found),
        "moves": [found.words(i) for i in range(len(found.shares))],
        "mac": criterion, "mac_nodes": compared,
        "closed": closed_hz, "files": files,
    }  # fmt: skip
    return cli.CommandOutput(parts, json)
