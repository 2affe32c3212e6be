"""Commands that inspect a case: check, modes."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal

from cyclopts import Parameter

from flexcam.analysis.natural_modes import modal_assurance
from flexcam.analysis.natural_modes import modes as case_modes
from flexcam.analysis.preparation import prepare_without_periodic_search
from flexcam.analysis.run import estimate_case_resources, output_geometry
from flexcam.analysis.run_checks import check_input, check_modes
from flexcam.case.builder import build_model
from flexcam.case.reader import read_case
from flexcam.cli.app import CaseFile, Json, Overrides, Overwrite, app, check_positive, load_case
from flexcam.core.errors import collect_errors
from flexcam.dynamics import integrated_size
from flexcam.io import check_folder_name, create_folder, write_modes
from flexcam.report.tables import (
    describe_inactive,
    describe_mac,
    mac_table,
    mode_table,
    model_table,
    resolved_toml,
)
from flexcam.report.terminal import print_json, result_console
from flexcam.valvetrain import member_masses

Prestress = Annotated[
    Literal["rest", "equilibrium"] | None,
    Parameter("--prestress", help="Count in the axial forces as installed (rest), or under all loads (equilibrium)."),
]


@app.command(
    help_prologue="""\
flexcam check case.toml
flexcam check case.toml --set run.speed=4000rpm --json
flexcam check case.toml --echo
"""
)
def check(
    case: CaseFile, *,
    echo: Annotated[
        bool, Parameter("--echo", negative=(), help="Also print the case with every default filled in, in SI.")
    ] = False,
    overrides: Overrides = None, as_json: Json = False,
) -> None:  # fmt: skip
    """Check a case, and say what its model contains and what is doubtful about it."""
    read = load_case(case, overrides)
    ready = prepare_without_periodic_search(read)
    found, takes = case_modes(read), estimate_case_resources(ready, "revolution")
    if as_json:
        mesh, system = ready.model.mesh, ready.problem.system
        print_json({
            "status": "ok", "title": ready.case.record.title,
            "elements": len(mesh.elements()), "dof": system.size,
            "integrated": integrated_size(ready.problem),
            "left_out": describe_inactive(ready), "nodes": len(mesh.nodes),
            "members": {name: len(line) - 1 for name, line in mesh.lines.items()},
            "masses": {name: part.body.mass for name, part in ready.model.masses.items()},
            "springs": {name: spring.stiffness for name, spring in ready.model.springs.items()},
            "supports": {point: list(held) for point, held in ready.model.supports.items()},
            "member_masses": member_masses(ready.model),
            "free_motions": found.modes.rigid, "steps": ready.problem.steps, "step_s": ready.problem.step,
            "memory_bytes": takes.memory, "result_bytes": takes.file,
            "frequencies_hz": found.modes.frequencies[found.modes.rigid :][:10].tolist(),
            "warnings": check_modes(found) + check_input(ready),
            "loads": {load.name: [system.names[i] for i in load.vector.nonzero()[0]] for load in system.loads},
            "case": ready.case.record.model_dump(mode="json", by_alias=True),
        })  # fmt: skip
    else:
        result_console().print(model_table(ready, found, takes))
        for sentence in check_modes(found) + check_input(ready):
            result_console().print("\n" + sentence)
        if echo:
            result_console().print("\n# the case as it is run, SI\n" + resolved_toml(ready.case))
        else:
            result_console().print("\n--echo prints the case with every default filled in.")


@app.command(
    help_prologue="""\
flexcam modes case.toml --count 20
flexcam modes case.toml --prestress rest -o results
flexcam modes case.toml --mac finer.toml
"""
)
def modes(
    case: CaseFile, *, count: int = 12, prestress: Prestress = None, mac: Path | None = None,
    folder: Annotated[Path | None, Parameter(["-o", "--output"], help="Also write shapes for ParaView.")] = None,
    overrides: Overrides = None, overwrite: Overwrite = False, as_json: Json = False,
) -> None:  # fmt: skip
    """Compute natural frequencies and what moves in each mode.

    Parameters
    ----------
    count
        How many of the lowest modes.
    mac
        Another case, as it stands in its file, whose modes are compared with these (modal assurance criterion).
    """
    read = collect_errors(
        lambda: load_case(case, overrides),
        lambda: check_positive("--count", count),
        lambda: None if folder is None else check_folder_name(folder),
    )
    found = case_modes(read, count, prestress=prestress)
    likeness, compared = None, 0
    if mac is not None:
        other = read_case(mac)
        likeness, compared = modal_assurance(read, found, other, case_modes(other, count, prestress=prestress))
    files: list[Path] = []
    if folder is not None:
        path = create_folder(folder) / f"{read.name}-modes.vtkhdf"
        drawn = output_geometry(build_model(read))
        files = write_modes(path, drawn, found.modes.frequencies, found.modes.shapes, overwrite=overwrite)
    if as_json:
        print_json({
            "status": "ok", "title": read.record.title,
            "frequencies_hz": found.modes.frequencies.tolist(), "free_motions": found.modes.rigid,
            "effective_masses": found.effective.tolist(), "lost": found.modes.lost,
            "rounding": found.modes.rounding.tolist(), "warnings": check_modes(found),
            "moves": [found.words(i) for i in range(len(found.shares))],
            "mac": None if likeness is None else likeness.tolist(), "mac_nodes": compared,
            "files": [str(path) for path in files],
        })  # fmt: skip
        return
    result_console().print(mode_table(found, read.title))
    for sentence in check_modes(found):
        result_console().print("\n" + sentence)
    if likeness is not None:
        result_console().print()
        result_console().print(mac_table(likeness))
        result_console().print("\n" + describe_mac(likeness, compared))
    if files:
        result_console().print(
            f"\n{files[0]}: pick a mode in Warp By Vector and press play; {files[1]} holds the still shapes"
        )
