"""Commands for result files: info, export, report."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Annotated, Literal

import numpy as np
from cyclopts import Parameter

from flexcam.case.builder import build_model
from flexcam.case.reader import read_case
from flexcam.cli import app as cli
from flexcam.core.errors import refuse
from flexcam.dynamics import Response
from flexcam.io import (
    Result,
    check_folder_name,
    check_writable,
    create_folder,
    macro_path,
    read_result,
    verify_file,
    write_csv,
    write_macro,
    write_mesh,
    write_pvd,
    write_text,
)
from flexcam.report.tables import info_table, stats_json
from flexcam.report.terminal import print_json, result_console
from flexcam.valvetrain import build_structure

_FRAMES, _MAX_FRAMES = {".vtm": 36, ".glb": 72}, 720
_MAX_INSTANTS = 10_000_000


@cli.command("""\
flexcam info results/case.vtkhdf
flexcam info results/case.vtkhdf --verify
""")
def info(
    result: cli.ResultPath, *,
    verify: Annotated[bool, Parameter(help="Read the whole file and compare its checksums.")] = False,
    as_json: cli.Json = False,
) -> None:  # fmt: skip
    """Show the contents of a result file: how its run ended, versions, solver statistics, saved data."""
    if verify:
        found = verify_file(result)
        if as_json:
            print_json({"status": "ok", "file": str(result), **found})
        else:
            partial = "" if found["complete"] else "; its run ended early"
            size = f"{found['datasets']} datasets, {found['bytes']} bytes"
            result_console().print(f"{result} is intact: {size}, as written{partial}")
        return
    read = read_result(result)
    response = read.response
    if as_json:
        print_json({
            "status": "ok", "run": str(response.status.cause), "message": response.status.text,
            "stats": stats_json(response.stats),
            "saved_steps": len(response.time), "saved_fields": len(response.field_time),
            "probes": {name: list(components) for name, components in response.outline.probes},
            "channels": dict(response.outline.channels), "fields": [*read.field_names, *read.recovered],
            "about": {name: text for name, text in read.about.items() if name not in ("case", "files", "resolved")},
            "case": json.loads(read.about["resolved"]),
        })  # fmt: skip
    else:
        result_console().print(info_table(read))


@cli.command("""\
flexcam export results/case.vtkhdf --format csv --probe valve
flexcam export results/case.vtkhdf --format csv --instants 720
flexcam export results/case.vtkhdf --format pvd --every 5 --field displacement
flexcam export case.toml --format msh -o meshes
flexcam export results/case.vtkhdf --format glb
flexcam export results/case.vtkhdf --format vtm --field stress_von_mises
flexcam export case.toml --format stl --at 90deg
""")
def export(
    source: Annotated[Path, Parameter(
        help="Result file (.vtkhdf); a case file (.toml) for msh and inp; either for stl, vtm and glb.")], *,
    form: Annotated[
        Literal["pvd", "csv", "msh", "inp", "stl", "vtm", "glb"],
        Parameter(
            "--format", help="pvd: for ParaView; csv: table; msh: mesh for Gmsh (2.2); inp: for Abaqus and CalculiX; "
            "solids of the parts: stl at one instant, vtm moving in ParaView, glb animated."
        ),
    ] = "pvd",
    folder: Annotated[Path | None, Parameter(["-o", "--output"], help="Folder; that of the source by default.")] = None,
    every: Annotated[int, Parameter("--every", help="pvd, csv: write only every n-th saved instant.")] = 1,
    fields: Annotated[list[str] | None, Parameter(
        "--field", help="pvd: write only this point data, repeatable; vtm: this field on members.")] = None,
    probes: Annotated[list[str] | None, Parameter("--probe", help="csv: write only this probe. Repeatable.")] = None,
    instants: Annotated[int | None, Parameter(
        help="csv: number of evenly spaced instants, interpolated between steps; vtm, glb: number of instants of the "
        "last revolution, by default 36 and 72.")] = None,
    at: Annotated[str | None, Parameter(help="stl: cam angle, such as 90deg; by default as flexcam view.")] = None,
    macro: Annotated[bool, Parameter(
        "--paraview", help="pvd: also write NAME.paraview.py, which opens it in ParaView.")] = False,
    overwrite: cli.Overwrite = False, as_json: cli.Json = False,
) -> cli.CommandOutput:  # fmt: skip
    """Convert a result to CSV, ParaView files or solids, or the mesh of a case to Gmsh, Abaqus or CalculiX format.

    Solids are the parts that flexcam view shows: those of a result, or of a case as a rigid mechanism.
    """
    for option, forms, given, why in (
        ("--paraview", ("pvd",), macro, "the macro opens that collection"),
        ("--field", ("pvd", "vtm"), fields is not None, "it applies only to these formats; leave it out"),
        ("--probe", ("csv",), probes is not None, "only the table has probes"),
        ("--every", ("pvd", "csv"), every != 1,
         "for vtm and glb use --instants; stl has one instant (--at), a mesh none"),
        ("--instants", ("csv", "vtm", "glb"), instants is not None,
         "format pvd writes the saved instants (see --every), stl a single one (see --at); leave it out"),
        ("--at", ("stl",), at is not None, "only format stl writes a single instant"),
    ):  # fmt: skip
        if given and form not in forms:
            raise refuse(option, f"--format {form}", f"--format {' or '.join(forms)}", why)
    target = create_folder(source.parent if folder is None else check_folder_name(folder)) / f"{source.stem}.{form}"
    if form in ("msh", "inp"):
        write_mesh(build_model(read_case(source)).mesh, target, overwrite=overwrite)
        files = [target]
    elif form == "csv":
        response = _interpolate(read_result(source).response, instants)
        files = [write_csv(response, target, probes=probes, every=every, overwrite=overwrite)]
    elif form in ("stl", "vtm", "glb"):
        files = _write_solids(source, target, fields, instants, at, overwrite=overwrite)
    else:
        files = _write_collection(read_result(source), target, every, fields, macro=macro, overwrite=overwrite)
    said = f"{files[0]} ({len(files)} files)" if len(files) > 1 else str(files[0])
    script = f"\nparaview --script={files[1]}" if macro else ""
    return cli.CommandOutput([said + script], {"files": [str(path) for path in files]})


def _write_collection(
    result: Result, target: Path, every: int, fields: list[str] | None, *, macro: bool, overwrite: bool
) -> list[Path]:
    """Write a collection and its macro after checking that both may be written."""
    if not macro:
        return write_pvd(result, target, every=every, fields=fields, overwrite=overwrite)
    if fields is not None and "displacement" not in fields:
        why = "the script of --paraview shows the deformation"
        raise refuse("--field", ", ".join(fields), "displacement among them", why)
    check_writable("export", macro_path(target), overwrite=overwrite)
    first, *rest = write_pvd(result, target, every=every, fields=fields, overwrite=overwrite)
    shown = (*result.field_names, *result.recovered) if fields is None else tuple(fields)
    degrees = np.degrees(result.response.field_angle[::every]).tolist()
    return [first, write_macro(first, shown, degrees, overwrite=overwrite), *rest]


def _write_solids(
    source: Path, target: Path, fields: list[str] | None, instants: int | None, at: str | None, *, overwrite: bool
) -> list[Path]:
    """Write the solids of a result, or of a case as a rigid mechanism, in the format of the suffix of the target."""
    from flexcam.cli.sources import displayed_motion, open_sources
    from flexcam.plotting.scene.mechanism import build_mechanism
    from flexcam.plotting.solid_files import collect_parts, write_glb, write_stl, write_vtm

    cli.check_number("--instants", instants, 2, _MAX_FRAMES)
    if fields is not None and len(fields) > 1:
        raise refuse("--field", ", ".join(fields), "one field with --format vtm", "", "choose one")
    angle = cli.parse_optional("--at", at, "angle", "deg")
    folder = target.with_name(f"{target.stem}-solids")
    if target.suffix != ".stl":
        check_writable("export", target if target.suffix == ".glb" else folder.with_suffix(".pvd"), overwrite=overwrite)
    (read,) = open_sources([source], None)
    structure = build_structure(build_model(read.case))
    motion, title, still = displayed_motion(read, structure, color=fields[0] if fields else None, angle=angle)
    drawn = build_mechanism(structure)
    if target.suffix == ".stl":
        return write_stl(folder, collect_parts(drawn, motion.at([still])), overwrite=overwrite)
    frames = motion.spread(instants or _FRAMES[target.suffix])
    parts = collect_parts(drawn, motion.at(frames))
    if target.suffix == ".glb":
        return [write_glb(target, parts, drawn.upwards, title, overwrite=overwrite)]
    times = motion.angle / read.case.speed if read.result is None else read.result.response.field_time[-len(motion) :]
    label = motion.label.replace("\n", ", ")
    return write_vtm(folder.with_suffix(".pvd"), parts, times[frames], label, overwrite=overwrite)


def _interpolate(response: Response, count: int | None) -> Response:
    """Return a response at evenly spaced instants; None for its own instants."""
    if count is None:
        return response
    if len(response.time) < 2:
        raise refuse("--instants", "a result with one instant", "two or more", "", "leave --instants out")
    cli.check_number("--instants", count, 2, _MAX_INSTANTS)
    return response.at(np.linspace(float(response.time[0]), float(response.time[-1]), count))


@cli.command("""\
flexcam report results/case.vtkhdf
flexcam report slow.vtkhdf fast.vtkhdf --probe valve -o both.html
flexcam report results/case.vtkhdf --errors --limits --trade --overwrite
""")
def report(
    results: Annotated[list[Path], Parameter(
        help="Result files (.vtkhdf), including those of runs that ended early.")], *,
    output: Annotated[Path | None, Parameter(
        ["-o", "--output"], help="HTML file; in the folder of the first result by default.")] = None,
    probe: Annotated[str | None, Parameter(help=f"Probe whose motion is shown first; {cli.DEFAULT_PROBE}.")] = None,
    errors: Annotated[bool, Parameter(help="Also estimate the errors; this runs the case again.")] = False,
    limits: Annotated[bool, Parameter(help="Also find the speed limits; this takes many runs.")] = False,
    trade: Annotated[bool, Parameter(help="Also compare simpler models; this runs each of them.")] = False,
    overwrite: cli.Overwrite = False, as_json: cli.Json = False,
) -> None:  # fmt: skip
    """Write an HTML report on results: model, warnings, curves, modes, tables and the case.

    The page is a single file and needs no network.
    """
    from flexcam.report.content import ReportOptions, load_subject
    from flexcam.report.page import build_report, render_page

    target = output or results[0].parent / f"{results[0].stem}.html"
    if target.suffix != ".html":
        raise refuse("-o", str(target), "a name that ends in .html")
    check_writable("report", target, overwrite=overwrite)
    subjects = [load_subject(one) for one in results]
    found = build_report(subjects, probe=probe, asked=ReportOptions(errors, limits, trade))
    write_text(target, render_page(found), overwrite=overwrite)
    if as_json:
        warnings = {str(path): list(chapter.warnings) for path, chapter in zip(results, found.chapters, strict=True)}
        print_json({"status": "ok", "file": str(target), "title": found.title, "warnings": warnings})
    else:
        result_console().print(str(target))
