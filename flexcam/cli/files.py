"""Commands for files: export, info, schema."""

from __future__ import annotations

import json
from dataclasses import asdict
from pathlib import Path
from typing import Annotated, Literal

import numpy as np
from cyclopts import Parameter

from flexcam.case.builder import build_model
from flexcam.case.reader import read_case
from flexcam.case.records import CaseRecord
from flexcam.cli.app import Json, Overwrite, ResultPath, app
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
)
from flexcam.report.tables import describe_verification, info_table, stats_json
from flexcam.report.terminal import print_json, result_console


@app.command(
    help_prologue="""\
flexcam export results/case.vtkhdf --format pvd --every 5 --field displacement
flexcam export results/case.vtkhdf --paraview
flexcam export results/case.vtkhdf --format csv --probe valve
flexcam export results/case.vtkhdf --format csv --instants 720
flexcam export case.toml --format msh -o meshes
flexcam export case.toml --format inp
"""
)
def export(
    source: Annotated[Path, Parameter(help="Result file; a case file for --format msh and inp.")], *,
    form: Annotated[
        Literal["pvd", "csv", "msh", "inp"],
        Parameter("--format", help="pvd: ParaView; msh: Gmsh 2.2; inp: mesh for Abaqus and CalculiX."),
    ] = "pvd",
    folder: Annotated[Path | None, Parameter(["-o", "--output"], help="Folder; that of the source by default.")] = None,
    every: Annotated[int, Parameter("--every", help="Take every so many of the saved instants or steps.")] = 1,
    fields: Annotated[list[str] | None, Parameter("--field", negative=(), help="pvd: only these point data.")] = None,
    probes: Annotated[list[str] | None, Parameter("--probe", negative=(), help="csv: only these probes.")] = None,
    instants: Annotated[
        int | None, Parameter("--instants", help="csv: so many, evenly spaced, between those of the run too.")
    ] = None,
    macro: Annotated[
        bool, Parameter("--paraview", negative=(), help="pvd: with NAME.paraview.py, which shows it in ParaView.")
    ] = False,
    overwrite: Overwrite = False, as_json: Json = False,
) -> None:  # fmt: skip
    """Write a result as a ParaView collection or CSV table, or a case's mesh for Gmsh, Abaqus or CalculiX."""
    for option, needed, given, why in (
        ("--paraview", "pvd", macro, "the macro opens that collection"),
        ("--field", "pvd", fields is not None, "the collection has fields"),
        ("--probe", "csv", probes is not None, "the table has probes"),
        ("--every", form if form in ("pvd", "csv") else "pvd or csv", every != 1, "a mesh has no instants"),
        ("--instants", "csv", instants is not None, "the table has instants between those of the run"),
    ):
        if given and form != needed:
            raise refuse(option, f"--format {form}", f"--format {needed}", why)
    target = create_folder(source.parent if folder is None else check_folder_name(folder)) / f"{source.stem}.{form}"
    if form in ("msh", "inp"):
        write_mesh(build_model(read_case(source)).mesh, target, overwrite=overwrite)
        files = [target]
    elif form == "csv":
        response = _select_instants(read_result(source).response, instants)
        files = [write_csv(response, target, probes=probes, every=every, overwrite=overwrite)]
    else:
        files = _write_collection(read_result(source), target, every, fields, macro=macro, overwrite=overwrite)
    if as_json:
        print_json({"status": "ok", "files": [str(path) for path in files]})
    else:
        result_console().print(f"{files[0]} ({len(files)} files)" if len(files) > 1 else str(files[0]))
        if macro:
            result_console().print(f"paraview --script={files[1]}")


def _write_collection(
    result: Result, target: Path, every: int, fields: list[str] | None, *, macro: bool, overwrite: bool
) -> list[Path]:
    """Write a collection and its macro after checking that both may be written."""
    if not macro:
        return write_pvd(result, target, every=every, fields=fields, overwrite=overwrite)
    if fields is not None and "displacement" not in fields:
        raise refuse("--field", ", ".join(fields), "displacement among them", "the macro warps by it")
    check_writable("export", macro_path(target), overwrite=overwrite)
    first, *rest = write_pvd(result, target, every=every, fields=fields, overwrite=overwrite)
    shown = (*result.field_names, *result.recovered) if fields is None else tuple(fields)
    degrees = np.degrees(result.response.field_angle[::every]).tolist()
    return [first, write_macro(first, shown, degrees, overwrite=overwrite), *rest]


_MOST_INSTANTS = 10_000_000


def _select_instants(response: Response, count: int | None) -> Response:
    """Return a response at evenly distributed instants; None for all of them."""
    if count is None:
        return response
    if not 2 <= count <= _MOST_INSTANTS or len(response.time) < 2:
        given = f"{count} of a run of {len(response.time)} instants"
        raise refuse("--instants", given, f"2 to {_MOST_INSTANTS}, of a run of 2 or more")
    return response.at(np.linspace(float(response.time[0]), float(response.time[-1]), count))


@app.command(
    help_prologue="""\
flexcam info results/case.vtkhdf
flexcam info results/case.vtkhdf --verify
"""
)
def info(
    result: ResultPath, *,
    verify: Annotated[bool, Parameter("--verify", negative=(), help="Read it all, say whether it is sound.")] = False,
    as_json: Json = False,
) -> None:  # fmt: skip
    """Say what a result file holds: how its run ended, what computed it, what was saved."""
    if verify:
        found = verify_file(result)
        if as_json:
            print_json({"status": "ok", "file": str(result), **asdict(found)})
        else:
            result_console().print(describe_verification(result, found))
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
            "about": {name: text for name, text in read.about.items() if name not in ("case", "resolved")},
            "case": json.loads(read.about["resolved"]),
        })  # fmt: skip
    else:
        result_console().print(info_table(read))


@app.command(help_prologue="flexcam schema > case.schema.json\n")
def schema(*, as_json: Json = False) -> None:
    """Print the JSON Schema of case files, which editors use for completion and checks; it is JSON either way."""
    del as_json
    print_json(
        {"$schema": "https://json-schema.org/draft/2020-12/schema", **CaseRecord.model_json_schema(by_alias=True)}
    )
