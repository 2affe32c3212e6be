"""Checks of a case before its run, and of the run: lobes, contacts, events, energy balance, resolution.

Every check returns warnings: what is wrong, where, by how much, and what to change. ``docs/long-runs.md`` has the table
of the checks of a run.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass
from typing import Literal, Self

import numpy as np

from flexcam.analysis.preparation import PreparedRun, prepare, prepare_without_periodic_search
from flexcam.analysis.run_metrics import RevolutionChange, compute_metrics, has_whole_revolution, revolution_change
from flexcam.cams import (
    FlatFollower,
    Follower,
    RollerFollower,
    SwingFlatFollower,
    SwingRollerFollower,
    profile_at,
    undercut,
)
from flexcam.case.case import Case
from flexcam.case.input_checks import check_model, check_values
from flexcam.core import rounding_fraction
from flexcam.core.errors import InputError, refuse
from flexcam.core.units import format_quantity, to_display_unit
from flexcam.dynamics import Collocation, Response, Sink, Stats, collocation_refinement, default_method, outline
from flexcam.dynamics.force_laws import THINNEST
from flexcam.dynamics.memory import ExtremesSink
from flexcam.valvetrain import (
    BOUNCE_HEIGHT,
    OPEN,
    Adjuster,
    Cam,
    CamContact,
    Lash,
    Metric,
    Model,
    PublishedLoad,
    Resolution,
    ResolutionSink,
    Seat,
    build_structure,
    compressed_members,
    driving_contact,
    find_pivot,
    model_modes,
    stiff_struts,
    valve_ratio,
)

_ANGLES = np.linspace(0.0, 2.0 * math.pi, 720, endpoint=False)  # cam angles at which a profile is evaluated
_LIFT_ANGLES = np.linspace(0.0, 2.0 * math.pi, 7201)  # cam angles at which the curvature of a lift is evaluated
_LIFT_TOLERANCE = 1e-3
"""Allowed deviation of the lift between two steps, relative to the lift: the published model is then accurate to 1 % at
3000 rpm.
"""

# deviation of a follower's node from the base circle, relative to its distance, from which it is reported: smaller ones
# are variations of the radius with the same nodes
_MAX_FOLLOWER_OFFSET = 0.1
_SAME_LOBE_ANGLE = 1.0  # angle between two lifts, deg, up to which they may be the same lobe
# ratio of shaft radius to base radius from which the shaft is thicker; equal radii are valid
_SHAFT_RADIUS_RATIO = 1.0 + 1e-9
# relative size of a deflection from which its rounding is reported: tables show four digits
_MIN_DEFLECTION_ERROR = 1e-4
# maximum relative displacement of a member's points, in parts of its length: the error of linear beams is 1 %
_MAX_DEFLECTION = 0.1
_MIN_STEPS = 20  # minimum steps per period: with fewer, common integrators have a period error of more than a percent
# minimum elements per bending wave: with fewer, cubic elements have a frequency error of more than half a percent
_MIN_ELEMENTS = 4
# minimum steps per impact: with fewer, the true maximum force may exceed the computed one by a twentieth
_MIN_IMPACT_STEPS = 5
# allowed residual relative to the largest force: some integrators satisfy equilibrium between the instants
_MAX_RESIDUAL = 0.01
_MAX_ENERGY_RESIDUAL = 0.01  # allowed residual of the energy balance and numerical dissipation, relative to the work


MAX_PERIODICITY_ERROR = 1e-3
"""Allowed change of the state over a revolution from a periodic start, relative to the motion."""


# Before a run


def check_input(ready: PreparedRun, steps: int = 0, *, integrates: bool = True) -> list[str]:
    """Return warnings about a case: implausible numbers, impossible lobes, parts without effect, open contacts.

    A finished run may require more steps per revolution than its lifts, see `required_steps`. Without time integration
    steps do not matter.
    """
    return [
        *check_values(ready.case),
        *check_lobes(ready.model),
        *check_model(ready.case, ready.model, ready.problem, ready.scheme),
        *(_check_cam_steps(ready, steps or required_steps(ready)) if integrates else ()),
        *_check_geometric_stiffness(ready),
        *_check_valves(ready.model),
    ]


def _check_valves(model: Model) -> Iterator[str]:
    """Yield warnings about valves that no cam moves."""
    for name, part in model.contacts.items():
        if isinstance(part, Seat) and model.cam_contacts and driving_contact(model, part.at) is None:
            remedy = "connect them by members, masses, rockers, springs, or contacts such as a lash or an adjuster"
            yield f"Warning: no cam moves the valve of seat {name!r}: nothing leads from a follower to it; {remedy}"


def _check_cam_steps(ready: PreparedRun, enough: int) -> Iterator[str]:
    """Yield warnings about cams whose lift deviates too far from a straight line between two steps."""
    turn = ready.case.speed * ready.problem.step
    for name, error in _lift_errors(ready).items():
        if error > _LIFT_TOLERANCE:
            yield (
                f"Warning: with {2.0 * math.pi / turn:.4g} steps per revolution, interpolation between steps "
                f"changes the lift of cam {name} by up to {100.0 * min(error, 1.0):.3g} %; "
                f"use at least {enough}, and several times more with contacts that open and close"
            )


def _lift_errors(ready: PreparedRun) -> dict[str, float]:
    """Return the largest deviation of each lift from a straight line between two steps, relative to the lift."""
    turn = ready.case.speed * ready.problem.step
    cams = ready.model.cams.items()
    return {name: turn**2 * float(np.abs(c.event(_LIFT_ANGLES, 2)).max()) / (8.0 * c.event.height) for name, c in cams}


def required_steps(ready: PreparedRun, monitor: RunMonitor | None = None) -> int:
    """Return the steps per revolution that lifts and accelerations of a run require; zero if its own suffice."""
    ratio = math.sqrt(max(_lift_errors(ready).values(), default=0.0) / _LIFT_TOLERANCE)
    if monitor is not None and _has_member_dofs(ready):
        ratio = max(ratio, _MIN_STEPS / monitor.resolution.evaluate().steps)
    return math.ceil(ratio * ready.revolution / ready.problem.step) if ratio > 1.0 else 0


def describe_method(ready: PreparedRun, monitor: RunMonitor) -> list[str]:
    """Return a sentence about a run that takes Newmark's method only because its steps are too coarse."""
    if ready.case.record.run.integrator is not None or isinstance(ready.scheme, Collocation):
        return []
    if (parts := collocation_refinement(ready.problem)) is None:
        return []
    steps = round(ready.revolution / ready.problem.step)
    why = f"{steps} steps per revolution are too few for the stiffness of the contacts"
    text = f"Integrator: Newmark's method, because {why}."
    if not required_steps(ready, monitor):  # otherwise a warning recommends another number
        finer = f"With {parts * steps} steps, for example, flexcam uses collocation"
        text += f" {finer}, whose contact forces are more accurate."
    return [text]


def _check_geometric_stiffness(ready: PreparedRun) -> Iterator[str]:
    for name, (excess, elements) in stiff_struts(ready.model).items() if _has_member_dofs(ready) else ():
        why = f"its computed buckling load is {100.0 * excess:.2g} % too high"
        if math.isinf(excess):
            why = "no node between its supports can move sideways"
        yield f"Warning: too few elements in member {name} for its geometric stiffness: {why}; use {elements}"


def check_lobes(model: Model) -> list[str]:
    """Return warnings about impossible lobes, and about followers that are not at the base circle."""
    known = [(name, cam, cam.follower) for name, cam in model.cams.items() if cam.follower is not None]
    lobes = [warning for name, cam, follower in known for warning in _check_lobe(model, name, cam, follower)]
    return [*lobes, *_check_shared_lobes(model), *_check_follower_nodes(model)]


def _check_lobe(model: Model, name: str, cam: Cam, follower: Follower) -> Iterator[str]:
    with suppress(InputError):  # no profile exists: code that needs it raises the error
        if undercut(profile_at(cam.event, follower, _ANGLES, cam.turn).radius, follower).any():
            radius, lift = (format_quantity("m", size, digits=3) for size in (follower.base_radius, cam.event.height))
            why = f"undercut: its base circle ({radius}) is too small for this lift ({lift}) and follower"
            yield f"Warning: cams.{name}: {why}; flexcam cam prints the minimum base-circle radius"
    if isinstance(follower, FlatFollower) and not abs(offset := follower.lobe_contact) <= 0.5 * (cam.width or math.inf):
        place = "at the edge of the lobe" if math.isinf(offset) else f"{1e3 * abs(offset):.3g} mm from its middle"
        remedy = "give the follower a crown_radius, or change the taper" if math.isinf(offset) else "change the taper"
        yield f"Warning: cams.{name}: its taper and the crown put the contact {place}: edge contact; {remedy}"
    if isinstance(follower, FlatFollower) and follower.face_diameter is not None:
        needed = 2.0 * follower.face_radius(float(np.abs(cam.event(_LIFT_ANGLES, 1)).max()), cam.width)
        if needed > follower.face_diameter:
            need = f"a diameter of {1e3 * needed:.4g} mm, but face_diameter is {1e3 * follower.face_diameter:.4g} mm"
            yield f"Warning: cams.{name}: the contact line crosses the edge of the follower's face, which needs {need}"
    node = model.mesh.points.get(cam.at, np.empty(0, dtype=int))
    members = [member for part, member in model.members.items() if np.isin(node, model.mesh.lines[part]).any()]
    sections = (member.section.at(0.5) for member in members)
    shaft_radius = max((section.radius for section in sections if section.round), default=0.0)
    if shaft_radius > _SHAFT_RADIUS_RATIO * follower.base_radius:
        radii = f"its base circle has a radius of {1e3 * follower.base_radius:.4g} mm, its shaft one of"
        yield f"Warning: cams.{name}: {radii} {1e3 * shaft_radius:.4g} mm: the follower would run on the shaft"


def _check_shared_lobes(model: Model) -> Iterator[str]:
    """Yield the cams with followers on different sides of the shaft that lift at the same cam angle."""
    contacts: dict[str, PublishedLoad | CamContact] = {}
    for new in model.cam_contacts.values():
        first = contacts.setdefault(new.cam, new)
        a, b = first.direction[:3], new.direction[:3]
        later = math.degrees(math.atan2(float(np.cross(a, b) @ new.shaft_axis), float(a @ b))) % 360.0
        if min(later, 360.0 - later) > _SAME_LOBE_ANGLE:
            why = f"it lifts {first.follower} and {new.follower} at the same cam angle, but its lobe reaches the second"
            remedy = f"give {new.follower} its own cam with a phase greater by this angle"
            yield f"Warning: cams.{new.cam}: {why} {later:.4g} deg later; {remedy}"


def _check_follower_nodes(model: Model) -> Iterator[str]:
    """Yield the followers that miss their cam along the shaft, and those away from its base circle."""
    for name, part in model.cam_contacts.items():
        cam, points = model.cams[part.cam], model.mesh.points
        follower = cam.follower
        if not {cam.at, part.follower} <= points.keys():
            continue
        centre, node = (model.mesh.nodes[points[point][0]] for point in (cam.at, part.follower))
        distance = abs(float((node - centre) @ part.shaft_axis))
        if cam.width is not None and distance > cam.width:
            away, width = (format_quantity("m", size) for size in (distance, cam.width))
            place = f"node {part.follower} is {away} from the cam along the shaft, and the cam is {width} wide"
            yield f"Warning: contacts.{name}: {place}; check both nodes"
        zero = np.zeros(1)
        if isinstance(follower, SwingRollerFollower | SwingFlatFollower):
            yield from _check_pivot(model, name, part, follower.distance)
        if isinstance(follower, SwingRollerFollower):
            place, height = "", float(np.linalg.norm(np.cross(node - centre, part.shaft_axis)))
            expected = follower.base_radius + follower.roller_radius
        elif isinstance(follower, FlatFollower | RollerFollower):
            place, height = "in the lift direction, ", float((node - centre) @ part.direction[:3])
            expected = float(follower.contact(zero, zero, zero, cam.turn).trace.imag[0])
        else:
            continue
        if isinstance(follower, RollerFollower):
            side = cam.turn * part.across[:3]
            aside, offset = float((node - centre) @ side), follower.offset
            if abs(aside - offset) > _MAX_FOLLOWER_OFFSET * expected:
                at = f"its node is at {1e3 * aside:.4g} mm along {[round(float(x), 4) + 0.0 for x in side]}"
                should = f"should be at {1e3 * offset:.4g} mm by follower.offset"
                yield f"Warning: contacts.{name}: {at} from the cam centre, but {should}"
        if abs(height - expected) > _MAX_FOLLOWER_OFFSET * expected:
            place += f"the node of follower {part.follower!r} is {1e3 * height:.4g} mm"
            source = "base_radius" if isinstance(follower, FlatFollower) else "base_radius and the roller"
            place += f" from the cam centre, but it should be {1e3 * expected:.4g} mm (from {source})"
            yield f"Warning: contacts.{name}: {place}; correct the node, base_radius or the follower"


def _check_pivot(model: Model, name: str, part: CamContact | PublishedLoad, expected: float) -> Iterator[str]:
    """Yield the pivots whose distance from the cam is not that of the follower."""
    centre = model.mesh.nodes[model.mesh.node(model.cams[part.cam].at)]
    for pivot in find_pivot(build_structure(model), part) if isinstance(part, CamContact) else ():
        distance = float(np.linalg.norm(np.cross(model.mesh.nodes[pivot] - centre, part.shaft_axis)))
        if abs(distance - expected) > _MAX_FOLLOWER_OFFSET * expected:
            place = f"its pivot {model.mesh.node_name(pivot)!r} is {1e3 * distance:.4g} mm from the cam centre"
            remedy = f"{1e3 * expected:.4g} mm (follower.distance); correct the node or cams.{part.cam}.follower"
            yield f"Warning: contacts.{name}: {place}, but it should be {remedy}"


# During and after a run


@dataclass(frozen=True, eq=False)
class RunMonitor:
    """Sinks that collect the data for checks of a run."""

    extremes: ExtremesSink  #: minimum and maximum of all quantities
    resolution: ResolutionSink  #: resolution of the motion by steps and elements

    @classmethod
    def of(cls, ready: PreparedRun) -> Self:
        """Return the sinks for a future run."""
        names = outline(ready.problem.system, ready.save)
        structure = build_structure(ready.model)
        return cls(ExtremesSink(names), ResolutionSink(structure, ready.problem.system, names, ready.problem.step))

    @classmethod
    def from_response(cls, ready: PreparedRun, response: Response) -> Self:
        """Return the sinks for a finished run, from its histories."""
        monitor = cls.of(ready)
        for sink in monitor.sinks:
            sink.write(response.to_block())
        return monitor

    @property
    def sinks(self) -> tuple[Sink, Sink]:
        """Sinks for `flexcam.solve`."""
        return self.extremes, self.resolution


def check_response(case: Case, response: Response, *, rigid: bool = False) -> list[str]:
    """Return the warnings about a run of a case, as ``flexcam run`` prints them.

    Parameters
    ----------
    case
        Case of the run.
    response
        Its response, with all instants and fields.
    rigid
        Whether its members are rigid, as in `flexcam.run`.

    Returns
    -------
    list of str
        Sentences about unusual values, events, the resolution by steps and elements, and limits of the model.

    Raises
    ------
    InputError
        If the case cannot be prepared, or the response is that of another model.

    Examples
    --------
    ``flexcam.check_response(case, flexcam.run(case))`` is empty without warnings.
    """
    ready = prepare(case, rigid=True) if rigid else prepare_without_periodic_search(case)
    if response.outline != outline(ready.problem.system):
        remedy = "give the case of the run, and rigid=True if its members are rigid"
        raise refuse("response", "a response of another model", "that of a run of the case", "", remedy)
    monitor, stats = RunMonitor.from_response(ready, response), response.stats
    sentences = check_run(ready, monitor, compute_metrics(ready, response), stats)
    if stats.steps == ready.problem.steps:
        sentences += check_transient(ready, revolution_change(ready, response))
    return sentences


def check_run(ready: PreparedRun, monitor: RunMonitor, metrics: list[Metric], stats: Stats) -> list[str]:
    """Return warnings about a run."""
    return [
        *check_input(ready, required_steps(ready, monitor)),
        *describe_model_limits(ready),
        *check_motion(ready, monitor, metrics, stats),
    ]


def check_motion(ready: PreparedRun, monitor: RunMonitor, metrics: list[Metric], stats: Stats) -> list[str]:
    """Return warnings about the motion of a run: events, contacts, accuracy, resolution."""
    revolved, steps = has_whole_revolution(ready, stats.steps), required_steps(ready, monitor)
    return [
        *check_events(metrics),
        *(_check_open_lashes(ready.model, metrics) if revolved else ()),
        *(_check_seating(ready.model, metrics) if revolved else ()),
        *_check_accuracy(ready, monitor.extremes, stats),
        *(_check_deflections(ready, monitor.extremes) if _has_member_dofs(ready) else ()),
        *(_check_resolution(ready, monitor.resolution.evaluate(), steps) if _has_member_dofs(ready) else ()),
    ]


def check_transient(ready: PreparedRun, change: RevolutionChange | None) -> list[str]:
    """Return a warning about a run with adjusters that has not reached a periodic motion."""
    adjusters = [name for name, part in ready.model.contacts.items() if isinstance(part, Adjuster)]
    if not adjusters or ready.case.record.run.start == "periodic":
        return []
    if change is not None and change.motion <= MAX_PERIODICITY_ERROR:
        return []
    size = "the run has only one revolution"
    if change is not None:
        size = f"difference between its last two revolutions: {describe_change(change)}"
    remedy = 'run more revolutions, or use run.start = "periodic"'
    oil = f"the oil of {', '.join(f'contacts.{name}' for name in adjusters)} may still be in a transient"
    return [f"Warning: {oil}: {size}; {remedy}"]


def describe_change(change: RevolutionChange) -> str:
    """Describe the difference of the last revolution from the one before."""
    texts = [f"motion {100.0 * change.motion:.2g} % of its range"]
    if change.contact:
        force = f"force of contact {change.contact} {100.0 * change.force:.2g} %"
        texts.append(f"{force} (rms of the difference during the lift, relative to the rms of the force)")
    if change.stress_change > _SAME_STRESS:
        factor, unit = to_display_unit("Pa")
        before, last = (f"{factor * stress:.3g}" for stress in change.stress)
        texts.append(f"max von Mises stress of {change.member} from {before} to {last} {unit}")
    return ", ".join(texts)


_SAME_STRESS = 0.02  # relative change of a stress that is not mentioned


def describe_decay(ready: PreparedRun, member: str) -> tuple[str, bool]:
    """Return the decay of the lowest mode, if it is undamped, or of that of a member, and whether it decays.

    The text is empty if it decays within a revolution.
    """
    lowest = model_modes(build_structure(ready.model), _DECAY_MODES)
    for i in range(lowest.modes.rigid, len(lowest.modes.omegas)):
        shape, frequency = lowest.modes.shapes[:, i], f"{lowest.modes.frequencies[i]:.4g} Hz"
        rate = 0.5 * float(shape @ ready.problem.system.damping.times(shape))
        shares = {part: share for part, share in lowest.shares[i].items() if part.startswith(f"{member} ")}
        is_own, is_undamped = sum(shares.values()) > _OWN_MODE, rate <= _UNDAMPED * lowest.modes.omegas[i]
        mode = f"The lowest mode ({frequency})"
        if is_own:
            motion = max(shares, key=lambda part: shares[part]).removeprefix(f"{member} ")
            mode = f"The lowest mode of member {member} ({motion}, {frequency})"
        if is_undamped and (is_own or i == lowest.modes.rigid):
            remedy = "add damping, such as run.damping.modal, and then run more revolutions"
            return f"{mode} is not damped, so the motion never repeats: {remedy}", False
        if is_own:
            turns = 1.0 / (rate * ready.revolution)
            longer = "the stress repeats only after several times as many"
            text = f"{mode} decays to 37 % of its amplitude in {turns:.3g} revolutions; {longer}"
            return text if turns > 1.0 else "", True
    return "", True


_UNDAMPED = 1e-9  # damping ratio that is rounding
_DECAY_MODES = 60  # number of the lowest modes among which that of a member is searched for
_OWN_MODE = 0.5  # share of the kinetic energy from which a mode belongs to a member


def _has_member_dofs(ready: PreparedRun) -> bool:
    return ready.case.record.fidelity.model == "beams" and not ready.problem.system.is_kinematic


def describe_model_limits(ready: PreparedRun) -> list[str]:
    """Return warnings about results that a rigid or lumped model does not give."""
    model = ready.case.record.fidelity.model
    if model == "beams":
        return []
    if model == "rigid":
        return ["Warning: the rigid model has no member forces: it gives no stresses, section forces and reactions"]
    channels = {channel.name for channel in ready.problem.system.channels}
    missing = [name for name in compressed_members(ready.model) if f"members.{name}.compression" not in channels]
    why = "it has no vibration of members and no spring surge, and the camshaft deforms as under static contact forces"
    warnings = [f"Warning: the lumped model gives no stresses and section forces: {why}"]
    if missing:
        why = "the model has no mass behind them, and so no inertia force that compresses them"
        remedy = 'use fidelity.model = "chain" with two masses or more'
        warnings.append(f"Warning: no compression and buckling of {', '.join(missing)}: {why}; {remedy}")
    return warnings


def _check_open_lashes(model: Model, metrics: Iterable[Metric]) -> Iterator[str]:
    """Yield warnings about lashes, smaller than a lift, that did not close in a revolution."""
    lift = max((cam.event.height for cam in model.cams.values()), default=0.0)
    for name, force in _metrics_with_suffix(metrics, ".force.largest"):
        part = model.contacts.get(name)
        if force == 0.0 and isinstance(part, Lash) and part.gap < lift:
            checked = "gap" if part.ends is None else "gap and the sign of its direction"
            yield f"Warning: lash {name!r} stays open over the revolution: check its {checked}"


def _rigid_lift(model: Model, seat: str) -> float:
    """Return the largest lift of the valve of a seat in the rigid train, m; 0 if no cam moves it."""
    part = model.contacts[seat]
    contact = driving_contact(model, part.at) if isinstance(part, Seat) else None
    cam = model.cam_contacts[contact].cam if contact is not None else None
    return 0.0 if cam is None else valve_ratio(model, cam) * model.cams[cam].event.height


_LOST_LIFT = 0.2
"""Part of the lift of the rigid train, lost at the nose, that is reported: a soft train loses a tenth."""


def _check_seating(model: Model, metrics: Sequence[Metric]) -> Iterator[str]:
    """Yield warnings about valves that lose much of their lift, or have loft but no seating in the last revolution."""
    seated = dict(_metrics_with_suffix(metrics, ".seating_velocity"))
    for name, loft in _metrics_with_suffix(metrics, ".valve_loft"):
        lift = _rigid_lift(model, name)
        if loft < -_LOST_LIFT * lift:
            lost = f"{format_quantity('m', -loft, digits=3)} of {format_quantity('m', lift, digits=3)}"
            remedy = "check the stiffness, oil and lash of the parts between cam and valve, and the valve's spring"
            yield f"Warning: the train loses {lost} of lift at {name!r}: {remedy}"
        if name not in seated and loft > BOUNCE_HEIGHT:
            why = "seating velocity and bounces are not evaluated"
            yield f"Warning: the valve does not close at {name!r} in the last revolution: {why}"


def check_events(metrics: Iterable[Metric]) -> list[str]:
    """Return warnings about events of the last revolution: contact loss, valve bounce, coil clash, buckling."""
    known = list(metrics)
    counts = dict(_metrics_with_suffix(known, ".bounces"))
    times = {name: "once" if count == 1.0 else f"{count:.0f} times" for name, count in counts.items()}
    return [
        f"Warning: {sentence.format(name=name, size=factor * value, times=times.get(name))}"
        for suffix, limit, is_minimum, factor, sentence in _EVENTS
        for name, value in _metrics_with_suffix(known, suffix)
        if (value < limit if is_minimum else value > limit)
    ]


# End of the name of a metric, limit, whether this is a minimum, factor from SI to the size in the sentence. Stresses:
# 1.67 times a yield stress of 1.5 GPa (K. L. Johnson, Contact Mechanics, 1985, section 6.1), and three quarters of the
# tensile strength of the strongest wire, 2 GPa.
_EVENTS = (
    (".open_on_the_lift", OPEN, False, math.degrees(1.0),
     ("the follower of {name!r} loses contact with its cam for {size:.3g} deg of the lift: "
      "do not use the motion after the loss for design")),
    (".bounce_height", BOUNCE_HEIGHT, False, 1e3,
     "the valve bounces {times} at {name!r}, up to {size:.3g} mm above its seat"),
    (".clearance.least", 0.0, True, -1e3, "coils of {name!r} touch: {size:.3g} mm beyond coil bind"),
    (".buckling_margin", 1.0, True, 1.0,
     "the compression of member {name!r} exceeds its buckling load, margin {size:.4g}"),
    (".eccentricity.largest", THINNEST, False, 1.0,
     ("the journal of {name!r} reaches {size:.3g} of its clearance: "
      f"beyond {THINNEST} its oil film is not that of the theory")),
    (".pressure.largest", 2.5e9, False, 1e-6,
     "the contact pressure of {name!r} reaches {size:.4g} MPa: hardened steel may yield under it"),
    (".stress.largest", 1.5e9, False, 1e-6,
     "the shear stress in the wire of {name!r} reaches {size:.4g} MPa: no wire of valve springs endures it"),
)  # fmt: skip


def describe_contact_loss(metrics: Iterable[Metric]) -> str:
    """Describe which followers lost contact with their cams, and for how long; empty if none did."""
    lost = _metrics_with_suffix(metrics, ".open_on_the_lift")
    return ", ".join(f"{name!r} lost contact for {math.degrees(angle):.3g} deg" for name, angle in lost if angle > OPEN)


def _metrics_with_suffix(metrics: Iterable[Metric], suffix: str) -> Iterator[tuple[str, float]]:
    """Yield name of the part and value of the metrics with a given suffix."""
    for metric in metrics:
        if metric.name.endswith(suffix):
            yield metric.name.removesuffix(suffix).partition(".")[2], metric.value


def energy_share(extremes: ExtremesSink, part: Literal["residual", "numerical"]) -> float:
    """Return the residual of the energy balance or the numerical dissipation, relative to the largest energy.

    This is the largest range of work and stored energies; a dissipation is negative if the integrator adds energy.
    """
    bounds = (extremes.channel(f"energy.{name}") for name in ("work", "kinetic", "strain"))
    largest_range = max(maximum - minimum for minimum, maximum in bounds)
    return max(extremes.channel(f"energy.{part}"), key=abs) / largest_range if largest_range > 0.0 else 0.0


def describe_balance(extremes: ExtremesSink, stats: Stats) -> str:
    """Return a sentence about the energy balance and the equilibrium residual of a run."""
    if not extremes.energies:
        return ""
    balance = f"equilibrium of forces within {stats.imbalance:.1e} of the largest force"
    forces = balance if stats.imbalance >= 0.0 else "forces not checked"
    residual, numerical = abs(energy_share(extremes, "residual")), energy_share(extremes, "numerical")
    verb = "added" if numerical < 0.0 else "removed"
    energies = f"residual {residual:.1e}, energy {verb} by the integrator {abs(numerical):.2g} (of the largest energy)"
    return f"{energies}; {forces}"


def _check_accuracy(ready: PreparedRun, extremes: ExtremesSink, stats: Stats) -> Iterator[str]:
    """Yield warnings about the balances of energy and forces, the start and rounding; NaN counts as large."""
    if not (share := abs(energy_share(extremes, "residual"))) <= _MAX_ENERGY_RESIDUAL:
        residual = f"the energy balance has a residual of {100.0 * share:.2g} %"
        why = "the steps are too long, or a contact is too stiff for them"
        yield f"Warning: {residual}: {why}; use more steps per revolution"
    if not abs(share := energy_share(extremes, "numerical")) <= _MAX_ENERGY_RESIDUAL:
        verb = "dissipates" if share > 0.0 else "adds"
        remedy = "" if ready.scheme == default_method(ready.problem) else ", or leave run.integrator out"
        why = f"{100.0 * abs(share):.3g} % of the largest energy: the steps are too long"
        yield f"Warning: the time integration {verb} {why}; use more steps per revolution{remedy}"
    if not stats.imbalance <= _MAX_RESIDUAL:
        why = "the steps are too long for the motion; use more steps per revolution"
        yield f"Warning: forces are out of balance by up to {100.0 * stats.imbalance:.2g} % of the largest: {why}"
    if not stats.periodicity <= MAX_PERIODICITY_ERROR:
        error = f"{100.0 * stats.periodicity:.2g} % of the amplitude"
        why = f"after a revolution the state still differs from the start by {error}, perhaps because contacts chatter"
        yield f'Warning: no periodic start was found: {why}; use start = "equilibrium" and several revolutions'
    if extremes.most_bent.any() and not ready.problem.system.is_kinematic:
        share = rounding_fraction(ready.problem.system.stiffness, extremes.most_bent)
        if not share <= _MIN_DEFLECTION_ERROR:
            yield f"Warning: rounding in the stiffness may change the deflection by up to {100.0 * share:.1g} %"


def _check_deflections(ready: PreparedRun, extremes: ExtremesSink) -> Iterator[str]:
    """Yield warnings about members that deform, or rotate as rigid bodies, beyond small displacements."""
    mesh, fields = ready.model.mesh, build_structure(ready.model).dofs.nodal(extremes.most_bent[None])[0]
    for name, line in mesh.lines.items():
        nodes, motion, rotations = mesh.nodes[line], fields[line, :3], fields[line, 3:]
        rotation = min(rotations, key=np.linalg.norm)  # of the body: bending rotates other nodes more
        length = np.linalg.norm(np.diff(nodes, axis=0), axis=1).sum()
        bent = motion - np.cross(rotation, nodes)
        deformed, moved = (float(np.linalg.norm(np.ptp(u, axis=0)) / length) for u in (bent, motion))
        if deformed > _MAX_DEFLECTION:
            why = f"it deforms by {100.0 * deformed:.3g} % of its length"
            where = f"member {name} leaves the range of small displacements, so that its results are not valid"
            yield f"Warning: {where}: {why}"
        elif moved > _MAX_DEFLECTION:
            angle = format_quantity("rad", float(np.linalg.norm(rotation)), digits=3)
            why = "the equations keep its initial position"
            valid = "its rotation remains valid, but not the displacements of its points and the forces across it"
            yield f"Warning: member {name} turns by {angle}, and {why}: {valid}"


def _check_resolution(ready: PreparedRun, resolution: Resolution, enough: int) -> Iterator[str]:
    case = ready.case
    if is_coarse := resolution.steps < _MIN_STEPS:
        mean = f"the accelerations have a mean frequency of {resolution.frequency:.4g} Hz"
        period = f"a vibration of this frequency has only {resolution.steps:.3g} time steps per period"
        yield f"Warning: {mean}; {period}; use at least {enough} steps per revolution and check again"
    for name, count in resolution.elements.items():
        if count < _MIN_ELEMENTS and not is_coarse:  # otherwise the steps determine the frequency
            enough = math.ceil(_MIN_ELEMENTS / count) * case.record.members[name].elements
            wave = f"at {resolution.frequency:.4g} Hz a bending wave in member {name} is only {count:.2g} elements long"
            yield f"Warning: {wave}; set elements = {enough} in {case.place(('members', name))}"
    for name, count in resolution.impacts.items():
        if count < _MIN_IMPACT_STEPS:
            steps = f"{count} time step{'s' if count > 1 else ''}"
            yield (
                f"Warning: the largest force of contact {name} comes from an impact that lasts only {steps}: "
                "use more steps per revolution"
            )
