"""Commands about cams: cam, lift."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Annotated, Literal

import numpy as np
from cyclopts import Parameter

from flexcam.cam import PRESSURE_ANGLE, bridged, lift_from_profile
from flexcam.cams import CamFacts, cam_facts, load_cams, overlaps, profile_table
from flexcam.case import given_follower
from flexcam.checks import did_you_mean, positive, refuse
from flexcam.commands.app import Json, Overrides, Overwrite, app, quantity, tell_unused
from flexcam.commands.targets import apart
from flexcam.console.cams import cam_json, cam_table, overlap_table, read_table, smoothing_table
from flexcam.io import free_to_write, made_folder, named_as_folder, read_profile, write_lift_table, write_profile
from flexcam.terminal import out, print_json

_LEAST_POINTS, _MOST_POINTS = 12, 100_000

CamName = Annotated[str | None, Parameter("--cam", help="Name of the cam; not needed if there is one.")]
Forms = Annotated[list[Literal["csv", "dxf", "vtp"]] | None, Parameter("--format", negative=(), help="All by default.")]


@app.command(
    help_prologue="""\
flexcam cam case.toml
flexcam cam cams.toml --cam intake -o profiles --format dxf --cutter "40 mm"
flexcam cam cams.toml --plot profiles
"""
)
def cam(
    case: Annotated[Path, Parameter(help="Case file, or a file with [cams.NAME] alone.")], *, name: CamName = None,
    folder: Annotated[Path | None, Parameter(["-o", "--output"], help="Folder for the profiles' files.")] = None,
    forms: Forms = None,
    cutter: Annotated[str | None, Parameter(help="Radius of the cutter or grinding wheel, such as '40 mm'.")] = None,
    pressure_angle: Annotated[str, Parameter(help="Largest allowed.")] = f"{math.degrees(PRESSURE_ANGLE):g} deg",
    points: Annotated[int, Parameter(help="Of the profile, per revolution.")] = 720,
    plot: Annotated[Path | None, Parameter(help="Folder for pictures.")] = None,
    plot_format: Annotated[
        Literal["svg", "png", "pdf"] | None, Parameter(help="Of the pictures; svg by default.")
    ] = None,
    overrides: Overrides = None, overwrite: Overwrite = False, as_json: Json = False,
) -> None:  # fmt: skip
    """Say what the cams of a file do: lift, joints, valve events, profile and its limits; write profiles to files."""
    _with_a_folder(folder, forms, plot, plot_format)
    if folder is not None:
        named_as_folder(folder)
    kind = plot_format or "svg"
    cams = load_cams(case, overrides or ())
    tell_unused(overrides)
    if name is not None and name not in cams.cams:
        raise refuse("--cam", repr(name), ", ".join(cams.cams), "", did_you_mean(name, cams.cams))
    wheel = quantity("--cutter", cutter, "length", "mm") if cutter is not None else None
    limit = _pressure_limit(pressure_angle)
    found = {
        one: cam_facts(part, ratio=cams.ratios[one], count=points, pressure_angle=limit, cutter=wheel)
        for one, part in cams.cams.items()
        if name in (None, one)
    }
    _profile_asked(found, folder, cutter)
    _folder_of_pictures(plot)
    files: list[Path] = []
    for one in found:  # before anything is written
        for path in _picture_names(plot / f"{cams.name}-{one}", kind).values() if plot is not None else ():
            free_to_write("picture", path, overwrite=overwrite)
    for one, facts in found.items():
        if folder is not None and facts.profile is not None:
            stem = made_folder(folder) / f"{cams.name}-{one}"
            table = profile_table(facts.profile, wheel)
            files += write_profile(table, stem, forms or ["csv", "dxf", "vtp"], overwrite=overwrite)
        if plot is not None:
            files += _pictures(made_folder(plot) / f"{cams.name}-{one}", kind, facts, overwrite=overwrite)
    pairs = overlaps(found)
    if as_json:
        print_json({
            "status": "ok",
            "cams": {one: cam_json(facts, cams.reports.get(one)) for one, facts in found.items()},
            "overlaps": [dict(zip(("one", "other", "lift", "angle"), pair, strict=True)) for pair in pairs],
            "files": [str(path) for path in files],
        })  # fmt: skip
        return
    for one, facts in found.items():
        out().print(cam_table(one, facts, cams.speed, cams.ratios[one]))
        out().print()
        if one in cams.reports:
            out().print(smoothing_table(one, cams.reports[one]))
            out().print()
    if pairs:
        out().print(overlap_table(pairs))
    for path in files:
        out().print(str(path))


def _with_a_folder(
    folder: Path | None, forms: Sequence[str] | None, plot: Path | None, plot_format: str | None
) -> None:
    """Refuse the form of files that are not asked for."""
    for option, given, other, asked in (
        ("--format", forms, "-o", folder),
        ("--plot-format", plot_format, "--plot", plot),
    ):
        if given and asked is None:
            told, why = given if isinstance(given, str) else ", ".join(given), "no such file is asked for"
            raise refuse(option, told, f"{option} with {other} only", why, f"add {other} FOLDER")


def _profile_asked(found: Mapping[str, CamFacts], folder: Path | None, cutter: str | None) -> None:
    """Refuse what only a profile has, where there is none."""
    for option, given in (("-o", folder), ("--cutter", cutter)):
        if given is not None and not any(one.profile for one in found.values()):
            why, remedy = f"{', '.join(found)} has no profile", "give the cam base_radius and follower"
            raise refuse(option, str(given), "nothing without a profile", why, remedy)


def _folder_of_pictures(plot: Path | None) -> None:
    """Refuse the name of a picture where that of a folder is asked for."""
    if plot is not None and plot.suffix in (".svg", ".png", ".pdf"):
        remedy = f"name a folder; --plot-format {plot.suffix[1:]} says the kind"
        raise refuse("--plot", str(plot), "a folder", "a cam has several pictures", remedy)


def _pressure_limit(text: str) -> float:
    limit = positive("--pressure-angle", quantity("--pressure-angle", text, "angle", "deg"), "rad")
    if limit >= 0.5 * math.pi:
        raise refuse(
            "--pressure-angle", text, "an angle below 90 deg", "at 90 deg nothing moves it", "30 deg is common"
        )
    return limit


def _picture_names(stem: Path, form: str) -> dict[str, Path]:
    return {kind: stem.with_name(f"{stem.name}-{kind}.{form}") for kind in ("lift", "profile", "pressure")}


def _pictures(stem: Path, form: str, facts: CamFacts, *, overwrite: bool) -> list[Path]:
    from flexcam.view import lift_figure, pressure_figure, profile_figure, save_figure

    figures = {"lift": lift_figure({stem.name: facts.cam.event})}
    if facts.profile is not None:
        figures |= {"profile": profile_figure(facts.profile), "pressure": pressure_figure(facts.profile)}
    named = _picture_names(stem, form)
    return [save_figure(figure, named[kind], overwrite=overwrite) for kind, figure in figures.items()]


@app.command(
    help_prologue="""\
flexcam lift profile.csv --follower '{ type = "roller", radius = "9 mm" }' --base-radius "18 mm" -o lift.csv
flexcam lift points.csv --unit mm --follower '{ type = "flat" }' --base-radius "18 mm" --clockwise
"""
)
def lift(
    profile: Annotated[Path, Parameter(help="Points of the profile (.csv), in the frame of the cam.")], *,
    follower: Annotated[str, Parameter(help="As a case writes it, such as '{ type = \"flat\" }'.")],
    base_radius: Annotated[str | None, Parameter(help="Of the base circle, from which the lift counts.")] = None,
    unit: Annotated[Literal["um", "mm", "cm", "m", "in"] | None, Parameter(help="Where the head is silent.")] = None,
    clockwise: Annotated[bool, Parameter(negative=(), help="The cam turns so.")] = False,
    points: Annotated[int, Parameter(help="Of the lift, per revolution.")] = 720,
    output: Annotated[Path | None, Parameter(["-o", "--output"], help="Lift table (.csv) for a case.")] = None,
    overwrite: Overwrite = False, as_json: Json = False,
) -> None:  # fmt: skip
    """Say what a cam given by points of its profile does to a follower, and write the lift as a table."""
    apart({"--output": output}, [profile])
    if base_radius is not None:
        positive("--base-radius", quantity("--base-radius", base_radius, "length", "mm"), "m")
    if not _LEAST_POINTS <= points <= _MOST_POINTS:
        raise refuse("--points", points, f"a whole number from {_LEAST_POINTS} to {_MOST_POINTS}")
    made, turn = given_follower(follower, base_radius, clockwise=clockwise)
    around, xy = np.linspace(0.0, 2.0 * math.pi, points, endpoint=False), read_profile(profile, unit=unit)
    found, hollow = lift_from_profile(xy, made, around, turn=turn), bridged(xy, made, turn=turn)
    files = [] if output is None else [write_lift_table(output, around, found, overwrite=overwrite)]
    if as_json:
        print_json({
            "status": "ok", "points": len(xy), "angle": around.tolist(), "lift": found.tolist(),
            "bridged": None if hollow is None else asdict(hollow), "files": [str(path) for path in files],
        })  # fmt: skip
        return
    out().print(read_table(profile.name, len(xy), around, found, hollow))
    for path in files:
        out().print(f'{path}  (in a case: lift_table = "{path.name}" instead of law, lift, rise and return)')
