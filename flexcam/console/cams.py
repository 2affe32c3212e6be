"""Tables about cams and their synthesis."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import asdict

from rich.table import Table

from flexcam.cam import Finding
from flexcam.cams import CamFacts
from flexcam.design import HarmonicCam, PolydyneCam
from flexcam.motion import THRESHOLDS, Extreme, Joint, LiftReport, ValveEvent
from flexcam.synthesis import Synthesized
from flexcam.terminal import facts, table

_NOTHING = 1e-12
"""A length (m) or an angle (rad) below this is the rounding of a zero."""

_NOISE = 1e-9
"""Part of the largest lift below which the least one is not worth a word."""

_STEPS = (("lift", "mm"), ("velocity", "mm/rad"), ("acceleration", "mm/rad^2"), ("jerk", "mm/rad^3"))


def cam_json(found: CamFacts, report: LiftReport | None) -> dict[str, object]:
    """Return what a cam does as ``--json`` prints it.

    Parameters
    ----------
    found
        The facts.
    report
        What smoothing changed; None without a lift table.

    Returns
    -------
    dict
        SI, angles in rad.
    """
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
    """Return what a cam does.

    Parameters
    ----------
    name
        Of the cam.
    found
        The facts.
    speed
        Camshaft speed, rad/s; None where it is not said.
    ratio
        Valve lift per cam lift.

    Returns
    -------
    Table
        For rich.
    """
    rows = [
        ("lift", _lift(found, ratio)),
        ("largest velocity", _at_speed(found.velocity, "mm/rad", "m/s", 1, speed)),
        ("largest acceleration", _at_speed(found.acceleration, "mm/rad^2", "m/s^2", 2, speed)),
        ("largest jerk", _jerk(found.jerk)),
        ("harmonics 1 to 10", ", ".join(_mm(one, 3) for one in found.harmonics) + " mm"),
        *((f"valve open beyond {lift}", _event(event, ratio * found.lift[0].value > THRESHOLDS[lift]))
          for lift, event in found.events.items()),
        *_joints(found.joints),
        *_profile(found, speed),
        *(("attention", _finding(one)) for one in found.findings),
    ]  # fmt: skip
    return facts(f"Cam {name}", rows)


def _lift(found: CamFacts, ratio: float) -> str:
    least, largest = (one.value for one in found.lift)
    low = f"{_mm(least)} to " if abs(least) > _NOISE * largest else ""
    return f"{low}{_mm(largest)} mm" + (f", at the valve x {ratio:g}" if ratio != 1.0 else "")


def _mm(value: float, digits: int = 6) -> str:
    """Return a length in millimetres; what is only the rounding of a zero is one."""
    return f"{0.0 if abs(value) < _NOTHING else 1e3 * value:.{digits}g}"


def _jerk(jerk: float | None) -> str:
    return "infinite: the acceleration steps" if jerk is None else f"{1e3 * jerk:.5g} mm/rad^3"


def _at_speed(value: float, unit: str, at_speed: str, order: int, speed: float | None) -> str:
    text = f"{1e3 * value:.5g} {unit}"
    return (
        text if speed is None else f"{text}, {value * speed**order:.5g} {at_speed} at {speed * 30.0 / math.pi:.6g} rpm"
    )


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
        ("base circle", f"{_mm(profile.follower.base_radius)} mm; {_least(found.least_base_radius)}"),
        ("tightest convex radius", _convex(seen.convex)),
        ("tightest hollow", f"radius {_mm(seen.hollow.value)} mm {_at(seen.hollow)}" if seen.hollow else "none"),
        ("largest pressure angle", f"{_degrees(abs(seen.pressure_angle.value))} deg {_at(seen.pressure_angle)}"),
        ("contact offset", f"{_mm(seen.offset[0].value, 5)} to {_mm(seen.offset[1].value, 5)} mm"),
        ("largest sliding velocity", _at_speed(abs(seen.sliding.value), "mm/rad", "m/s", 1, speed)),
    ]  # fmt: skip
    return rows


def _convex(tightest: Extreme) -> str:
    if tightest.value <= 0.0:
        return f"none: the profile is undercut {_at(tightest)}"
    return f"{_mm(tightest.value)} mm {_at(tightest)}"


def _at(place: Extreme) -> str:
    return f"at {math.degrees(place.at):.4g} deg"


def _degrees(angle: float) -> str:
    """Return an angle in degrees; what is only the rounding of a zero is one."""
    return f"{0.0 if abs(angle) < _NOTHING else math.degrees(angle):.4g}"


def _least(radius: float | None) -> str:
    if radius is None:
        return "no other keeps this event within the limits"
    return f"least within the limits {_mm(radius)} mm" if radius else "any smaller one is within the limits too"


def _finding(one: Finding) -> str:
    if one.kind == "angle":
        measure = f"{_degrees(one.value)} deg, allowed at most {_degrees(one.limit)} deg"
    else:
        side = f"at least {_mm(one.limit, 4)} mm" if one.limit else "above 0"
        measure = f"{_mm(one.value, 4)} mm, allowed {side}"
    place = f"at {math.degrees(one.angle):.4g} deg: {measure}"
    return f"{one.what} ({place}); {one.remedy}"


def overlap_table(overlaps: Sequence[tuple[str, str, str, float]]) -> Table:
    """Return how long the valves of two cams are open together.

    Parameters
    ----------
    overlaps
        The two cams, the lift, and the crank angle, rad.

    Returns
    -------
    Table
        For rich.
    """
    rows = [(f"{one} and {other}", lift, f"{math.degrees(angle):.2f}") for one, other, lift, angle in overlaps]
    return table("Overlap", ("cams", "at a lift of", "crank deg"), rows)


def smoothing_table(name: str, report: LiftReport) -> Table:
    """Return what smoothing changed in a lift table.

    Parameters
    ----------
    name
        Of the cam.
    report
        The report.

    Returns
    -------
    Table
        For rich.
    """
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
    ]
    return facts(f"Lift table of {name}", rows)


def synthesis_json(found: Synthesized) -> dict[str, object]:
    """Return a law found as ``--json`` prints it.

    Parameters
    ----------
    found
        The law and its bounds.

    Returns
    -------
    dict
        Numbers of the normalized law.
    """
    c = found.criteria
    return {
        "family": found.family, "objective": found.objective, "family_bound": found.bound, "gap": found.gap,
        "bound_over_all_laws": found.bound_all, "Cv": c.Cv, "Ca": c.Ca, "Cj": c.Cj, "Cm": c.Cm, "rms": c.rms[1],
        "broken": list(c.broken), "converged": found.converged, "not_converged": list(found.open),
    }  # fmt: skip


def synthesis_table(found: Synthesized) -> Table:
    """Return a law found, and how good it is.

    Parameters
    ----------
    found
        The law and its bounds.

    Returns
    -------
    Table
        For rich.
    """
    c = found.criteria
    bound = "none: this objective is not convex, the law is the best nearby"
    if found.bound is not None and found.gap is not None:
        bound = f"{found.bound:.9g}; the law is at most {found.gap:.1e} above it (duality gap)"
    every = "not known"
    if found.bound_all:
        above = 100.0 * (found.objective / found.bound_all - 1.0)
        every = f"{found.bound_all:.6g}; the law is {above:.2f} % above it"
    rows = [
        ("objective", f"{found.objective:.9g}"),
        *(("not converged", said) for said in found.open),
        ("no law of the family has less than", bound),
        ("no law at all has less than", every),
        ("C_v, C_a, C_j, C_m", ", ".join("infinite" if x is None else f"{x:.6g}" for x in (c.Cv, c.Ca, c.Cj, c.Cm))),
        *(("not met", said) for said in c.broken),
    ]
    return facts(f"Best of {found.family}", rows)


def pareto_table(front: Sequence[Synthesized]) -> Table:
    """Return a front of laws.

    Parameters
    ----------
    front
        The laws.

    Returns
    -------
    Table
        For rich.
    """
    rows = [
        (str(i), *(f"{x:.5g}" if x is not None else "infinite" for x in (c.Cv, c.Ca, c.Cj, c.Cm)),
         "-" if one.gap is None else f"{one.gap:.0e}", "yes" if one.converged else "no")
        for i, one in enumerate(front, start=1) for c in [one.criteria]
    ]  # fmt: skip
    return table(f"Pareto front of {front[0].family}", ("no.", "C_v", "C_a", "C_j", "C_m", "gap", "converged"), rows)


def harmonic_table(found: HarmonicCam) -> Table:
    """Return a cam of few harmonics.

    Parameters
    ----------
    found
        The cam.

    Returns
    -------
    Table
        For rich.
    """
    fit = found.fit
    rows = [
        (
            "harmonics",
            f"{found.count}; {found.limit} lie below the first mode, {found.frequency / (2.0 * math.pi):.4g} Hz",
        ),
        ("distance in the dwells", f"{1e6 * fit.strict_deviation:.4g} um"),
        ("distance elsewhere", f"{1e6 * fit.deviation:.4g} um, {1e6 * fit.rms_deviation:.4g} um rms"),
        ("largest lift", f"{1e3 * fit.event.height:.6g} mm"),
    ]
    return facts("Lift of few harmonics", rows)


def polydyne_table(found: PolydyneCam) -> Table:
    """Return a polydyne cam at its speed and off it.

    Parameters
    ----------
    found
        The cam.

    Returns
    -------
    Table
        For rich.
    """
    rows = [
        (f"{speed * 30.0 / math.pi:.6g}", f"{1e6 * plain:.4g}", f"{1e6 * compensated:.4g}")
        for speed, plain, compensated in zip(
            found.speeds.tolist(), found.plain.tolist(), found.compensated.tolist(), strict=True
        )
    ]
    head = ("camshaft rpm", "plain cam, um", "polydyne cam, um")
    return table(f"Distance from the wanted motion; design speed {found.speed * 30.0 / math.pi:.6g} rpm", head, rows)


def spectrum_table(spectra: Mapping[str, Sequence[float]], ratios: Sequence[float]) -> Table:
    """Return residual vibrations side by side.

    Parameters
    ----------
    spectra
        Amplitudes over lift by law.
    ratios
        Rise times over the period.

    Returns
    -------
    Table
        For rich.
    """
    rows = [(name, *(f"{value:.6f}" for value in values)) for name, values in spectra.items()]
    return table("Residual vibration over lift, by rise time over period", ("law", *(f"{r:g}" for r in ratios)), rows)
