"""Commands and tables about cams: cam, lift."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Annotated, Literal

import numpy as np
from cyclopts import Parameter
from rich.table import Table

from flexcam.analysis.cam_analysis import CamFacts, cam_facts, load_cams, profile_table, valve_overlaps
from flexcam.cams import (
    PRESSURE_ANGLE,
    THRESHOLDS,
    Bridge,
    Extreme,
    Joint,
    LiftReport,
    ProfileFault,
    ValveEvent,
    find_bridges,
    lift_from_profile,
)
from flexcam.case.builder import parse_follower
from flexcam.cli.app import Json, Overrides, Overwrite, app, parse_quantity, warn_ignored_keys
from flexcam.cli.arguments import check_distinct_files
from flexcam.core import FloatArray
from flexcam.core.errors import positive, refuse, suggest_name
from flexcam.core.units import RPM
from flexcam.io import check_folder_name, check_writable, create_folder, read_profile, write_lift_table, write_profile
from flexcam.report.formatting import NOISE, format_degrees, format_mm
from flexcam.report.terminal import facts_table, plain_table, print_json, result_console


def describe_sizes(notes: Sequence[str]) -> list[str]:
    """Return sentences about drawn sizes that a case does not give."""
    return ["Drawn with sizes that the case does not give:", *(f"  {note}" for note in notes)] if notes else []


_NEGATIVE_LIFT_TOLERANCE = 1e-4
"""Allowed depth of a profile within its base circle, relative to the maximum lift: less than the grinding tolerance."""

_STEPS = (("lift", "mm"), ("velocity", "mm/rad"), ("acceleration", "mm/rad^2"), ("jerk", "mm/rad^3"))


def cam_json(found: CamFacts, report: LiftReport | None) -> dict[str, object]:
    """Return the facts about a cam for ``--json``."""
    return {
        "lift": found.lift[1].value, "least_lift": found.lift[0].value, "velocity": found.velocity,
        "acceleration": found.acceleration, "jerk": found.jerk, "harmonics": list(found.harmonics),
        "joints": [_joint_json(one) for one in found.joints],
        "valve_events": {name: _event_json(one) for name, one in found.events.items()},
        "profile": _profile_json(found),
        "findings": [asdict(one) for one in found.findings],
        "smoothing": None if report is None else asdict(report),
    }  # fmt: skip


def _joint_json(joint: Joint) -> dict[str, object]:
    return {"angle": joint.angle, "steps": {name: step for (name, _), step in zip(_STEPS, joint.steps, strict=True)}}


def _event_json(event: ValveEvent | None) -> dict[str, float] | None:
    return None if event is None else {**asdict(event), "duration": event.duration, "centre": event.centre}


def _profile_json(found: CamFacts) -> dict[str, object] | None:
    if found.profile is None:
        return None
    seen, hollow = found.profile.extremes, found.profile.extremes.hollow
    return {
        "base_radius": found.profile.follower.base_radius,
        "convex_radius": seen.convex.value, "convex_radius_at": seen.convex.at,
        "hollow_radius": hollow and hollow.value, "hollow_radius_at": hollow and hollow.at,
        "pressure_angle": abs(seen.pressure_angle.value), "pressure_angle_at": seen.pressure_angle.at,
        "contact_offset": [end.value for end in seen.offset],
        "sliding_velocity": abs(seen.sliding.value),
        "least_base_radius": found.least_base_radius,
    }  # fmt: skip


def cam_table(name: str, found: CamFacts, speed: float | None, ratio: float) -> Table:
    """Return the table of the facts about a cam."""
    rows = [
        ("lift", _lift(found, ratio)),
        ("largest velocity", _at_speed(found.velocity, "mm/rad", "m/s", 1, speed)),
        ("largest acceleration", _at_speed(found.acceleration, "mm/rad^2", "m/s^2", 2, speed)),
        ("largest jerk", _jerk(found.jerk)),
        ("harmonics 1 to 10", ", ".join(format_mm(one, 3) for one in found.harmonics) + " mm"),
        *((f"valve open beyond {lift}", _event(event, ratio * found.lift[0].value > THRESHOLDS[lift]))
          for lift, event in found.events.items()),
        *_joints(found.joints),
        *_profile(found, speed),
        *(("attention", _finding(one)) for one in found.findings),
    ]  # fmt: skip
    return facts_table(f"Cam {name}", rows)


def _lift(found: CamFacts, ratio: float) -> str:
    least, largest = (one.value for one in found.lift)
    low = f"{format_mm(least)} to " if abs(least) > NOISE * largest else ""
    return f"{low}{format_mm(largest)} mm" + (f", at the valve x {ratio:g}" if ratio != 1.0 else "")


def _jerk(jerk: float | None) -> str:
    return "infinite: the acceleration steps" if jerk is None else f"{1e3 * jerk:.5g} mm/rad^3"


def _at_speed(value: float, unit: str, at_speed: str, order: int, speed: float | None) -> str:
    text = f"{1e3 * value:.5g} {unit}"
    return text if speed is None else f"{text}, {value * speed**order:.5g} {at_speed} at camshaft {speed / RPM:.6g} rpm"


def _event(event: ValveEvent | None, always: bool) -> str:
    if event is None:
        return "always" if always else "never"
    opens, closes, span = (math.degrees(x) for x in (event.opens, event.closes, event.duration))
    return f"crank {opens:.2f} to {closes:.2f} deg, duration {span:.2f} deg"


def _joints(joints: Sequence[Joint]) -> list[tuple[str, str]]:
    rows: list[tuple[str, str]] = []
    for one in joints:
        named = zip(_STEPS, one.steps, strict=True)
        steps = ", ".join(f"{name} {1e3 * step:+.5g} {unit}" for (name, unit), step in named if step)
        rows.append((f"joint at {math.degrees(one.angle):.4g} deg", f"steps of {steps}" if steps else "smooth"))
    return rows


def _profile(found: CamFacts, speed: float | None) -> list[tuple[str, str]]:
    profile = found.profile
    if profile is None:
        return [("profile", "give base_radius and follower for one")]
    seen = profile.extremes
    rows = [
        ("base circle", f"{format_mm(profile.follower.base_radius)} mm; {_least(found.least_base_radius)}"),
        ("tightest convex radius", _convex(seen.convex)),
        ("tightest hollow", f"radius {format_mm(seen.hollow.value)} mm {_at(seen.hollow)}" if seen.hollow else "none"),
        ("largest pressure angle", f"{format_degrees(abs(seen.pressure_angle.value))} deg {_at(seen.pressure_angle)}"),
        ("contact offset", f"{format_mm(seen.offset[0].value, 5)} to {format_mm(seen.offset[1].value, 5)} mm"),
        ("largest sliding velocity", _at_speed(abs(seen.sliding.value), "mm/rad", "m/s", 1, speed)),
    ]  # fmt: skip
    return rows


def _convex(tightest: Extreme) -> str:
    if tightest.value <= 0.0:
        return f"none: the profile is undercut {_at(tightest)}"
    return f"{format_mm(tightest.value)} mm {_at(tightest)}"


def _at(place: Extreme) -> str:
    return f"at {math.degrees(place.at):.4g} deg"


def _least(radius: float | None) -> str:
    if radius is None:
        return "no other keeps this event within the limits"
    return f"least within the limits {format_mm(radius)} mm" if radius else "any smaller one is within the limits too"


def _finding(one: ProfileFault) -> str:
    if one.kind == "angle":
        measure = f"{format_degrees(one.value)} deg, allowed at most {format_degrees(one.limit)} deg"
    else:
        side = f"at least {format_mm(one.limit, 4)} mm" if one.limit else "above 0"
        measure = f"{format_mm(one.value, 4)} mm, allowed {side}"
    place = f"at {math.degrees(one.angle):.4g} deg: {measure}"
    return f"{one.what} ({place}); {one.remedy}"


def overlap_table(overlaps: Sequence[tuple[str, str, str, float]]) -> Table:
    """Return the table of the valve overlap of two cams."""
    rows = [(f"{one} and {other}", lift, f"{math.degrees(angle):.2f}") for one, other, lift, angle in overlaps]
    return plain_table("Overlap", ("cams", "at a lift of", "crank deg"), rows)


def smoothing_table(name: str, report: LiftReport) -> Table:
    """Return the table of the smoothing of a lift table."""
    before, after = (
        f"{1e3 * low:.4g} to {1e3 * high:.4g} mm/rad^2"
        for low, high in (report.acceleration_before, report.acceleration_after)
    )
    changed = f"{1e6 * report.rms_change:.3g} um rms, {1e6 * report.largest_change:.3g} um at most"
    rows = [
        ("points", str(report.points)),
        ("changed by", f"{changed}, at {math.degrees(report.at):.4g} deg"),
        ("acceleration of the points", before),
        ("acceleration of the spline", after),
        *(("attention", said) for said in report.remarks),
    ]
    return facts_table(f"Lift table of {name}", rows)


def lift_from_profile_table(
    name: str, points: int, angle: FloatArray, lift: FloatArray, hollow: Bridge | None
) -> Table:
    """Return the table of a lift computed from a profile."""
    low, high = (Extreme(float(lift[i]), float(angle[i])) for i in (int(np.argmin(lift)), int(np.argmax(lift))))
    rows = [
        ("points", str(points)),
        ("largest lift", f"{format_mm(high.value)} mm {_at(high)}"),
        ("least lift", f"{format_mm(low.value)} mm {_at(low)}"),
    ]
    if low.value < -_NEGATIVE_LIFT_TOLERANCE * high.value:
        rows.append(("attention", "the profile lies within the base circle; check its radius and the unit"))
    if hollow is not None:
        place = f"{format_mm(hollow.point[0], 4)}, {format_mm(hollow.point[1], 4)} mm"
        said = f"the follower bridges a hollow of the profile: {format_mm(hollow.depth, 3)} mm are left at {place}"
        rows.append(("attention", f"{said}; a smaller roller follows it"))
    return facts_table(f"Lift of {name}", rows)


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
    _check_forms(folder, forms, plot, plot_format)
    if folder is not None:
        check_folder_name(folder)
    kind = plot_format or "svg"
    cams = load_cams(case, overrides or ())
    warn_ignored_keys(overrides)
    if name is not None and name not in cams.cams:
        raise refuse("--cam", repr(name), ", ".join(cams.cams), "", suggest_name(name, cams.cams))
    wheel = parse_quantity("--cutter", cutter, "length", "mm") if cutter is not None else None
    limit = _pressure_limit(pressure_angle)
    found = {
        one: cam_facts(part, ratio=cams.ratios[one], count=points, pressure_angle=limit, cutter=wheel)
        for one, part in cams.cams.items()
        if name in (None, one)
    }
    _check_profile_options(found, folder, cutter)
    _check_figure_folder(plot)
    files: list[Path] = []
    for one in found:  # before files are written
        for path in _picture_names(plot / f"{cams.name}-{one}", kind).values() if plot is not None else ():
            check_writable("picture", path, overwrite=overwrite)
    for one, lobe in found.items():
        if folder is not None and lobe.profile is not None:
            stem = create_folder(folder) / f"{cams.name}-{one}"
            table = profile_table(lobe.profile, wheel)
            files += write_profile(table, stem, forms or ["csv", "dxf", "vtp"], overwrite=overwrite)
        if plot is not None:
            files += _pictures(create_folder(plot) / f"{cams.name}-{one}", kind, lobe, overwrite=overwrite)
    pairs = valve_overlaps(found)
    if as_json:
        print_json({
            "status": "ok",
            "cams": {one: cam_json(facts, cams.reports.get(one)) for one, facts in found.items()},
            "overlaps": [dict(zip(("one", "other", "lift", "angle"), pair, strict=True)) for pair in pairs],
            "files": [str(path) for path in files],
        })  # fmt: skip
        return
    for one, lobe in found.items():
        result_console().print(cam_table(one, lobe, cams.speed, cams.ratios[one]))
        result_console().print()
        if one in cams.reports:
            result_console().print(smoothing_table(one, cams.reports[one]))
            result_console().print()
    if pairs:
        result_console().print(overlap_table(pairs))
    for path in files:
        result_console().print(str(path))


def _check_forms(folder: Path | None, forms: Sequence[str] | None, plot: Path | None, plot_format: str | None) -> None:
    """Raise an error for a file format without an output folder."""
    for option, given, other, asked in (
        ("--format", forms, "-o", folder),
        ("--plot-format", plot_format, "--plot", plot),
    ):
        if given and asked is None:
            told, why = given if isinstance(given, str) else ", ".join(given), "no such file is asked for"
            raise refuse(option, told, f"{option} with {other} only", why, f"add {other} FOLDER")


def _check_profile_options(found: Mapping[str, CamFacts], folder: Path | None, cutter: str | None) -> None:
    """Raise an error for options that require a profile if there is none."""
    for option, given in (("-o", folder), ("--cutter", cutter)):
        if given is not None and not any(one.profile for one in found.values()):
            why, remedy = f"{', '.join(found)} has no profile", "give the cam base_radius and follower"
            raise refuse(option, str(given), "nothing without a profile", why, remedy)


def _check_figure_folder(plot: Path | None) -> None:
    """Raise an error for a file name in the place of a folder of figures."""
    if plot is not None and plot.suffix in (".svg", ".png", ".pdf"):
        remedy = f"name a folder; --plot-format {plot.suffix[1:]} says the kind"
        raise refuse("--plot", str(plot), "a folder", "a cam has several pictures", remedy)


def _pressure_limit(text: str) -> float:
    limit = positive("--pressure-angle", parse_quantity("--pressure-angle", text, "angle", "deg"), "rad")
    if limit >= 0.5 * math.pi:
        raise refuse(
            "--pressure-angle", text, "an angle below 90 deg", "at 90 deg nothing moves it", "30 deg is common"
        )
    return limit


def _picture_names(stem: Path, form: str) -> dict[str, Path]:
    return {kind: stem.with_name(f"{stem.name}-{kind}.{form}") for kind in ("lift", "profile", "pressure")}


def _pictures(stem: Path, form: str, facts: CamFacts, *, overwrite: bool) -> list[Path]:
    from flexcam.plotting.curves import lift_figure, pressure_figure, profile_figure
    from flexcam.plotting.figures import save_figure

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
    check_distinct_files({"--output": output}, [profile])
    if base_radius is not None:
        positive("--base-radius", parse_quantity("--base-radius", base_radius, "length", "mm"), "m")
    if not _LEAST_POINTS <= points <= _MOST_POINTS:
        raise refuse("--points", points, f"a whole number from {_LEAST_POINTS} to {_MOST_POINTS}")
    made, turn = parse_follower(follower, base_radius, clockwise=clockwise)
    around, xy = np.linspace(0.0, 2.0 * math.pi, points, endpoint=False), read_profile(profile, unit=unit)
    found, hollow = lift_from_profile(xy, made, around, turn=turn), find_bridges(xy, made, turn=turn)
    files = [] if output is None else [write_lift_table(output, around, found, overwrite=overwrite)]
    if as_json:
        print_json({
            "status": "ok", "points": len(xy), "angle": around.tolist(), "lift": found.tolist(),
            "bridged": None if hollow is None else asdict(hollow), "files": [str(path) for path in files],
        })  # fmt: skip
        return
    result_console().print(lift_from_profile_table(profile.name, len(xy), around, found, hollow))
    for path in files:
        result_console().print(f'{path}  (in a case: lift_table = "{path.name}" instead of law, lift, rise and return)')
