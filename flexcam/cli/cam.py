"""Command that evaluates cams, and computes the lift of a measured profile: cam."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, replace
from itertools import combinations
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal, cast

import numpy as np
from cyclopts import Group, Parameter
from rich.table import Table

from flexcam import io, plotting
from flexcam.analysis import cam_analysis
from flexcam.analysis.cam_analysis import CamFacts, CamSet
from flexcam.cams import (
    PRESSURE_ANGLE,
    THRESHOLDS,
    FlatFollower,
    LiftReport,
    ProfileFault,
    ValveEvent,
    find_bridges,
    lift_from_profile,
)
from flexcam.case.builder import parse_follower
from flexcam.cli import app as cli
from flexcam.core.errors import refuse, suggest_name
from flexcam.core.units import RPM, format_quantity, to_display_unit
from flexcam.report.terminal import NOISE, facts_table, format_csv, json_value, plain_table

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_CASE, _PROFILE = Group("Cams of a case file", sort_key=1), Group("Cam from a measured profile", sort_key=2)
_MIN_POINTS, _MAX_POINTS = 12, 100_000
_STEPS = {"lift": "m", "velocity": "m/rad", "acceleration": "m/rad^2", "jerk": "m/rad^3"}
_ProfileFormat = Literal["csv", "dxf", "vtp"]
_LengthUnit = Literal["um", "mm", "cm", "m", "in", "thou"]
# SI units of the numbers of a card by the last part of their names; others are lengths.
_UNITS = {
    "velocity": "m/rad", "sliding_velocity": "m/rad", "acceleration": "m/rad^2", "jerk": "m/rad^3", "ratio": "1",
    **dict.fromkeys(
        ("angle", "opens", "closes", "duration", "centre", "centreline", "tdc", "pressure_angle", "convex_radius_at",
         "hollow_radius_at", "pressure_angle_at", "drive_angle", "shift"), "rad"),
}  # fmt: skip


def _cam_json(facts: CamFacts, report: LiftReport | None) -> dict[str, object]:
    after_tdc, phaser = None, facts.cam.phaser
    if facts.tdc is not None:
        crank = {
            name: event and {"opens": facts.after_tdc(event.opens), "closes": facts.after_tdc(event.closes)}
            for name, event in facts.events.items()
        }
        after_tdc = {"centreline": facts.centreline_after_tdc, "valve_events": crank}
    return {
        "lift": facts.lift[1].value, "least_lift": facts.lift[0].value, "velocity": facts.velocity,
        "acceleration": facts.acceleration, "jerk": facts.jerk, "harmonics": list(facts.harmonics),
        "joints": [{"angle": j.angle, "steps": dict(zip(_STEPS, j.steps, strict=True))} for j in facts.joints],
        "valve_events": {name: _event_json(event) for name, event in facts.events.items()},
        "follower_events": {name: _event_json(event) for name, event in facts.follower_events.items()},
        "profile": _profile_json(facts),
        "findings": facts.findings, "smoothing": report,
        "centreline": facts.centreline, "tdc": facts.tdc, "ratio": facts.ratio, "lash": facts.lash,
        "valve_lift": _valve_lift(facts), "after_tdc": after_tdc,
        "phaser": phaser
        and [{"drive_angle": at, "shift": shift} for at, shift in zip(phaser.angles, phaser.shifts, strict=True)],
    }  # fmt: skip


def _valve_lift(facts: CamFacts) -> float:
    return float(facts.valve_lift(np.array([facts.lift[1].value]))[0])


def _event_json(event: ValveEvent | None) -> dict[str, float] | None:
    return None if event is None else {**asdict(event), "duration": event.duration, "centre": event.centre}


def _profile_json(facts: CamFacts) -> dict[str, object] | None:
    if facts.profile is None:
        return None
    peaks, hollow = facts.profile.extremes, facts.profile.extremes.hollow
    return {
        "base_radius": facts.profile.follower.base_radius,
        "convex_radius": peaks.convex.value, "convex_radius_at": peaks.convex.at,
        "hollow_radius": hollow and hollow.value, "hollow_radius_at": hollow and hollow.at,
        "pressure_angle": abs(peaks.pressure_angle.value), "pressure_angle_at": peaks.pressure_angle.at,
        "contact_offset": [end.value for end in peaks.offset],
        "sliding_velocity": abs(peaks.sliding.value),
        "least_base_radius": facts.least_base_radius,
        "face_diameter": facts.face_diameter, "min_face_diameter": facts.min_face_diameter,
    }  # fmt: skip


def _card_rows(content: object, *name: str) -> Iterator[tuple[str, float, str]]:
    """Yield the numbers of a card: quantity, value and unit."""
    if isinstance(content, float):
        factor, unit = to_display_unit(_UNITS.get(name[-1], "m"))
        yield " ".join(name).replace("_", " "), factor * content, unit
    elif isinstance(content, list):
        yield from _card_rows(dict(enumerate(cast("list[object]", content), start=1)), *name)
    elif isinstance(content, dict):
        for part, value in cast("dict[object, object]", content).items():
            yield from _card_rows(value, *name, str(part))


def _cam_table(name: str, facts: CamFacts, cams: CamSet) -> Table:
    part = "valve open" if cams.turns == 2.0 else "output"  # of a machine
    if name in cams.clearances:  # it closes the valve
        part, facts = "follower", replace(facts, ratio=1.0, lash=0.0, events=facts.follower_events)
    speed, ratio, lash, phaser = cams.speed, facts.ratio, facts.lash, facts.cam.phaser
    shifts = [f"{math.degrees(end):.4g}" for end in sorted({min(phaser.shifts), max(phaser.shifts)})] if phaser else []
    infinite = "infinite: the acceleration is discontinuous"
    events = [(part, facts.events, ratio, lash)]
    if ratio != 1.0 or lash:
        events.insert(0, ("follower", facts.follower_events, 1.0, 0.0))
    rows = [
        ("lift", _lift(facts)),
        ("lobe centreline", _centreline(facts, cams.turns)),
        *([("phaser", f"turns the cam by {' to '.join(shifts)} deg; the angles in this table are without it")]
          if phaser else []),
        ("max velocity", _at_speed(facts.velocity, "m/rad", "m/s", 1, speed)),
        ("max acceleration", _at_speed(facts.acceleration, "m/rad^2", "m/s^2", 2, speed)),
        ("max jerk", infinite if facts.jerk is None else format_quantity("m/rad^3", facts.jerk, digits=5)),
        ("harmonics 1 to 10", format_quantity("m", *facts.harmonics, digits=3, separator=", ")),
        *([("lash at the follower", format_quantity("m", lash))] if lash else []),
        *([("running clearance", format_quantity("m", cams.clearances[name]))] if name in cams.clearances else []),
        *((f"{part} above {lift}",
           _event(facts, event, factor * (facts.lift[0].value - gap) > facts.checking_lifts[lift], cams.turns))
          for part, part_events, factor, gap in events for lift, event in part_events.items()),
        *((f"segment boundary {_at(joint.angle)}", _describe_steps(joint.steps)) for joint in facts.joints),
        *_profile(facts, speed),
        *(("warning", _finding(fault)) for fault in facts.findings),
    ]  # fmt: skip
    return facts_table(f"Cam {name}", rows)


def _lift(facts: CamFacts) -> str:
    minimum, maximum = (extreme.value for extreme in facts.lift)
    ends = (minimum, maximum) if abs(minimum) > NOISE * maximum else (maximum,)
    how = ", ".join([f"x {facts.ratio:g}"] * (facts.ratio != 1.0) + ["less the lash"] * (facts.lash != 0.0))
    valve = f", at the valve {format_quantity('m', _valve_lift(facts))} ({how})" if how else ""
    return f"{format_quantity('m', *ends)}{valve}"


def _centreline(facts: CamFacts, turns: float) -> str:
    cam = f"cam {math.degrees(facts.centreline):.2f} deg"
    if facts.centreline_after_tdc is None:
        return cam + (" (set tdc for this cam to get angles relative to the dead centres)" if turns == 2.0 else "")
    return f"{cam}, crank {_from_dead_centre(facts.centreline_after_tdc)}"


def _from_dead_centre(crank_angle: float | None, centre: float = 0.0) -> str:
    """Return a crank angle from overlap TDC or a bottom dead centre; both in rad after the former."""
    offset = round(math.degrees(math.remainder((crank_angle or 0.0) - centre, 4.0 * math.pi)), 2)
    return f"{abs(offset):.2f} deg {'B' if offset < 0.0 else 'A'}{'BDC' if centre else 'TDC'}"


def _at_speed(value: float, unit: str, at_speed: str, order: int, speed: float | None) -> str:
    text = format_quantity(unit, value, digits=5)
    if speed is None:
        return text
    return f"{text}, {format_quantity(at_speed, value * speed**order, digits=5)} at camshaft {speed / RPM:.6g} rpm"


def _event(facts: CamFacts, event: ValveEvent | None, always: bool, turns: float) -> str:
    """Return an event from the dead centres of its stroke, or in degrees of the shaft whose speed the case gives."""
    if event is None:
        return "always" if always else "never"
    if (middle := facts.centreline_after_tdc) is not None:
        valve, centres = ("E", (-math.pi, 0.0)) if middle < 0.0 else ("I", (0.0, math.pi))
        ends = zip((event.opens, event.closes), centres, strict=True)
        opens, closes = (_from_dead_centre(facts.after_tdc(angle), centre) for angle, centre in ends)
        return f"{valve}VO {opens}, {valve}VC {closes}, duration {math.degrees(event.duration):.2f} deg"
    opens, closes, span = (0.5 * turns * math.degrees(x) for x in (event.opens, event.closes, event.duration))
    shaft = "crank" if turns == 2.0 else "cam"
    return f"{shaft} {opens:.2f} to {closes:.2f} deg, duration {span:.2f} deg"


def _describe_steps(steps: Sequence[float]) -> str:
    named = ((name, step, *to_display_unit(_STEPS[name])) for name, step in zip(_STEPS, steps, strict=True))
    jumps = (f"{name} jumps by {factor * step:+.5g} {symbol}" for name, step, factor, symbol in named if step)
    return ", ".join(jumps) or "smooth"


def _profile(facts: CamFacts, speed: float | None) -> list[tuple[str, str]]:
    profile = facts.profile
    if profile is None:
        return [("profile", f"none: give the cam {' and '.join(facts.cam.missing)}")]
    peaks, minimum = profile.extremes, "smaller radii meet the limits too"
    if facts.least_base_radius is None:
        minimum = "no radius meets the limits with this lift"
    elif facts.least_base_radius:
        flat, angle = isinstance(profile.follower, FlatFollower), f"{math.degrees(facts.allowed_pressure_angle):g} deg"
        limits = "undercut" if flat else f"undercut or a pressure angle above {angle}"
        minimum = f"{limits} at radii below {format_quantity('m', facts.least_base_radius)}"
    hollow = "none" if peaks.hollow is None else f"{format_quantity('m', peaks.hollow.value)} {_at(peaks.hollow.at)}"
    convex = format_quantity("m", peaks.convex.value) if peaks.convex.value > 0.0 else "none: the profile is undercut"
    rows = [
        ("base circle radius", f"{format_quantity('m', profile.follower.base_radius)}; {minimum}"),
        ("min convex radius", f"{convex} {_at(peaks.convex.at)}"),
        ("min concave radius", hollow),
        ("max pressure angle",
         f"{format_quantity('rad', abs(peaks.pressure_angle.value), digits=4)} {_at(peaks.pressure_angle.at)}"),
        ("lever arm of contact force", format_quantity("m", *(end.value for end in peaks.offset), digits=5)),
    ]  # fmt: skip
    if facts.min_face_diameter is not None:
        rows.append(("min face diameter", _face(facts, facts.min_face_diameter)))
    if math.isinf(profile.follower.roller_radius):  # a roller turns instead
        rows.append(("max sliding velocity", _at_speed(abs(peaks.sliding.value), "m/rad", "m/s", 1, speed)))
    return rows


def _face(facts: CamFacts, smallest: float) -> str:
    """Return the face diameter that contains the contact line, the given one, and the offset that rotates the face."""
    width, diameter, arm = facts.cam.width, facts.face_diameter, facts.rotation_arm
    text = "width of the cam not given" if width is None else f"cam width {format_quantity('m', width)}"
    if arm:
        text += f"; the tappet spins, as the contact is {format_quantity('m', arm)} from its axis"
    elif diameter is not None:
        text += "; the tappet does not spin, as there is no axial_offset and no crown with taper"
    has = format_quantity("m", smallest, digits=4)
    if diameter is not None:
        has += f"{', but' if diameter < smallest else ';'} face_diameter is {format_quantity('m', diameter)}"
    return f"{has} ({text})"


def _at(angle: float) -> str:
    return f"at {math.degrees(angle):.4g} deg"


def _finding(fault: ProfileFault) -> str:
    unit = "rad" if fault.kind == "angle" else "m"
    value, limit = (format_quantity(unit, number, digits=4) for number in (fault.value, fault.limit))
    allowed = f"at most {limit}" if unit == "rad" else f"at least {limit}" if fault.limit else "above 0"
    return f"{fault.what} ({value} {_at(fault.angle)}, must be {allowed}); {fault.remedy}"


@cli.command("""\
flexcam cam case.toml
flexcam cam cams.toml --cam intake -o profiles --format dxf --cutter "40 mm"
flexcam cam cams.toml --plot pictures
flexcam cam --from-profile points.csv --follower '{ type = "roller", radius = "9 mm" }' --base-radius "18 mm" -o lift.csv
flexcam cam --from-profile points.csv --unit mm --follower '{ type = "flat" }' --base-radius "18 mm" --clockwise
""")  # noqa: E501 - a command to a line
def cam(
    case: Annotated[Path | None, Parameter(
        group=_CASE, help="Case file, or a file with only format = 1 and [cams.NAME] tables.")] = None, *,
    name: Annotated[cli.CamName, Parameter(group=_CASE)] = None,
    forms: Annotated[list[_ProfileFormat] | None, Parameter(
        "--format", group=_CASE, help="Format of the profile files with -o; all by default.")] = None,
    cutter: Annotated[str | None, Parameter(
        group=_CASE, help="Radius of the cutter or grinding wheel, such as '40 mm'.")] = None,
    pressure_angle: Annotated[str | None, Parameter(
        group=_CASE, help=f"Allowed pressure angle; {math.degrees(PRESSURE_ANGLE):g} deg by default.")] = None,
    checking_lifts: Annotated[list[str] | None, Parameter(
        "--checking-lift", group=_CASE, help="Lift for opening, closing and overlap in addition to 1 mm and "
        "0.05 in, such as '0.1 mm'. Repeatable.")] = None,
    plot: Annotated[Path | None, Parameter(
        group=_CASE, help="Also draw lift, profile, pressure angle and valve timing to this folder.")] = None,
    plot_format: Annotated[Literal["svg", "png", "pdf"] | None, Parameter(
        group=_CASE, help="Format of the figures; svg by default.")] = None,
    overrides: Annotated[cli.Overrides, Parameter(group=_CASE)] = None,
    profile: Annotated[Path | None, Parameter(
        "--from-profile", group=_PROFILE, help="Points of a cam profile (.csv), in the frame of the cam.")] = None,
    follower: Annotated[str | None, Parameter(
        group=_PROFILE, help="Follower as in a case, such as '{ type = \"flat\" }'.")] = None,
    base_radius: Annotated[str | None, Parameter(
        group=_PROFILE, help="Radius of the base circle, where the lift is zero.")] = None,
    unit: Annotated[_LengthUnit | None, Parameter(
        group=_PROFILE, help="Unit of the points, if the header of the file names none.")] = None,
    clockwise: Annotated[bool, Parameter(group=_PROFILE, help="The cam turns clockwise.")] = False,
    points: Annotated[int, Parameter(help="Points of the profile or of the lift table per revolution.")] = 720,
    output: Annotated[Path | None, Parameter(
        ["-o", "--output"], help="Folder of the profile files; with --from-profile: lift table (.csv).")] = None,
    units: cli.Units = None, overwrite: cli.Overwrite = False, as_json: cli.Json = False,
) -> cli.CommandOutput:  # fmt: skip
    """Show cam card, profile and limits of the cams in a file, or compute the lift of a measured profile.

    With -o it writes the profiles for manufacture (CSV, DXF, VTP). With --from-profile it reads points of a profile
    instead of a case, and -o writes the lift of its follower as a table for a case.
    """
    if profile is not None:
        of_case = {
            "CASE": case, "--cam": name, "--format": forms, "--cutter": cutter, "--pressure-angle": pressure_angle,
            "--checking-lift": checking_lifts, "--plot": plot, "--plot-format": plot_format, "--set": overrides,
        }  # fmt: skip
        cli.refuse_options(of_case, "not allowed with --from-profile, which reads no case")
    of_profile = {"--follower": follower, "--base-radius": base_radius, "--unit": unit, "--clockwise": clockwise}
    cli.refuse_without("--from-profile", of_profile, present=profile is not None)
    cli.check_number("--points", points, _MIN_POINTS, _MAX_POINTS)
    if profile is not None:
        return _lift_of_profile(profile, follower, base_radius, unit, clockwise, points, output, overwrite=overwrite)
    if case is None:
        raise refuse("cam", "nothing", "a case file, a file of cams, or --from-profile FILE")
    cli.refuse_without("-o", {"--format": forms}, present=output is not None)
    cli.refuse_without("--plot", {"--plot-format": plot_format}, present=plot is not None)
    if output is not None:
        io.check_folder_name(output)
    cams = cam_analysis.load_cams(case, overrides or ())
    cli.warn_ignored_keys(overrides)
    wheel = cli.parse_optional("--cutter", cutter, "length", "mm")
    if name is not None and name not in cams.cams:
        raise refuse("--cam", repr(name), ", ".join(cams.cams), "", suggest_name(name, cams.cams))
    limit = PRESSURE_ANGLE
    if pressure_angle is not None:
        limit = _positive_quantity("--pressure-angle", pressure_angle, "angle", "deg")
        if limit >= 0.5 * math.pi:
            why, remedy = "at 90 deg the cam jams", "30 deg is common"
            raise refuse("--pressure-angle", pressure_angle, "an angle below 90 deg", why, remedy)
    lifts = {text: _positive_quantity("--checking-lift", text, "length", "mm") for text in checking_lifts or ()}
    by_cam = {
        key: cam_analysis.cam_facts(
            lobe, count=points, pressure_angle=limit, cutter=wheel, checking_lifts=THRESHOLDS | lifts,
            ratio=cams.ratios[key], lash=cams.lashes[key], tdc=cams.tdcs[key],
        )
        for key, lobe in cams.cams.items()
        if name in (None, key)
    }  # fmt: skip
    followers = [facts.profile.follower for facts in by_cam.values() if facts.profile]
    if pressure_angle is not None and followers and all(isinstance(shape, FlatFollower) for shape in followers):
        why, remedy = "flat followers have no pressure angle", "leave --pressure-angle out"
        raise refuse("--pressure-angle", pressure_angle, "a cam with a roller follower", why, remedy)
    for option, value in (("-o", output), ("--cutter", cutter)):
        if value is not None and not any(facts.profile for facts in by_cam.values()):
            why, remedy = f"{', '.join(by_cam)} has no profile", "give the cam base_radius and follower"
            raise refuse(option, str(value), "nothing without a profile", why, remedy)
    files = _write_cam_files(cams.name, by_cam, plot, plot_format or "svg", output, forms, wheel, overwrite=overwrite)
    return replace(_describe_cams(cams, by_cam), files=files)


def _positive_quantity(option: str, text: str, dimension: str, unit: str) -> float:
    if (value := cli.parse_quantity(option, text, dimension, unit)) > 0.0:
        return value
    raise refuse(option, text, "a finite value above zero")


def _write_cam_files(
    name: str, by_cam: Mapping[str, CamFacts], plot: Path | None, form: str, folder: Path | None,
    forms: Sequence[_ProfileFormat] | None, cutter: float | None, *, overwrite: bool,
) -> list[Path]:  # fmt: skip
    if plot is not None and plot.suffix in (".svg", ".png", ".pdf"):
        remedy = f"name a folder; --plot-format {plot.suffix[1:]} selects the format"
        raise refuse("--plot", str(plot), "a folder", "a cam has several figures", remedy)
    figures = {} if plot is None else {plot / f"{stem}.{form}": fig for stem, fig in _draw_cams(name, by_cam).items()}
    card = folder / f"{name}-card.csv" if folder is not None and "csv" in (forms or ["csv"]) else None
    for path in (*figures, *([] if card is None else [card])):  # before files are written
        io.check_writable("picture" if path in figures else "output", path, overwrite=overwrite)
    files: list[Path] = []
    for key, facts in by_cam.items():
        if folder is not None and facts.profile is not None:
            table = cam_analysis.profile_table(facts.profile, cutter)
            target = io.create_folder(folder) / f"{name}-{key}"
            files += io.write_profile(table, target, forms or ["csv", "dxf", "vtp"], overwrite=overwrite)
    if card is not None:
        rows = ((key, *row) for key, facts in by_cam.items() for row in _card_rows(json_value(_cam_json(facts, None))))
        text = format_csv(("cam", "quantity", "value", "unit"), rows)
        files.append(io.write_text(card, text, overwrite=overwrite))
    return files + [plotting.figures.save_figure(fig, path, overwrite=overwrite) for path, fig in figures.items()]


def _draw_cams(name: str, by_cam: Mapping[str, CamFacts]) -> dict[str, Figure]:
    curves, cylinders, figures = plotting.curves, cam_analysis.cylinders(by_cam), dict[str, "Figure"]()
    for key, facts in by_cam.items():
        stem = f"{name}-{key}"
        figures[f"{stem}-lift"] = curves.lift_figure({stem: facts.cam.event})
        if facts.profile is not None:
            figures[f"{stem}-profile"] = curves.profile_figure(facts.profile)
            figures[f"{stem}-pressure"] = curves.pressure_figure(facts.profile)
    return figures | {f"{name}-{'-'.join(cylinder)}-timing": curves.timing_figure(cylinder) for cylinder in cylinders}


def _describe_cams(cams: CamSet, by_cam: Mapping[str, CamFacts]) -> cli.CommandOutput:
    pairs = cam_analysis.valve_overlaps(by_cam)
    json = {
        "cams": {key: _cam_json(facts, cams.reports.get(key)) for key, facts in by_cam.items()},
        "overlaps": [dict(zip(("one", "other", "lift", "angle"), pair, strict=True)) for pair in pairs],
        "lobe_separations": [
            {"one": first, "other": second, "angle": by_cam[first].separation(by_cam[second])}
            for first, second in combinations(by_cam, 2)
        ],
    }
    parts: list[Table] = []
    for key, facts in by_cam.items():
        parts.append(_cam_table(key, facts, cams))
        if report := cams.reports.get(key):
            changed = f"{1e6 * report.rms_change:.3g} um rms, max {1e6 * report.largest_change:.3g} um"
            rows = [
                ("points", str(report.points)),
                ("points moved by smoothing", f"{changed} {_at(report.at)}"),
                ("acceleration of the points", format_quantity("m/rad^2", *report.acceleration_before, digits=4)),
                ("acceleration of the spline", format_quantity("m/rad^2", *report.acceleration_after, digits=4)),
                *(("warning", remark) for remark in report.remarks),
            ]
            parts.append(facts_table(f"Lift table of {key}", rows))
    crossed = [
        (f"{first} and {second}", f"{math.degrees(by_cam[first].separation(by_cam[second])):.2f}",
         lift, f"{math.degrees(angle):.2f}")
        for first, second, lift, angle in pairs if by_cam[first].may_overlap(by_cam[second])
    ]  # fmt: skip
    if crossed:
        head = ("cams", "lobe separation, cam deg", "at a lift of", "overlap, crank deg")
        parts.append(plain_table("Lobe separation and overlap", head, crossed))
    return cli.CommandOutput(parts, json)


def _lift_of_profile(
    profile: Path, follower: str | None, base_radius: str | None, unit: _LengthUnit | None, clockwise: bool,
    points: int, output: Path | None, *, overwrite: bool,
) -> cli.CommandOutput:  # fmt: skip
    cli.check_distinct_files({"--output": output}, [profile])
    if follower is None:
        raise refuse("--follower", "nothing", "the follower as in a case, such as '{ type = \"flat\" }'")
    if base_radius is not None:
        _positive_quantity("--base-radius", base_radius, "length", "mm")
    shape, turn = parse_follower(follower, base_radius, clockwise=clockwise)
    angle, xy = np.linspace(0.0, 2.0 * math.pi, points, endpoint=False), io.read_profile(profile, unit=unit)
    lift, bridge = lift_from_profile(xy, shape, angle, turn=turn), find_bridges(xy, shape, turn=turn)
    files = [] if output is None else [io.write_lift_table(output, angle, lift, overwrite=overwrite)]
    json = {"points": len(xy), "angle": angle, "lift": lift, "bridged": bridge}
    low, high = (int(find(lift)) for find in (np.argmin, np.argmax))
    rows = [
        ("points", str(len(xy))),
        ("max lift", f"{format_quantity('m', lift[high])} {_at(angle[high])}"),
        ("min lift", f"{format_quantity('m', lift[low])} {_at(angle[low])}"),
    ]
    if lift[low] < -cam_analysis.NEGATIVE_LIFT_TOLERANCE * np.abs(xy).max():
        rows.append(("warning", "the profile lies inside the base circle; check its radius and the unit"))
    if bridge is not None:
        place = format_quantity("m", *bridge.point, digits=4, separator=", ")
        gap = format_quantity("m", bridge.depth, digits=3)
        text = f"the follower bridges a hollow of the profile, with a gap of {gap} at {place}"
        roller = "a smaller roller" if math.isfinite(shape.roller_radius) else "only a roller smaller than the hollow"
        rows.append(("warning", f"{text}; {roller} follows the profile"))
    tables = [facts_table(f"Lift of {profile.name}", rows)]
    return cli.CommandOutput(tables, json, files=files, describe_file=cli.describe_lift_file)
