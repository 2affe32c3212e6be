"""Tables about cams and their synthesis."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import asdict

import numpy as np
from rich.table import Table

from flexcam.cams import CamFacts
from flexcam.design import HarmonicCam, PolydyneCam
from flexcam.linalg import FloatArray
from flexcam.motion import Joint, LiftReport, ValveEvent
from flexcam.synthesis import Synthesized
from flexcam.terminal import facts, table

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
    profile = found.profile
    return {
        "lift": found.cam.event.height, "velocity": found.velocity, "acceleration": found.acceleration,
        "jerk": found.jerk, "harmonics": list(found.harmonics),
        "joints": [_joint_json(one) for one in found.joints],
        "valve_events": {name: _event_json(one) for name, one in found.events.items()},
        "profile": None if profile is None else {
            "base_radius": profile.follower.base_radius,
            "least_radius": float(profile.radius.min()), "least_convex_radius": _least_convex(profile.radius),
            "pressure_angle": float(np.abs(profile.pressure_angle).max()),
            "contact_offset": [float(profile.offset.min()), float(profile.offset.max())],
            "sliding_velocity": float(np.abs(profile.touch.sliding).max()),
            "least_base_radius": found.least_base_radius,
        },
        "findings": [asdict(one) for one in found.findings],
        "smoothing": None if report is None else asdict(report),
    }  # fmt: skip


def _joint_json(joint: Joint) -> dict[str, object]:
    return {"angle": joint.angle, "steps": {name: step for (name, _), step in zip(_STEPS, joint.steps, strict=True)}}


def _event_json(event: ValveEvent | None) -> dict[str, float] | None:
    return None if event is None else {**asdict(event), "duration": event.duration, "centre": event.centre}


def _least_convex(radius: FloatArray) -> float | None:
    convex = radius[radius > 0.0]
    return float(convex.min()) if convex.size else None


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
        ("lift", f"{1e3 * found.cam.event.height:.6g} mm" + (f", at the valve x {ratio:g}" if ratio != 1.0 else "")),
        ("largest velocity", _at_speed(found.velocity, "mm/rad", "m/s", 1, speed)),
        ("largest acceleration", _at_speed(found.acceleration, "mm/rad^2", "m/s^2", 2, speed)),
        ("largest jerk", _jerk(found.jerk)),
        ("harmonics 1 to 10", ", ".join(f"{1e3 * one:.3g}" for one in found.harmonics) + " mm"),
        *((f"valve open beyond {lift}", _event(event)) for lift, event in found.events.items()),
        *_joints(found.joints),
        *_profile(found, speed),
        *(("attention", _finding(one.what, one.angle, one.value, one.limit)) for one in found.findings),
    ]
    return facts(f"Cam {name}", rows)


def _jerk(jerk: float | None) -> str:
    return "infinite: the acceleration steps" if jerk is None else f"{1e3 * jerk:.5g} mm/rad^3"


def _at_speed(value: float, unit: str, at_speed: str, order: int, speed: float | None) -> str:
    text = f"{1e3 * value:.5g} {unit}"
    return (
        text if speed is None else f"{text}, {value * speed**order:.5g} {at_speed} at {speed * 30.0 / math.pi:.6g} rpm"
    )


def _event(event: ValveEvent | None) -> str:
    if event is None:
        return "never, or always"
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
    radius, press, angle = profile.radius, np.abs(profile.pressure_angle), np.degrees(profile.angle)
    low, steep = int(np.argmin(radius)), int(np.argmax(press))
    slide = float(np.abs(profile.touch.sliding).max())
    least = found.least_base_radius
    rows = [
        ("base circle", f"{1e3 * profile.follower.base_radius:.6g} mm; {_least(least)}"),
        ("least radius of curvature", f"{1e3 * radius[low]:.6g} mm at {angle[low]:.4g} deg"),
        ("largest pressure angle", f"{math.degrees(press[steep]):.4g} deg at {angle[steep]:.4g} deg"),
        ("contact offset", f"{1e3 * profile.offset.min():.5g} to {1e3 * profile.offset.max():.5g} mm"),
        ("largest sliding velocity", _at_speed(slide, "mm/rad", "m/s", 1, speed)),
    ]  # fmt: skip
    convex = _least_convex(radius)
    if convex is not None and radius[low] < 0.0:
        rows.insert(2, ("least convex radius", f"{1e3 * convex:.6g} mm"))
    return rows


def _least(radius: float | None) -> str:
    if radius is None:
        return "no other keeps this event within the limits"
    return f"least within the limits {1e3 * radius:.6g} mm"


def _finding(what: str, angle: float, value: float, limit: float) -> str:
    measure = f"{1e3 * value:.4g} mm of {1e3 * limit:.4g}"
    if "angle" in what:
        measure = f"{math.degrees(value):.4g} deg of {math.degrees(limit):.4g}"
    return f"{what} (at {math.degrees(angle):.4g} deg: {measure})"


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
