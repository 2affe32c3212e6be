"""Checks of a model before a run: contacts open at the start, unconnected members, loads without effect, impacts.

May import everything below `initial_state`.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from flexcam.case.case import Case
from flexcam.core.errors import FlexcamError
from flexcam.dynamics import (
    ConstantSpeed,
    Method,
    Problem,
    Response,
    RunFailedError,
    SaveAt,
    Scheme,
    equilibrium,
    newmark,
    solve,
)
from flexcam.valvetrain import Adjuster, Cam, CamContact, Lash, Model, Seat, build_system, shared_forces, touching_coils

_MAX_DOFS = 3000
"""Maximum number of degrees of freedom for which the start of a run is computed to check its contacts."""


def check_open_contacts(model: Model, problem: Problem, scheme: Method) -> list[str]:
    """Return messages for cam contacts that are open on the base circle at the start."""
    contacts = {name: one for name, one in model.contacts.items() if isinstance(one, CamContact) and one.unilateral}
    if not contacts or not 0 < problem.system.size <= _MAX_DOFS:
        return []
    try:
        begun = solve(replace(problem, steps=1, engine="direct", adaptive=None), scheme)
    except RunFailedError:
        return []  # the run reports it
    return [_format_warning(name) for name, one in contacts.items() if _is_open(name, model.cams[one.cam], begun)]


def _is_open(name: str, cam: Cam, begun: Response) -> bool:
    """Return whether a contact carries no force although its cam is on the base circle."""
    if not len(begun.time) or abs(float(cam.event(begun.angle[:1])[0])) > _LIFT_TOLERANCE * cam.event.height:
        return False
    return float(begun.channels[f"contacts.{name}.force"][0]) <= 0.0


def _format_warning(name: str) -> str:
    why, remedy = "no spring presses the follower to its cam before it turns", "give a spring an installed_force"
    return f"Warning: contacts.{name}: {why}; {remedy}"


_LIFT_TOLERANCE = 1e-9
"""Lift relative to its maximum from which a cam counts as off its base circle."""


def check_overshoot(problem: Problem, scheme: Method) -> list[str]:
    """Return messages for an initial motion that decays within the first step and overshoots."""
    start = problem.start
    if not isinstance(scheme, Scheme) or start is None or not 0 < problem.system.size <= _MAX_DOFS:
        return []
    if not scheme.overshoot or not start.velocity.any():
        return []  # only a velocity is damped
    scale = max(float(np.abs(one).max()) for one in (start.displacement, problem.step * start.velocity))
    try:
        first = solve(replace(problem, steps=1, engine="direct", adaptive=None), scheme, save=SaveAt(field_every=1))
    except RunFailedError:
        return []  # the run reports it
    beyond = scheme.overshoot * problem.step**2 * np.abs(first.fields.acceleration[0])
    if float(beyond.max()) <= _OVERSHOOT_TOLERANCE * scale:
        return []
    size, name = f"{100.0 * float(beyond.max()) / scale:.3g} %", problem.system.names[int(np.argmax(beyond))]
    why, remedy = "the step does not resolve how fast it is damped", "take newmark, bathe or smaller steps"
    return [
        f"Warning: the first step overshoots at {name} by {size} of the largest motion of the start: {why}; {remedy}"
    ]


_OVERSHOOT_TOLERANCE = 0.01
"""Overshoot relative to the initial motion from which it is reported: flexcam's choice."""


def check_start_impact(case: Case, model: Model, problem: Problem) -> list[str]:
    """Return messages for cams that already lift when a run starts from rest, which causes an impact."""
    if case.record.run.start != "rest" or not problem.system.size:
        return []
    begin = problem.drive.at(np.zeros(1))
    found: list[str] = []
    for name in dict.fromkeys(one.cam for one in model.cam_contacts.values()):
        event = model.cams[name].event
        lift, slope = (float(event(begin.angle, order)[0]) for order in (0, 1))
        if abs(lift) > _IMPACT_LIFT * event.height:
            moves = f"{1e3 * lift:.3g} mm and {slope * float(begin.speed[0]):.3g} m/s"
            found.append(
                f"Warning: cams.{name}: the run starts in the middle of its lift, at {moves}, and strikes a train at "
                f'rest; turn it onto its base circle (phase), or take start = "equilibrium" or "periodic"'
            )
    return found


_IMPACT_LIFT = 1e-3
"""Lift relative to its maximum from which a start causes an impact; measured lifts may have noise below it."""


def check_loads(model: Model, problem: Problem) -> list[str]:
    """Return messages for loads without a movable degree of freedom."""
    vectors = {load.name: load.vector for load in problem.system.loads} if problem.system.size else {}
    return [
        f"Warning: loads.{name}: it pushes nothing: a support holds what it acts on, or no member and no mass is there"
        for name, load in model.loads.items()
        if load.size and not vectors.get(f"loads.{name}", np.ones(1)).any()
    ]


def check_connectivity(model: Model) -> list[str]:
    """Return messages for members not connected to any support, spring, rocker, cam or contact."""
    mesh = model.mesh
    touched = {int(node) for name in _connected_points(model) for node in mesh.points.get(name, ())}
    parts = [set(part.tolist()) for part in mesh.parts]
    return [
        f"Warning: members {', '.join(name for name, line in mesh.lines.items() if int(line[0]) in part)}: no support, "
        "spring, rocker, cam or contact touches them"
        for part in parts
        if not part & touched
    ]


def _connected_points(model: Model) -> Iterator[str]:
    """Yield the points that connect members to other parts."""
    yield from model.supports
    for spring in model.springs.values():
        yield from (spring.at, spring.to or "")
    for rocker in model.rockers.values():
        yield from (rocker.start, rocker.point)
    for cam in model.cams.values():
        yield cam.at
    for contact in model.contacts.values():
        match contact:
            case Seat():
                yield contact.at
            case Lash() | Adjuster():
                yield from contact.ends or ()
            case _:
                yield contact.follower


_MAX_FLEXIBLE_DOFS = 3000
"""Maximum number of degrees of freedom for which the flexible train is evaluated."""

_BASE_CIRCLE_TOLERANCE = 1e-9
"""Lift relative to its maximum from which a cam counts as off its base circle."""


def check_shared_seat_load(model: Model, speed: float) -> list[str]:
    """Return messages for cams that share a closed valve's springs with its seat: statically indeterminate if rigid."""
    return [
        f"Warning: contacts.{name}: no play parts the cam from a closed seat, and both share the {force:.4g} N of the "
        "springs by their stiffness: on the base circle the rigid train leaves all to the seat"
        + _describe_base_circle_force(model, name, speed)
        for name, force in shared_forces(model, speed).items()
    ]


def check_coil_bind(model: Model, speed: float) -> list[str]:
    """Return messages for springs that a rigid train compresses to solid length."""
    touching = touching_coils(model, speed).items()
    return [f"Warning: coils of {name!r} touch: {1e3 * beyond:.3g} mm beyond closed" for name, beyond in touching]


def _describe_base_circle_force(model: Model, contact: str, speed: float) -> str:
    """Describe the force on a cam on its base circle in the flexible train; empty if not known."""
    event = model.cams[model.cam_contacts[contact].cam].event
    low = _ANGLES[np.abs(event(_ANGLES, 0)) <= _BASE_CIRCLE_TOLERANCE * event.height]
    if not len(low):
        return ""
    drive = ConstantSpeed(speed, float(low[0]))
    try:
        system = build_system(model, speed)
        if system.size > _MAX_FLEXIBLE_DOFS:
            return ""
        still = Problem(system, drive, 1e-6 / speed, 1, equilibrium(system, drive), engine="direct")
        force = float(solve(still, newmark()).channels[f"contacts.{contact}.force"][0])
    except FlexcamError:  # data not needed by a rigid train may be missing
        return ""
    return f", the flexible one leaves {force:.4g} N to the cam"


_ANGLES = np.linspace(0.0, 2.0 * math.pi, 721)
"""Cam angles, rad, at which the base circle is searched."""
