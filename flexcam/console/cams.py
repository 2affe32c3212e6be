"""Tables about cams."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import asdict

import numpy as np
from rich.table import Table

from flexcam.cam import Bridge, Finding
from flexcam.cams import CamFacts
from flexcam.console.words import NOISE, degrees, mm
from flexcam.linalg import FloatArray
from flexcam.motion import THRESHOLDS, Extreme, Joint, LiftReport, ValveEvent
from flexcam.terminal import facts, table
from flexcam.units import RPM

_NEGATIVE = 1e-4
"""Part of the largest lift by which a profile may lie within its base circle: less than a cam is ground to."""

_STEPS = (("lift", "mm"), ("velocity", "mm/rad"), ("acceleration", "mm/rad^2"), ("jerk", "mm/rad^3"))


def cam_json(found: CamFacts, report: LiftReport | None) -> dict[str, object]:
    """Return what a cam does as ``--json`` prints it."""
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
    """Return what a cam does."""
    rows = [
        ("lift", _lift(found, ratio)),
        ("largest velocity", _at_speed(found.velocity, "mm/rad", "m/s", 1, speed)),
        ("largest acceleration", _at_speed(found.acceleration, "mm/rad^2", "m/s^2", 2, speed)),
        ("largest jerk", _jerk(found.jerk)),
        ("harmonics 1 to 10", ", ".join(mm(one, 3) for one in found.harmonics) + " mm"),
        *((f"valve open beyond {lift}", _event(event, ratio * found.lift[0].value > THRESHOLDS[lift]))
          for lift, event in found.events.items()),
        *_joints(found.joints),
        *_profile(found, speed),
        *(("attention", _finding(one)) for one in found.findings),
    ]  # fmt: skip
    return facts(f"Cam {name}", rows)


def _lift(found: CamFacts, ratio: float) -> str:
    least, largest = (one.value for one in found.lift)
    low = f"{mm(least)} to " if abs(least) > NOISE * largest else ""
    return f"{low}{mm(largest)} mm" + (f", at the valve x {ratio:g}" if ratio != 1.0 else "")


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
        ("base circle", f"{mm(profile.follower.base_radius)} mm; {_least(found.least_base_radius)}"),
        ("tightest convex radius", _convex(seen.convex)),
        ("tightest hollow", f"radius {mm(seen.hollow.value)} mm {_at(seen.hollow)}" if seen.hollow else "none"),
        ("largest pressure angle", f"{degrees(abs(seen.pressure_angle.value))} deg {_at(seen.pressure_angle)}"),
        ("contact offset", f"{mm(seen.offset[0].value, 5)} to {mm(seen.offset[1].value, 5)} mm"),
        ("largest sliding velocity", _at_speed(abs(seen.sliding.value), "mm/rad", "m/s", 1, speed)),
    ]  # fmt: skip
    return rows


def _convex(tightest: Extreme) -> str:
    if tightest.value <= 0.0:
        return f"none: the profile is undercut {_at(tightest)}"
    return f"{mm(tightest.value)} mm {_at(tightest)}"


def _at(place: Extreme) -> str:
    return f"at {math.degrees(place.at):.4g} deg"


def _least(radius: float | None) -> str:
    if radius is None:
        return "no other keeps this event within the limits"
    return f"least within the limits {mm(radius)} mm" if radius else "any smaller one is within the limits too"


def _finding(one: Finding) -> str:
    if one.kind == "angle":
        measure = f"{degrees(one.value)} deg, allowed at most {degrees(one.limit)} deg"
    else:
        side = f"at least {mm(one.limit, 4)} mm" if one.limit else "above 0"
        measure = f"{mm(one.value, 4)} mm, allowed {side}"
    place = f"at {math.degrees(one.angle):.4g} deg: {measure}"
    return f"{one.what} ({place}); {one.remedy}"


def overlap_table(overlaps: Sequence[tuple[str, str, str, float]]) -> Table:
    """Return how long the valves of two cams are open together."""
    rows = [(f"{one} and {other}", lift, f"{math.degrees(angle):.2f}") for one, other, lift, angle in overlaps]
    return table("Overlap", ("cams", "at a lift of", "crank deg"), rows)


def smoothing_table(name: str, report: LiftReport) -> Table:
    """Return what smoothing changed in a lift table."""
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
    return facts(f"Lift table of {name}", rows)


def read_table(name: str, points: int, angle: FloatArray, lift: FloatArray, hollow: Bridge | None) -> Table:
    """Return a lift that was read from a profile."""
    low, high = (Extreme(float(lift[i]), float(angle[i])) for i in (int(np.argmin(lift)), int(np.argmax(lift))))
    rows = [
        ("points", str(points)),
        ("largest lift", f"{mm(high.value)} mm {_at(high)}"),
        ("least lift", f"{mm(low.value)} mm {_at(low)}"),
    ]
    if low.value < -_NEGATIVE * high.value:
        rows.append(("attention", "the profile lies within the base circle; check its radius and the unit"))
    if hollow is not None:
        place = f"{mm(hollow.point[0], 4)}, {mm(hollow.point[1], 4)} mm"
        said = f"the follower bridges a hollow of the profile: {mm(hollow.depth, 3)} mm are left at {place}"
        rows.append(("attention", f"{said}; a smaller roller follows it"))
    return facts(f"Lift of {name}", rows)
