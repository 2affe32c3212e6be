"""Facts about the cams of a case: profile, limits, discontinuities and valve events in one value per cam.

May import `case` and everything below it; `flexcam cam` prints the results.
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
    Joint,
    LiftReport,
    ProfileFault,
    ValveEvent,
    cam_profile,
    event_extremes,
    find_profile_faults,
    harmonics,
    joints,
    minimum_base_radius,
    overlap,
    valve_event,
)
from flexcam.case.builder import build_model
from flexcam.case.reader import has_mechanism, read_cams, read_case
from flexcam.core.errors import InputError, refuse
from flexcam.io import ProfileTable
from flexcam.valvetrain import Cam, valve_ratio

_HARMONICS = 10
_NEGATIVE_LIFT_TOLERANCE = 1e-4
"""Allowed negative lift relative to the maximum lift: a ten-thousandth, less than the grinding tolerance."""


@dataclass(frozen=True, eq=False)
class CamSet:
    """Cams of a file.

    Parameters
    ----------
    name, title
        Name and title of the file.
    cams
        Cams by name.
    ratios
        Valve lift per cam lift, by cam; 1 without a rocker.
    reports
        Smoothing reports, by cam with a lift table.
    speed
        Camshaft speed, rad/s; None if not given.
    """

    name: str
    title: str
    cams: Mapping[str, Cam]
    ratios: Mapping[str, float]
    reports: Mapping[str, LiftReport]
    speed: float | None


@dataclass(frozen=True, eq=False)
class CamFacts:
    """Facts about one cam.

    Parameters
    ----------
    cam
        Cam.
    lift
        Minimum and maximum, m, with their cam angles, rad.
    velocity, acceleration, jerk
        Maximum absolute values, m/rad, m/rad^2, m/rad^3; None for a jerk that is infinite at an acceleration step.
    harmonics
        Amplitudes of the lift's harmonics 1 to 10, m.
    joints
        Boundaries of lift segments, with jumps.
    events
        Valve events at several lift thresholds, by name of the threshold; None if the valve never exceeds it.
    profile
        Profile; None without a follower and base circle.
    findings
        Problems of lift and profile.
    least_base_radius
        Minimum base radius within the limits, m; None without a profile or if there is none.
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
    findings: Sequence[ProfileFault]
    least_base_radius: float | None


def load_cams(path: str | Path, overrides: Sequence[str] = ()) -> CamSet:
    """Read the cams of a case, or of a file with cams alone."""
    path = Path(path)
    if has_mechanism(path):
        case = read_case(path, overrides)
        model = build_model(case)
        ratios = {name: valve_ratio(model, name) for name in model.cams}
        record, cams, speed = case.record, model.cams, case.speed
    else:
        record = read_cams(path, overrides)
        cams = {name: cam.part for name, cam in record.cams.items()}
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
    """Return the facts about a cam."""
    event, profile = cam.event, None
    if cam.follower is not None:
        profile = cam_profile(event, cam.follower, count=count, turn=cam.turn)
    peaks = [max(abs(end.value) for end in event_extremes(event, order)) for order in (1, 2, 3)]
    met = joints(event)
    jerk = None if any(one.steps[2] for one in met) else peaks[2]
    lift, least = event_extremes(event), _minimum_base_radius(cam, event, pressure_angle)
    return CamFacts(
        cam, lift, peaks[0], peaks[1], jerk, tuple(np.abs(harmonics(event, _HARMONICS))[1:].tolist()), met,
        {name: valve_event(event, lift, ratio=ratio) for name, lift in THRESHOLDS.items()}, profile,
        [*_negative_lift_findings(lift), *(find_profile_faults(
            profile, pressure_angle=pressure_angle, cutter=cutter, base_helps=least is not None) if profile else ())],
        least,
    )  # fmt: skip


def _negative_lift_findings(lift: tuple[Extreme, Extreme]) -> list[ProfileFault]:
    """Return the finding of a negative lift larger than the grinding tolerance."""
    least, largest = lift
    if least.value >= -_NEGATIVE_LIFT_TOLERANCE * largest.value:
        return []
    what = "the lift is negative: the cam would be cut into its base circle"
    return [ProfileFault(what, "take another law or table, or smooth less", least.at, least.value, 0.0)]


def _minimum_base_radius(cam: Cam, event: Event, pressure_angle: float) -> float | None:
    if cam.follower is None:
        return None
    try:
        return minimum_base_radius(event, cam.follower, pressure_angle=pressure_angle, turn=cam.turn)
    except InputError:  # no base radius is sufficient: the findings explain the faults of the given one
        return None


def valve_overlaps(facts: Mapping[str, CamFacts]) -> list[tuple[str, str, str, float]]:
    """Return the valve overlap of every pair of cams."""
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
    """Return a profile as curves and columns for output files."""
    curves = {"profile": profile.points}
    if math.isfinite(profile.follower.roller_radius):
        curves["pitch curve"] = profile.pitch
    if cutter is not None:
        curves["cutter path"] = profile.cutter_path(cutter)
    radius = np.where(np.isfinite(profile.radius), profile.radius, 1e9)  # an inflection point: draw it as straight
    columns = {
        "cam angle [deg]": np.degrees(profile.angle), "lift [mm]": 1e3 * profile.lift,
        "velocity [mm/rad]": 1e3 * profile.velocity, "acceleration [mm/rad^2]": 1e3 * profile.acceleration,
        "radius of curvature [mm]": 1e3 * radius, "pressure angle [deg]": np.degrees(profile.pressure_angle),
        "contact offset [mm]": 1e3 * profile.offset, "sliding velocity [mm/rad]": 1e3 * profile.touch.sliding,
    }  # fmt: skip
    return ProfileTable(curves, profile.follower.base_radius, columns)
