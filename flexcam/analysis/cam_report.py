"""What the cams of a case do: profile, limits, joints and valve events in one value per cam.

May import `case` and everything below it; `flexcam cam` prints what stands here.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from flexcam.cams import (
    PRESSURE_ANGLE,
    THRESHOLDS,
    CamProfile,
    Event,
    Extreme,
    Finding,
    Joint,
    LiftReport,
    ValveEvent,
    cam_profile,
    event_extremes,
    findings,
    harmonics,
    joints,
    minimum_base_radius,
    overlap,
    valve_event,
)
from flexcam.case.builder import build_model
from flexcam.case.reader import holds_mechanism, read_cams, read_case
from flexcam.core.errors import InputError, refuse
from flexcam.io import ProfileTable
from flexcam.valvetrain import Cam, valve_ratio

_HARMONICS = 10
_NEGATIVE = 1e-4
"""Part of the largest lift below zero that nothing is made of: a ten-thousandth, less than a cam is ground to."""


@dataclass(frozen=True, eq=False)
class CamSet:
    """The cams of a file.

    Parameters
    ----------
    name, title
        Of the file.
    cams
        By name.
    ratios
        Valve lift per cam lift, by cam; 1 where no rocker is between them.
    reports
        What smoothing changed, by cam with a lift table.
    speed
        Of the camshaft, rad/s; None where it is not said.
    """

    name: str
    title: str
    cams: Mapping[str, Cam]
    ratios: Mapping[str, float]
    reports: Mapping[str, LiftReport]
    speed: float | None


@dataclass(frozen=True, eq=False)
class CamFacts:
    """What one cam does.

    Parameters
    ----------
    cam
        The cam.
    lift
        Least and largest, m, with their cam angles, rad.
    velocity, acceleration, jerk
        Largest absolute values, m/rad, m/rad^2, m/rad^3; None for a jerk that is infinite where the acceleration steps.
    harmonics
        Amplitudes of the lift's harmonics 1 to 10, m.
    joints
        Where stretches meet, with steps.
    events
        When the valve is open beyond some lifts, by what the lift is called; None where it never is.
    profile
        None where no follower and base circle are given.
    findings
        What is wrong with lift and profile.
    least_base_radius
        Smallest base circle within the limits, m; None without profile or where there is none.
    """

    cam: Cam
    lift: tuple[Extreme, Extreme]
    velocity: float
    acceleration: float
    jerk: float | None
    harmonics: tuple[float, ...]
    joints: Sequence[Joint]
    events: Mapping[str, ValveEvent | None]
    profile: CamProfile | None
    findings: Sequence[Finding]
    least_base_radius: float | None


def load_cams(path: str | Path, overrides: Sequence[str] = ()) -> CamSet:
    """Read the cams of a case, or of a file with cams alone."""
    path = Path(path)
    if holds_mechanism(path):
        case = read_case(path, overrides)
        model = build_model(case)
        ratios = {name: valve_ratio(model, name) for name in model.cams}
        record, cams, speed = case.record, model.cams, case.speed
    else:
        record = read_cams(path, overrides)
        cams = {name: cam.made() for name, cam in record.cams.items()}
        ratios, speed = dict.fromkeys(cams, 1.0), record.speed
    if not cams:
        raise refuse("cams", f"none in {path.name}", "one or more tables [cams.NAME]")
    tables = {name: cam.lift_table for name, cam in record.cams.items()}
    reports = {name: table.report for name, table in tables.items() if table and table.report}
    return CamSet(path.stem, record.title, cams, ratios, reports, speed)


def cam_facts(
    cam: Cam, *, ratio: float = 1.0, count: int = 720, pressure_angle: float = PRESSURE_ANGLE,
    cutter: float | None = None,
) -> CamFacts:  # fmt: skip
    """Return what a cam does."""
    event, profile = cam.event, None
    if cam.follower is not None:
        profile = cam_profile(event, cam.follower, count=count, turn=cam.turn)
    peaks = [max(abs(end.value) for end in event_extremes(event, order)) for order in (1, 2, 3)]
    met = joints(event)
    jerk = None if any(one.steps[2] for one in met) else peaks[2]
    lift, least = event_extremes(event), _least_base(cam, event, pressure_angle)
    return CamFacts(
        cam, lift, peaks[0], peaks[1], jerk, tuple(np.abs(harmonics(event, _HARMONICS))[1:].tolist()), met,
        {name: valve_event(event, lift, ratio=ratio) for name, lift in THRESHOLDS.items()}, profile,
        [*_negative(lift), *(findings(
            profile, pressure_angle=pressure_angle, cutter=cutter, base_helps=least is not None) if profile else ())],
        least,
    )  # fmt: skip


def _negative(lift: tuple[Extreme, Extreme]) -> list[Finding]:
    """Return the finding of a lift below the base circle, beyond what grinding could make of it."""
    least, largest = lift
    if least.value >= -_NEGATIVE * largest.value:
        return []
    what = "the lift is negative: the cam would be cut into its base circle"
    return [Finding(what, "take another law or table, or smooth less", least.at, least.value, 0.0)]


def _least_base(cam: Cam, event: Event, pressure_angle: float) -> float | None:
    if cam.follower is None:
        return None
    try:
        return minimum_base_radius(event, cam.follower, pressure_angle=pressure_angle, turn=cam.turn)
    except InputError:  # no base circle will do: the findings say what is wrong with this one
        return None


def overlaps(facts: Mapping[str, CamFacts]) -> list[tuple[str, str, str, float]]:
    """Return how long the valves of every two cams are open together."""
    names = list(facts)
    found: list[tuple[str, str, str, float]] = []
    for i, one in enumerate(names):
        for other in names[i + 1 :]:
            for lift in THRESHOLDS:
                first, second = facts[one].events[lift], facts[other].events[lift]
                if first and second:
                    found.append((one, other, lift, overlap(first, second)))
    return found


def profile_table(profile: CamProfile, cutter: float | None = None) -> ProfileTable:
    """Return a profile as curves and columns, for files."""
    curves = {"profile": profile.points}
    if math.isfinite(profile.follower.roller_radius):
        curves["pitch curve"] = profile.pitch
    if cutter is not None:
        curves["cutter path"] = profile.cutter_path(cutter)
    radius = np.where(np.isfinite(profile.radius), profile.radius, 1e9)  # a point of inflection: as good as straight
    columns = {
        "cam angle [deg]": np.degrees(profile.angle), "lift [mm]": 1e3 * profile.lift,
        "velocity [mm/rad]": 1e3 * profile.velocity, "acceleration [mm/rad^2]": 1e3 * profile.acceleration,
        "radius of curvature [mm]": 1e3 * radius, "pressure angle [deg]": np.degrees(profile.pressure_angle),
        "contact offset [mm]": 1e3 * profile.offset, "sliding velocity [mm/rad]": 1e3 * profile.touch.sliding,
    }  # fmt: skip
    return ProfileTable(curves, profile.follower.base_radius, columns)
