"""Cams of a case: profile, limits, valve events; harmonic and polydyne cams designed for its train."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from itertools import combinations
from pathlib import Path

import numpy as np

from flexcam.analysis.preparation import contact_probe, prepare_without_periodic_search, scalar_probe
from flexcam.cams import (
    PRESSURE_ANGLE,
    THRESHOLDS,
    CamProfile,
    Event,
    Extreme,
    FlatFollower,
    HarmonicFit,
    Joint,
    LiftReport,
    Polydyne,
    ProfileFault,
    Transfer,
    ValveEvent,
    cam_profile,
    centreline,
    event_extremes,
    find_profile_faults,
    harmonic_fit,
    harmonics,
    harmonics_below,
    joints,
    minimum_base_radius,
    off_design_deviation,
    overlap,
    polydyne,
    valve_event,
)
from flexcam.case.builder import build_model
from flexcam.case.case import CamsRecord, Case, CaseRecord
from flexcam.case.reader import has_mechanism, read_cams, read_case
from flexcam.core import FloatArray
from flexcam.core.errors import InputError, refuse, suggest_name
from flexcam.core.units import RPM
from flexcam.dynamics import outline
from flexcam.io import ProfileTable
from flexcam.valvetrain import (
    Cam,
    Model,
    build_structure,
    follower_train,
    largest_lashes,
    lift_transfer,
    modes_on_the_lift,
    opposed_contacts,
    valve_ratio,
)

_HARMONICS = 10
NEGATIVE_LIFT_TOLERANCE = 1e-4
"""Allowed negative lift relative to the maximum lift, or to the size of a profile: less than the grinding tolerance."""


@dataclass(frozen=True, eq=False)
class CamSet:
    """Cams of a file."""

    #: `name`, `title`: name and title of the file
    name: str
    title: str
    cams: Mapping[str, Cam]  #: cams by name
    ratios: Mapping[str, float]  #: valve lift per cam lift, by cam; 1 without a rocker
    lashes: Mapping[str, float]  #: lash that the lift takes up, reduced to the follower, m, by cam
    phases: Mapping[str, float]  #: cam angle at which the rise or the zero of the lift table lies, rad, by cam
    #: cam angle at overlap TDC, rad, by cam; None if not given
    tdcs: Mapping[str, float | None]
    reports: Mapping[str, LiftReport]  #: smoothing reports, by cam with a lift table
    speed: float | None  #: camshaft speed, rad/s; None if not given
    #: revolutions of the shaft whose angle events are given in, per camshaft revolution: 1 if the case gives the speed
    #: of the camshaft, otherwise 2
    turns: float = 2.0
    #: running clearance of each closing cam of a desmodromic pair, m: the lash to the valve less the lift
    clearances: Mapping[str, float] = field(default_factory=dict[str, float])


@dataclass(frozen=True, eq=False)
class CamFacts:
    """Facts about one cam."""

    cam: Cam
    lift: tuple[Extreme, Extreme]  #: minimum and maximum, m, with their cam angles, rad
    #: `velocity`, `acceleration`, `jerk`: maximum absolute values, m/rad, m/rad^2, m/rad^3; None for a jerk that is
    #: infinite at an acceleration step
    velocity: float
    acceleration: float
    jerk: float | None
    harmonics: tuple[float, ...]  #: amplitudes of the lift's harmonics 1 to 10, m
    joints: Sequence[Joint]  #: boundaries of lift segments, with jumps
    #: `events`, `follower_events`: events of the valve and of the follower at several lift thresholds, by name of the
    #: threshold; None if it never exceeds it
    events: Mapping[str, ValveEvent | None]
    follower_events: Mapping[str, ValveEvent | None]
    profile: CamProfile | None  #: profile; None without a follower and base circle
    findings: Sequence[ProfileFault]  #: problems of lift and profile
    #: minimum base radius within the limits, m; None without a profile or if there is none
    least_base_radius: float | None
    allowed_pressure_angle: float  #: limit of the pressure angle, rad
    centreline: float  #: cam angle of the maximum lift, rad
    #: `ratio`, `lash`: valve lift per cam lift, and the lash at the follower, m, which delays the valve
    ratio: float
    lash: float
    tdc: float | None  #: cam angle at overlap TDC, rad; None if not given
    checking_lifts: Mapping[str, float]  #: lifts at which the events are evaluated, m, by name

    @property
    def face_diameter(self) -> float | None:
        """Diameter of the follower's flat face, m; None if not given."""
        return self.cam.follower.face_diameter if isinstance(self.cam.follower, FlatFollower) else None

    @property
    def rotation_arm(self) -> float:
        """Distance from the axis of a flat follower to its contact along the shaft, m."""
        return self.cam.follower.rotation_arm if isinstance(self.cam.follower, FlatFollower) else 0.0

    @property
    def min_face_diameter(self) -> float | None:
        """Diameter of a flat face that just contains the contact line over the revolution, m; None for others."""
        if self.profile is None or not isinstance(self.cam.follower, FlatFollower):
            return None
        maximum = max(abs(end.value) for end in self.profile.extremes.offset)
        return 2.0 * self.cam.follower.face_radius(maximum, self.cam.width)

    def separation(self, other: CamFacts) -> float:
        """Return the angle between the centrelines of two cams, rad of the camshaft, up to pi."""
        return abs(math.remainder(self.centreline - other.centreline, 2.0 * math.pi))

    def may_overlap(self, other: CamFacts) -> bool:
        """Return whether two cams may overlap: exhaust and intake of one cylinder, or not known."""
        first, second = self.centreline_after_tdc, other.centreline_after_tdc
        if first is None or second is None:
            return True
        return len(cylinders({"one": self, "other": other})) == 1 and (first < 0.0) != (second < 0.0)

    def valve_lift(self, lift: FloatArray) -> FloatArray:
        """Return the lift of the valve for a lift of the cam, m."""
        return np.maximum(self.ratio * (lift - self.lash), 0.0)

    def after_tdc(self, crank_angle: float) -> float | None:
        """Return a crank angle from overlap TDC, rad from -2 pi to 2 pi; None without one."""
        return None if self.tdc is None else math.remainder(crank_angle - 2.0 * self.tdc, 4.0 * math.pi)

    @property
    def centreline_after_tdc(self) -> float | None:
        """Crank angle of the maximum lift after top dead centre, rad; negative for an exhaust cam."""
        return self.after_tdc(2.0 * self.centreline)


def load_cams(path: str | Path, overrides: Sequence[str] = ()) -> CamSet:
    """Read the cams of a case, or of a file with cams alone."""
    path = Path(path)
    if has_mechanism(path):
        return case_cams(read_case(path, overrides))
    record = read_cams(path, overrides)
    cams = {name: cam.part for name, cam in record.cams.items()}
    return _cam_set(path, record, cams, dict.fromkeys(cams, 1.0), dict.fromkeys(cams, 0.0), record.speed)


def case_cams(case: Case) -> CamSet:
    """Return the cams of a case."""
    model = build_model(case)
    ratios = {name: valve_ratio(model, name) for name in model.cams}
    lashes = largest_lashes(model)
    opposed = (model.cam_contacts[name].cam for name in opposed_contacts(model))
    clearances = {name: lashes[name] - event_extremes(model.cams[name].event)[1].value for name in opposed}
    cams = _cam_set(case.path, case.record, model.cams, ratios, lashes, case.speed, case.turns)
    return replace(cams, clearances={name: gap for name, gap in clearances.items() if gap > 0.0})


def _cam_set(
    path: Path, record: CaseRecord | CamsRecord, cams: Mapping[str, Cam], ratios: Mapping[str, float],
    lashes: Mapping[str, float], speed: float | None, turns: float = 2.0,
) -> CamSet:  # fmt: skip
    if not cams:
        raise refuse("cams", f"none in {path.name}", "one or more tables [cams.NAME]")
    tables = {name: cam.lift_table for name, cam in record.cams.items()}
    reports = {name: table.report for name, table in tables.items() if table and table.report}
    phases = {name: cam.start_angle for name, cam in record.cams.items()}
    tdcs = {name: cam.tdc for name, cam in record.cams.items()}
    return CamSet(path.stem, record.title, cams, ratios, lashes, phases, tdcs, reports, speed, turns)


def cam_facts(
    cam: Cam, *, ratio: float = 1.0, lash: float = 0.0, tdc: float | None = None, count: int = 720,
    pressure_angle: float = PRESSURE_ANGLE, cutter: float | None = None,
    checking_lifts: Mapping[str, float] = THRESHOLDS,
) -> CamFacts:  # fmt: skip
    """Return the facts about a cam; the lash at the follower, m, delays the valve."""
    event, profile, base_radius = cam.event, None, None
    lift, boundaries = event_extremes(event), joints(event)
    findings: list[ProfileFault] = []
    if lift[0].value < (minimum := -NEGATIVE_LIFT_TOLERANCE * lift[1].value):
        what = "the lift is negative: the cam would be cut into its base circle"
        remedy = "use another law or table, or smooth less"
        findings.append(ProfileFault(what, remedy, lift[0].at, lift[0].value, minimum))
    if cam.follower is not None:
        profile = cam_profile(event, cam.follower, count=count, turn=cam.turn)
        with suppress(InputError):  # no base radius is sufficient: the findings explain the faults of the given one
            base_radius = minimum_base_radius(event, cam.follower, pressure_angle=pressure_angle, turn=cam.turn)
        helps = base_radius is not None
        findings += find_profile_faults(
            profile, pressure_angle=pressure_angle, cutter=cutter, base_helps=helps, width=cam.width
        )
    velocity, acceleration, jerk = (max(abs(end.value) for end in event_extremes(event, n)) for n in (1, 2, 3))
    return CamFacts(
        cam, lift, velocity, acceleration, None if any(joint.steps[2] for joint in boundaries) else jerk,
        tuple(np.abs(harmonics(event, _HARMONICS))[1:].tolist()), boundaries,
        {name: valve_event(event, height, ratio=ratio, lash=ratio * lash) for name, height in checking_lifts.items()},
        {name: valve_event(event, height) for name, height in checking_lifts.items()}, profile, findings, base_radius,
        pressure_angle, centreline(event), ratio, lash, tdc, checking_lifts,
    )  # fmt: skip


def valve_overlaps(facts: Mapping[str, CamFacts]) -> list[tuple[str, str, str, float]]:
    """Return the valve overlap of every pair of cams."""
    overlaps: list[tuple[str, str, str, float]] = []
    for cam1, cam2 in combinations(facts, 2):
        for lift, first in facts[cam1].events.items():
            if first and (second := facts[cam2].events[lift]):
                overlaps.append((cam1, cam2, lift, overlap(first, second)))
    return overlaps


def cylinders(facts: Mapping[str, CamFacts]) -> list[dict[str, CamFacts]]:
    """Return the cams with the same top dead centre, as far as it is given."""
    groups: dict[float, dict[str, CamFacts]] = {}
    for name, cam in facts.items():
        if cam.tdc is not None:
            angle = round(cam.tdc % (2.0 * math.pi), _ANGLE_DECIMALS) % round(2.0 * math.pi, _ANGLE_DECIMALS)
            groups.setdefault(angle, {})[name] = cam
    return list(groups.values())


_ANGLE_DECIMALS = 6  # decimals of a cam angle, rad, in which those of the same dead centre agree


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
        "lever arm of contact force [mm]": 1e3 * profile.offset,
        "sliding velocity [mm/rad]": 1e3 * profile.touch.sliding,
    }  # fmt: skip
    return ProfileTable(curves, profile.follower.base_radius, columns)


SPEED_RATIOS = (0.25, 0.5, 0.75, 0.9, 1.0, 1.1)
"""Fractions of the design speed at which a polydyne cam is evaluated."""


@dataclass(frozen=True, eq=False)
class HarmonicCam:
    """Harmonic lift for a train."""

    fit: HarmonicFit  #: fitted lift and its deviation from the desired one
    count: int  #: number of harmonics
    frequency: float  #: first natural frequency of the train that the cam contact excites, rad/s
    limit: int  #: maximum number of harmonics below that frequency at the speed of the case
    phase: float  #: cam angle of the start of the rise, rad, which the fitted lift contains


@dataclass(frozen=True, eq=False)
class PolydyneCam:
    """Polydyne cam for a train."""

    design: Polydyne
    speed: float  #: design speed, rad/s
    speeds: FloatArray  #: evaluated speeds, rad/s, shape (n,)
    probe: str | None  #: scalar probe that follows the desired motion; None for a single mass
    #: `plain`, `compensated`: maximum deviation of the probe from the desired motion at these speeds, m or rad, shape
    #: (n,): with the original cam and with this one. Infinite at resonance.
    plain: FloatArray
    compensated: FloatArray
    #: ratio of the probe's motion to cam lift of the rigid train; 1 for a single mass. The deviations include it.
    ratio: float
    phase: float  #: cam angle of the start of the rise, rad, which the design contains


def harmonic_cam(
    case: Case, cam: str | None, *, tolerance: float, count: int | None = None, bound: float | None = None
) -> HarmonicCam:
    """Return a harmonic lift below the lowest mode of a case's train that the cam contact excites.

    A closed contact prescribes a displacement: the modes are those of the train in contact with its cam at full lift
    (C. Li, 2014, eqs. 5-6). Under a published load the follower is free, a mass on its spring.
    """
    model = build_model(case)
    name = _select_cam(model.cams, cam)
    contact = _contact_name(model, name)
    excited = modes_on_the_lift(model, contact, case.speed)
    if not excited.relevant_modes:
        why = "no vibration mode moves this contact"
        raise refuse(f"contacts.{contact}", "no spring that it moves", "a train on a spring", why, "add a spring")
    frequency = float(excited.model_modes.modes.omegas[excited.relevant_modes[0]])
    limit = harmonics_below(frequency, case.speed)
    if count is None and limit < 1:
        given = f"{frequency / (2.0 * math.pi):.4g} Hz at {case.speed / RPM:.6g} rpm"
        why = "no harmonic lies below the lowest mode that the cam excites"
        raise refuse("count", given, "a lower speed, a stiffer train, or a number of harmonics", why, "give --count")
    number = limit if count is None else count
    fit = harmonic_fit(model.cams[name].event, number, tolerance=tolerance, bound=bound)
    return HarmonicCam(fit, number, frequency, limit, case.record.cams[name].start_angle)


def polydyne_cam(
    case: Case, cam: str | None, *, probe: str | None = None, speed: float | None = None, count: int = 60
) -> PolydyneCam:
    """Return the cam with which a probe of the flexible train moves as in the rigid train with the case's cam."""
    ready = prepare_without_periodic_search(case)
    model, system = ready.model, ready.problem.system
    name, omega_0 = _select_cam(model.cams, cam), case.speed if speed is None else speed
    contact, structure = _contact_name(model, name), build_structure(model)
    part = model.cam_contacts[contact]
    point = contact_probe(ready, contact) if probe is None else scalar_probe(ready, probe)
    if point is None:  # no probe is on the train of this cam
        point, row = part.follower, structure.row(part.follower, part.direction)
    else:
        row = np.concatenate([probe.rows for probe in system.probes])[outline(system).columns(point)][0]
    train = follower_train(structure, part, f"contacts.{contact}.follower")
    if not train.moves(row):
        why, remedy = f"cams.{name} does not move it", "name another probe, or leave --probe out"
        raise refuse("--probe", point, "a point and component that the cam moves", why, remedy)
    ratio, transfer = float(train.motion @ row), lift_transfer(model, contact, row, omega_0)
    event, phase = model.cams[name].event, case.record.cams[name].start_angle
    found = _evaluate_design(event, phase, lambda omega: transfer(omega) / ratio, omega_0, abs(ratio), count)
    return replace(found, probe=point)


def design_polydyne(cams: CamSet, cam: str | None, transfer: Transfer, speed: float, count: int) -> PolydyneCam:
    """Return the cam with which a train follows the lift of a given cam, from the transfer function of the train."""
    name = _select_cam(cams.cams, cam)
    return _evaluate_design(cams.cams[name].event, cams.phases[name], transfer, speed, 1.0, count)


def _evaluate_design(
    event: Event, phase: float, transfer: Transfer, speed: float, ratio: float, count: int
) -> PolydyneCam:
    design = polydyne(event, transfer, speed, count=count)
    plain = Polydyne(design.target, design.target, 0.0)
    speeds = speed * np.array(SPEED_RATIOS)
    before, after = (ratio * off_design_deviation(cam, transfer, speeds.tolist()) for cam in (plain, design))
    return PolydyneCam(design, speed, speeds, None, before, after, ratio, phase)


def _contact_name(model: Model, cam: str) -> str:
    contact = next((n for n, c in model.cam_contacts.items() if c.cam == cam), None)
    if contact is None:
        raise refuse(f"cams.{cam}", "no contact", "a contact that drives a train", "", "add one under [contacts]")
    return contact


def _select_cam(cams: Mapping[str, Cam], cam: str | None) -> str:
    if cam is None and len(cams) == 1:
        return next(iter(cams))
    if cam is None or cam not in cams:
        given, known = "no name" if cam is None else repr(cam), ", ".join(cams)
        raise refuse("--cam", given, known or "a cam in the case", "", suggest_name(cam or "", cams))
    return cam
