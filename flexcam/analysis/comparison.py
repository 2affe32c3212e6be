"""Comparison of responses: flexible against rigid at a probe, two runs by quantity, and contact models over speed."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from flexcam.analysis.preparation import PreparedRun, prepare
from flexcam.analysis.run import run
from flexcam.cams import event_extremes
from flexcam.case.builder import build_model
from flexcam.case.case import Case
from flexcam.core import FloatArray
from flexcam.core.errors import refuse
from flexcam.core.units import RPM
from flexcam.dynamics import (
    SERIES,
    SLOPES,
    History,
    ProgressCallback,
    Response,
    Status,
    check_scalar_probe,
    component_unit,
    equilibrium,
    peak,
    reraise_interrupt,
    solve,
    track_progress,
    value_range,
)
from flexcam.dynamics.force_laws import line_load
from flexcam.valvetrain import CamContact, build_structure, build_system, hertz_line, main_lift, model_modes


@dataclass(frozen=True)
class Deviation:
    """Deviation of one quantity from the rigid system."""

    #: ``displacement``, ``velocity`` or ``acceleration``
    quantity: str
    #: `peak`, `rms`: maximum difference, of the dense output, and root mean square difference, SI
    peak: float
    rms: float
    #: `rigid_peak`, `flexible_peak`: maximum absolute value of each system, SI
    rigid_peak: float
    flexible_peak: float
    angle_deg: float  #: cam angle of the maximum difference, deg
    unit: str  #: SI unit of the values: of a rotation ``rad``, ``rad/s`` or ``rad/s^2``

    @property
    def relative_peak(self) -> float:
        """Maximum difference relative to the rigid peak."""
        return self.peak / self.rigid_peak if self.rigid_peak > 0.0 else 0.0


@dataclass(frozen=True)
class Comparison:
    """Comparison of a flexible with a rigid response at one probe."""

    probe: str  #: name of the probe
    speed_rpm: float  #: camshaft speed, rpm
    lift: float  #: range of the motion of the rigid system at the probe, m or rad
    deviations: tuple[Deviation, ...]  #: deviations of displacement, velocity and acceleration
    status: Status  #: status of the flexible run; the values of an incomplete run cover its finished part
    #: names of the compared systems: the first replaces the flexible, the second the rigid one
    names: tuple[str, str] = ("flexible", "rigid")
    peak_acceleration_deg: float = math.nan  #: cam angle of the maximum acceleration of the flexible system, deg
    peak_lift: float = math.nan  #: motion of the rigid system there, relative to `lift`
    #: half the range of the flexible displacement in the dwell of the rigid system with the largest one; None without
    residual: float | None = None

    @property
    def peak_deviation(self) -> float:
        """Maximum displacement difference relative to `lift`."""
        return self.deviations[0].peak / self.lift

    @property
    def rms_deviation(self) -> float:
        """Root mean square displacement difference relative to `lift`."""
        return self.deviations[0].rms / self.lift

    @property
    def peak_acceleration_ratio(self) -> float:
        """Ratio of the maximum accelerations of the flexible and the rigid system."""
        rigid = self.deviations[2].rigid_peak
        return self.deviations[2].flexible_peak / rigid if rigid > 0.0 else 0.0


_SAME_ANGLE = 1e-6  # tolerance for equal cam angles, rad
_REST = 1e-9  # motion relative to its maximum that is rest


def compare(flexible: Response, rigid: Response, probe: str, speed_rpm: float) -> Comparison:
    """Compare a flexible with a rigid response at a scalar probe.

    Parameters
    ----------
    flexible, rigid
        Responses at the same instants; an incomplete flexible response is compared over its own length.
    probe
        Name of the probe, such as ``"valve"`` or ``"tappet.uy"``.
    speed_rpm
        Camshaft speed, rpm, stored in the comparison.

    Returns
    -------
    Comparison
        Deviations of displacement, velocity and acceleration.

    Raises
    ------
    InputError
        If the probe is not scalar, or the rigid system does not move there.

    Examples
    --------
    ``compare(flexcam.run(case), flexcam.run(case, rigid=True), "valve", 3000.0).peak_deviation``
    """
    count = len(flexible.time)
    if not np.array_equal(flexible.time, rigid.time[:count]):
        why = "the results are compared instant by instant"
        raise refuse("responses", "responses at different instants", "the same instants", why)
    check_scalar_probe(probe, flexible.outline, rigid.outline)
    motion, base = flexible[probe], rigid[probe]
    lift = value_range(rigid.time, base.displacement, base.velocity)
    if lift == 0.0:
        why = "it does not move in the other result"
        remedy = "run a whole revolution, or add a follower's point to output.probes"
        raise refuse("probe", repr(probe), "a point that the cam moves", why, remedy)
    deviations = tuple(_compute_deviation(name, motion, base, flexible) for name in SERIES)
    instant = peak(flexible.time, motion.acceleration[:count])[1]
    angle = float(np.degrees(np.interp(instant, flexible.time, flexible.angle)))
    share = abs(float(np.interp(instant, rigid.time, base.displacement))) / lift
    return Comparison(
        probe, speed_rpm, lift, deviations, flexible.status, peak_acceleration_deg=angle, peak_lift=share,
        residual=_residual_amplitude(motion.displacement[:count], base),
    )  # fmt: skip


def _residual_amplitude(displacement: FloatArray, base: History) -> float | None:
    """Return half the range of a displacement in the dwell of the rigid motion in which it is largest."""
    rest = np.ones(len(displacement), dtype=bool)
    for rate in (base.velocity, base.acceleration):
        rest &= np.abs(rate[: len(rest)]) <= _REST * np.abs(rate).max()
    edges = np.flatnonzero(np.diff(np.concatenate([[False], rest, [False]])))
    dwells = [displacement[begin:end] for begin, end in edges.reshape(-1, 2).tolist() if end - begin > 1]
    amplitude = max((0.5 * float(np.ptp(dwell)) for dwell in dwells), default=None)
    return 0.0 if amplitude is not None and amplitude <= _REST * np.ptp(displacement) else amplitude


def compare_responses(
    one: Response, other: Response, probe: str, speed_rpm: float, names: tuple[str, str]
) -> Comparison:
    """Compare two responses over their common time, at the instants of the first."""
    first, last = _common_time(one, other)
    times = one.time[(one.time >= first) & (one.time <= last)]
    if len(times) < 2:
        raise refuse("responses", "no time in common", "runs that overlap", "results are compared instant by instant")
    both = one.at(times), other.at(times)
    if np.abs(both[0].angle - both[1].angle).max() > _SAME_ANGLE:
        given = f"camshaft speeds of {_mean_rpm(one):.6g} and {_mean_rpm(other):.6g} rpm"
        raise refuse("--against", given, "runs at the same speed", "results are compared at equal times")
    return replace(compare(*both, probe, speed_rpm), names=names)


def _common_time(first: Response, second: Response) -> tuple[float, float]:
    return max(first.time[0], second.time[0]), min(first.time[-1], second.time[-1])


def describe_common_part(one: Response, other: Response, names: tuple[str, str]) -> list[str]:
    """Return a sentence about the part of two responses that `compare_responses` compares, if one is longer."""
    first, last = (np.interp(_common_time(one, other), one.time, one.angle) / (2.0 * math.pi)).tolist()
    ends = [float(response.angle[-1]) / (2.0 * math.pi) for response in (one, other)]
    longer, end = max(zip(names, ends, strict=True), key=lambda pair: pair[1])
    if end - last < _SAME_ANGLE:
        return []
    return [f"Compared: revolutions {first:.4g} to {last:.4g}, which both runs have; '{longer}' continues to {end:.4g}"]


def _mean_rpm(response: Response) -> float:
    return float((response.angle[-1] - response.angle[0]) / (response.time[-1] - response.time[0])) / RPM


def _compute_deviation(quantity: str, motion: History, base: History, flexible: Response) -> Deviation:
    time, slope = flexible.time, SLOPES.get(quantity)  # the dense output has slopes of some quantities
    flexed: FloatArray = getattr(motion, quantity)[: len(time)]
    rigid: FloatArray = getattr(base, quantity)[: len(time)]
    rate, rigid_rate = (getattr(history, slope)[: len(time)] if slope else None for history in (motion, base))
    difference = flexed - rigid
    maximum, instant = peak(time, difference, None if rate is None or rigid_rate is None else rate - rigid_rate)
    rms, angle = float(np.sqrt(np.mean(difference**2))), float(np.degrees(np.interp(instant, time, flexible.angle)))
    peaks = peak(time, rigid, rigid_rate)[0], peak(time, flexed, rate)[0]
    return Deviation(quantity, maximum, rms, *peaks, angle, component_unit(motion.components[0], SERIES[quantity]))


MODELS = ("rigid", "bilateral", "unilateral")


@dataclass(frozen=True)
class ForceRange:
    """Contact force of one model at one speed, on the main lift in the last revolution."""

    least: float  #: minimum, N
    largest: float  #: maximum, N


@dataclass(frozen=True)
class SpeedResult:
    """Contact forces of the models at one speed."""

    rpm: float  #: camshaft speed, rpm
    #: forces by model: ``rigid``, ``bilateral``, ``unilateral``; None if the run did not reach its end
    forces: Mapping[str, ForceRange | None]


def compare_models_over_speed(
    case: Case, speeds: Sequence[float], *, contact: str | None = None, advance: ProgressCallback | None = None
) -> list[SpeedResult]:
    """Run a case over speeds with a rigid train, a bilateral contact and a unilateral contact."""
    model = prepare(case).model
    parts = model.contacts.items()
    known = {name: part for name, part in parts if isinstance(part, CamContact) and part.unilateral}
    if not known or (contact is not None and contact not in known):
        allowed = f"one of {', '.join(known)}" if known else 'a cam contact with model = "unilateral"'
        raise refuse("contacts", "none" if contact is None else repr(contact), allowed)
    chosen, results = contact or next(iter(known)), list[SpeedResult]()
    for speed in track_progress(speeds, advance):
        variant = case.at_speed(speed)
        rigid, free = prepare(variant, rigid=True), prepare(variant)
        rigid_force = _force_range(rigid, free, chosen, len(speeds))
        forces: dict[str, ForceRange | None] = {"rigid": rigid_force}
        largest = rigid_force.largest if rigid_force else 0.0
        bilateral = _with_bilateral_contact(free, chosen, known[chosen], largest)
        for name, ready in (("bilateral", bilateral), ("unilateral", free)):
            forces[name] = _force_range(ready, free, chosen, len(speeds))
        results.append(SpeedResult(speed / RPM, forces))
    return results


def divergence_speed(found: Sequence[SpeedResult], first: str, second: str, tolerance: float = 0.05) -> float | None:
    """Return the lowest speed, rpm, at which two models differ by more than a fraction of the force; None if never."""
    for result in found:
        force1, force2 = result.forces[first], result.forces[second]
        if force1 is None or force2 is None:
            return result.rpm
        size = max(force1.largest, force2.largest)
        if max(abs(force1.largest - force2.largest), abs(force1.least - force2.least)) > tolerance * size:
            return result.rpm
    return None


def _force_range(ready: PreparedRun, free: PreparedRun, contact: str, runs: int) -> ForceRange | None:
    """Return the contact force of one of several runs on the main lift of the flexible model; None if it fails."""
    response = solve(replace(ready.problem, runs=runs), ready.scheme)
    reraise_interrupt(response.status)
    if not response.status.ok:
        return None
    model = free.model
    cam = model.cam_contacts[contact].cam
    lifted = response.latest(free.revolution) & (model.cams[cam].lift(response.angle, 0) > main_lift(model, cam))
    force: FloatArray = response.channels[f"contacts.{contact}.force"][lifted]
    return ForceRange(float(force.min()), float(force.max()))


def _with_bilateral_contact(ready: PreparedRun, contact: str, part: CamContact, force: float) -> PreparedRun:
    stiffness = part.stiffness
    if stiffness is None:  # the secant stiffness of the Hertz contact at full lift
        cam = ready.model.cams[part.cam]
        line = hertz_line(build_structure(ready.model), contact, part, cam)
        width, give, rest, reference, _, limit = line.law().constants
        limit *= float(line.radius(np.array([event_extremes(cam.event)[1].at]), 0)[0])
        depth = np.geomspace(1e-8, 1e-4, 400)
        forces = [width * line_load(x, limit, give, rest, reference)[0] for x in depth.tolist()]
        stiffness = force / float(np.interp(force, forces, depth))
    bilateral = replace(part, unilateral=False, stiffness=stiffness, restitution=None)
    model = replace(ready.model, contacts={**ready.model.contacts, contact: bilateral})
    system = build_system(model, ready.case.speed)
    start = equilibrium(system, ready.problem.drive)
    return replace(ready, model=model, problem=replace(ready.problem, system=system, start=start))


def deviation(case: Case, probe: str) -> Comparison:
    """Run a case flexible and rigid and compare the responses."""
    flexible = run(case)
    reraise_interrupt(flexible.status)
    return compare(flexible, run(case, rigid=True), probe, case.speed / RPM)


def excited_mode(case: Case) -> float:
    """Return the frequency, Hz, of the mode nearest to the cam speed among those excited by the contact force."""
    structure = build_structure(build_model(case))
    modes = model_modes(structure).modes
    contact = next(iter(structure.model.cam_contacts.values()))
    push = structure.row(contact.follower, contact.direction)
    forces = abs(push @ modes.shapes)
    driven = [f for f, force in zip(modes.frequencies, forces, strict=True) if f > 0.0 and force > 1e-3 * forces.max()]
    return float(min(driven, key=lambda f: abs(math.log(f * 2.0 * math.pi / case.speed))))
