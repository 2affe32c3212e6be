"""Commands for result files: info, export, report, view."""

from __future__ import annotations

import json
import re
from dataclasses import asdict
from pathlib import Path
from typing import Annotated, Literal

import numpy as np
from cyclopts import Parameter

from flexcam import io
from flexcam.case.builder import build_model
from flexcam.case.reader import read_case
from flexcam.cli import app as cli
from flexcam.cli.sources import displayed_mechanism, open_sources
from flexcam.core.errors import refuse
from flexcam.report.tables import info_table
from flexcam.report.terminal import print_message

_FRAMES, _MAX_FRAMES = {".vtm": 36, ".glb": 72}, 720
_MAX_INSTANTS = 10_000_000


@cli.command("""\
flexcam info results/case.vtkhdf
""")
def info(
    result: Annotated[Path, Parameter(help="Result file (.vtkhdf).")], *,
    as_json: cli.Json = False,
) -> cli.CommandOutput:  # fmt: skip
    """Show the contents of a result file: how its run ended, versions, solver statistics, saved data."""
    read = io.read_result(result)
    response, stats = read.response, read.response.stats
    counts = {"size": stats.size} if stats.size else {}
    content = {
        "run": response.status.cause, "message": response.status.text,
        "stats": asdict(stats) if stats.is_complete else {"steps": stats.steps, **counts},
        "saved_steps": len(response.time), "saved_fields": len(response.field_time),
        "probes": dict(response.outline.probes),
        "channels": dict(response.outline.channels), "fields": [*read.field_names, *read.recovered],
        "about": {name: text for name, text in read.about.items() if name not in ("case", "files", "resolved")},
        "case": json.loads(read.about["resolved"]),
    }  # fmt: skip
    return cli.CommandOutput([info_table(read)], content)


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
        "--field", help="pvd: write only this point data (repeatable); vtm: add this field to the members (one field; "
        "none by default).")] = None,
    probes: Annotated[list[str] | None, Parameter("--probe", help="csv: write only this probe. Repeatable.")] = None,
    instants: Annotated[int | None, Parameter(
        help="csv: number of evenly spaced instants, interpolated between steps; vtm, glb: number of instants of the "
        "last revolution, by default 36 and 72.")] = None,
    at: Annotated[str | None, Parameter(help="stl: cam angle, such as 90deg; by default full lift for "
        "a result file, 0 deg for a case file.")] = None,
    macro: Annotated[bool, Parameter(
        "--paraview", help="pvd: also write NAME.paraview.py, which opens it in ParaView.")] = False,
    overwrite: cli.Overwrite = False, as_json: cli.Json = False,
) -> cli.CommandOutput:  # fmt: skip
    """Convert a result to CSV, ParaView files or solids, or the mesh of a case to Gmsh, Abaqus or CalculiX format.

    stl, vtm and glb contain the parts that flexcam view shows. From a case they show the rigid mechanism.
    """
    for option, forms, is_set, why in (
        ("--paraview", ("pvd",), macro, "the macro opens that collection"),
        ("--field", ("pvd", "vtm"), fields is not None, "it applies only to these formats"),
        ("--probe", ("csv",), probes is not None, "only the table has probes"),
        ("--every", ("pvd", "csv"), every != 1,
         "for vtm and glb use --instants; stl has one instant (--at), a mesh none"),
        ("--instants", ("csv", "vtm", "glb"), instants is not None,
         "format pvd writes the saved instants (see --every), stl a single one (see --at)"),
        ("--at", ("stl",), at is not None, "only format stl writes a single instant"),
    ):  # fmt: skip
        if is_set and form not in forms:
            raise refuse(option, f"--format {form}", f"--format {' or '.join(forms)}", why, f"leave {option} out")
    if every != 1 and instants is not None:
        cli.refuse_options({"--every": every}, "not allowed with --instants, which sets the number of instants")
    folder = source.parent if folder is None else io.check_folder_name(folder)
    target = io.create_folder(folder) / f"{source.stem}.{form}"
    if form in ("msh", "inp"):
        model = build_model(read_case(source))
        io.write_mesh(model.mesh, target, overwrite=overwrite)
        parts = [f"{key}.{name}" for key in ("rigid_links", "superelements") for name in getattr(model, key)]
        if parts:
            print_message(f"Note: the mesh lacks {', '.join(parts)}: connect their nodes in the other program")
        files = [target]
    elif form == "csv":
        response = io.read_result(source, empty=False).response
        if instants is not None:
            if len(response.time) < 2:
                raise refuse("--instants", "a result with one instant", "two or more", "", "leave --instants out")
            cli.check_number("--instants", instants, 2, _MAX_INSTANTS)
            response = response.at(np.linspace(float(response.time[0]), float(response.time[-1]), instants))
        files = [io.write_csv(response, target, probes=probes, every=every, overwrite=overwrite)]
    elif form in ("stl", "vtm", "glb"):
        files = _write_solids(source, target, fields, instants, at, overwrite=overwrite)
    else:
        result = io.read_result(source, empty=False)
        files = _write_collection(result, target, every, fields, macro=macro, overwrite=overwrite)
    text = f"{files[0]} ({len(files)} files)" if len(files) > 1 else str(files[0])
    script = f"\nparaview --script={files[1]}" if macro else ""
    return cli.CommandOutput([text + script], {"files": files})


def _write_collection(
    result: io.Result, target: Path, every: int, fields: list[str] | None, *, macro: bool, overwrite: bool
) -> list[Path]:
    if not macro:
        return io.write_pvd(result, target, every=every, fields=fields, overwrite=overwrite)
    if fields is not None and "displacement" not in fields:
        why = "the script of --paraview shows the deformation"
        raise refuse("--field", ", ".join(fields), "displacement among them", why)
    io.check_writable("export", io.macro_path(target), overwrite=overwrite)
    first, *rest = io.write_pvd(result, target, every=every, fields=fields, overwrite=overwrite)
    names = (*result.field_names, *result.recovered) if fields is None else tuple(fields)
    degrees = np.degrees(result.response.field_angle[::every]).tolist()
    return [first, io.write_macro(first, names, degrees, overwrite=overwrite), *rest]


def _write_solids(
    source: Path, target: Path, fields: list[str] | None, instants: int | None, at: str | None, *, overwrite: bool
) -> list[Path]:
    from flexcam.plotting.solid_files import collect_parts, write_glb, write_stl, write_vtm

    cli.check_number("--instants", instants, 2, _MAX_FRAMES)
    if fields is not None and len(fields) > 1:
        raise refuse("--field", ", ".join(fields), "one field with --format vtm", "", "choose one")
    angle = cli.parse_optional("--at", at, "angle", "deg")
    folder = target.with_name(f"{target.stem}-solids")
    written = {".glb": target, ".vtm": folder.with_suffix(".pvd")}.get(target.suffix)
    if written is not None:
        io.check_writable("export", written, overwrite=overwrite)
    (read,) = open_sources([source], None)
    mechanism, motion, title, still = displayed_mechanism(read, color=fields[0] if fields else None, angle=angle)
    if target.suffix == ".stl":
        return write_stl(folder, collect_parts(mechanism, motion.at([still])), overwrite=overwrite)
    frames = motion.spread(instants or _FRAMES[target.suffix])
    parts = collect_parts(mechanism, motion.at(frames))
    if target.suffix == ".glb":
        return [write_glb(target, parts, mechanism.upwards, title, overwrite=overwrite)]
    times = motion.angle / read.case.speed if read.result is None else read.result.response.field_time[-len(motion) :]
    label = motion.label.replace("\n", ", ")
    return write_vtm(folder.with_suffix(".pvd"), parts, times[frames], label, overwrite=overwrite)


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
    probe: cli.Probe = None,
    errors: Annotated[bool, Parameter(help="Also estimate the errors; this runs the case again.")] = False,
    limits: Annotated[bool, Parameter(help="Also find the speed limits; this takes many runs.")] = False,
    trade: Annotated[bool, Parameter(help="Also compare simpler models; this runs each of them.")] = False,
    overwrite: cli.Overwrite = False, as_json: cli.Json = False,
) -> cli.CommandOutput:  # fmt: skip
    """Write an HTML report on results: model, warnings, curves, modes, tables and the case.

    The page is a single file and needs no network.
    """
    from flexcam.report.content import ReportOptions, load_subject
    from flexcam.report.page import build_report, render_page

    target = output or results[0].parent / f"{results[0].stem}.html"
    if target.suffix != ".html":
        raise refuse("-o", str(target), "a name that ends in .html")
    io.check_writable("report", target, overwrite=overwrite)
    subjects = [load_subject(path) for path in results]
    document = build_report(subjects, probe=probe, asked=ReportOptions(errors, limits, trade))
    io.write_text(target, render_page(document), overwrite=overwrite)
    warnings = {str(path): chapter.warnings for path, chapter in zip(results, document.chapters, strict=True)}
    return cli.CommandOutput([], {"file": target, "title": document.title, "warnings": warnings}, files=[target])


_MIN_SIZE, _MAX_SIZE = 64, 8192  # of a picture, pixels
_MAX_SCALE = 1e6


@cli.command("""\
flexcam view results/intake.vtkhdf
flexcam view results/intake.vtkhdf --color stress_von_mises --scale 50 --save train.gif
flexcam view case.toml --at 120deg --save train.png
flexcam view case.toml --mode 2 --save mode.mp4
""")
def view(
    source: Annotated[Path, Parameter(
        help="Result file (.vtkhdf), or case file (.toml) to show the rigid motion.")], *,
    picture: Annotated[Path | None, Parameter(
        "--save", help="Write a file (.png, .gif, .mp4 or .html) instead of opening a window.")] = None,
    color: Annotated[str | None, Parameter(
        help="Color the members by a saved field or a stress, such as stress_von_mises.")] = None,
    scale: Annotated[float, Parameter(
        help="Magnification of the elastic deformation; the rigid motion is not scaled.")] = 1.0,
    at: Annotated[str | None, Parameter(
        "--at", help="Cam angle of a still picture, or of the start of the motion, such as 120deg.")] = None,
    mode: Annotated[int | None, Parameter(help="Animate a natural mode, by its number in flexcam modes.")] = None,
    size: Annotated[str, Parameter(help="Size of the window or picture in pixels.")] = "1024x768",
    overrides: cli.Overrides = None, overwrite: cli.Overwrite = False, as_json: cli.Json = False,
) -> cli.CommandOutput:  # fmt: skip
    """Show the moving mechanism in 3D, or write a picture or an animation of it.

    The window has a slider over the cam angle. A picture of a result shows full lift by default.
    """
    from flexcam.plotting.rendering import FRAMES, MechanismView, check_output_path, save_view, select_renderer

    if not abs(scale) <= _MAX_SCALE:
        allowed = f"a finite number, at most {_MAX_SCALE:g} in size"
        raise refuse("--scale", scale, allowed, "the deformation would leave the picture")
    angle = cli.parse_optional("--at", at, "angle", "deg")
    match = re.fullmatch(r"(\d+)x(\d+)", size)
    pixels = (int(match[1]), int(match[2])) if match else (0, 0)
    if not all(_MIN_SIZE <= side <= _MAX_SIZE for side in pixels):
        raise refuse("--size", repr(size), f"WIDTHxHEIGHT of {_MIN_SIZE} to {_MAX_SIZE} pixels each, such as 1024x768")
    if picture is not None:
        check_output_path(picture, pixels, overwrite=overwrite)
    (read,) = open_sources([source], overrides)
    mechanism, motion, title, still = displayed_mechanism(read, color=color, mode=mode, angle=angle)
    if picture is not None and picture.suffix == ".html":
        from flexcam.plotting.solid_files import collect_parts, write_page

        frames = sorted({*motion.spread(FRAMES), still})
        labels = [motion.words(i, title, scale) for i in frames]
        parts = collect_parts(mechanism, motion.at(frames), scale)
        write_page(picture, parts, mechanism.view, labels, frames.index(still), motion.label)
    else:
        select_renderer(off_screen=picture is not None)
        stage = MechanismView(mechanism, motion, off_screen=picture is not None, scale=scale, size=pixels, title=title)
        if picture is None:
            stage.open_window(still, swings=mode is not None)
        else:
            save_view(stage, picture, motion.spread(FRAMES), still)
    notes = ["\n  ".join(["Sizes chosen for the drawing:", *mechanism.notes])] if mechanism.notes else []
    json = {"instants": len(motion), "drawn": list(mechanism.notes)}
    return cli.CommandOutput(notes, json, files=[] if picture is None else [picture])
