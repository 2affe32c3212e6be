"""Speeds at which models of a train diverge: rigid, bilateral contact and unilateral contact.

May import `analysis` and everything below it; `flexcam compare --lowest ...` prints and plots the results.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from flexcam.analysis.preparation import PreparedRun, prepare
from flexcam.cams import event_extremes
from flexcam.case.case import Case
from flexcam.core import FloatArray
from flexcam.core.errors import refuse
from flexcam.core.units import RPM
from flexcam.dynamics import ProgressCallback, Response, equilibrium, reraise_interrupt, solve, track_progress
from flexcam.dynamics.force_laws import line_load
from flexcam.valvetrain import CamContact, Model, build_structure, build_system, hertz_line, main_lift

MODELS = ("rigid", "bilateral", "unilateral")


@dataclass(frozen=True)
class ForceRange:
    """Contact force of one model at one speed, on the main lift in the last revolution.

    Parameters
    ----------
    least, largest
        Minimum and maximum, N.
    """

    least: float
    largest: float


@dataclass(frozen=True)
class SpeedResult:
    """Contact forces of the models at one speed.

    Parameters
    ----------
    rpm
        Camshaft speed, rpm.
    forces
        Forces by model: ``rigid``, ``bilateral``, ``unilateral``; None if the run did not reach its end.
    """

    rpm: float
    forces: Mapping[str, ForceRange | None]

    def models_differ(self, first: str, second: str, tolerance: float) -> bool:
        """Return whether the extremes of two models differ by more than a fraction of the larger maximum."""
        one, other = self.forces[first], self.forces[second]
        if one is None or other is None:
            return True
        size = max(one.largest, other.largest)
        return max(abs(one.largest - other.largest), abs(one.least - other.least)) > tolerance * size


def compare_models_over_speed(
    case: Case, speeds: Sequence[float], *, contact: str | None = None, advance: ProgressCallback | None = None
) -> list[SpeedResult]:
    """Run a case over speeds with a rigid train, a bilateral contact and a unilateral contact."""
    model = prepare(case).model
    known = [name for name, one in model.contacts.items() if isinstance(one, CamContact) and one.unilateral]
    if not known or (contact is not None and contact not in known):
        given = "no unilateral contact" if contact is None else repr(contact)
        raise refuse("contacts", given, f"one of {', '.join(known)}" if known else "a unilateral contact")
    return [_evaluate_speed(case, speed, contact or known[0], len(speeds)) for speed in track_progress(speeds, advance)]


def divergence_speed(found: Sequence[SpeedResult], first: str, second: str, tolerance: float = 0.05) -> float | None:
    """Return the lowest speed, rpm, at which two models differ by more than a fraction of the force; None if never."""
    return next((one.rpm for one in found if one.models_differ(first, second, tolerance)), None)


def _evaluate_speed(case: Case, speed: float, contact: str, runs: int) -> SpeedResult:
    one = case.at_speed(speed)
    rigid, free = prepare(one, rigid=True), prepare(one)
    still = _force_range(_solve_run(rigid, runs), free, contact)
    held = _with_bilateral_contact(free, contact, still.largest if still else 0.0)
    responses = {name: _solve_run(ready, runs) for name, ready in (("bilateral", held), ("unilateral", free))}
    forces = {name: _force_range(response, free, contact) for name, response in responses.items()}
    return SpeedResult(speed / RPM, {"rigid": still, **forces})


def _solve_run(ready: PreparedRun, runs: int) -> Response:
    """Return one of several runs; an interruption stops all of them."""
    response = solve(replace(ready.problem, runs=runs), ready.scheme)
    reraise_interrupt(response.status)
    return response


def _force_range(response: Response, ready: PreparedRun, contact: str) -> ForceRange | None:
    if not response.status.ok:
        return None
    model = ready.model
    cam = model.cam_contacts[contact].cam
    lifted = response.latest(ready.revolution) & (model.cams[cam].event(response.angle) > main_lift(model, cam))
    force: FloatArray = response.channels[f"contacts.{contact}.force"][lifted]
    return ForceRange(float(force.min()), float(force.max()))


def _with_bilateral_contact(ready: PreparedRun, contact: str, force: float) -> PreparedRun:
    """Return the same train with a bilateral contact."""
    part = ready.model.contacts[contact]
    if not isinstance(part, CamContact):
        raise refuse("contacts", repr(contact), "a contact with a stiffness")
    stiffness = part.stiffness or _secant_stiffness(ready.model, contact, part, force)
    held = replace(part, unilateral=False, stiffness=stiffness, restitution=None)
    model = replace(ready.model, contacts={**ready.model.contacts, contact: held})
    system = build_system(model, ready.case.speed)
    start = equilibrium(system, ready.problem.drive)
    return replace(ready, model=model, problem=replace(ready.problem, system=system, start=start))


def _secant_stiffness(model: Model, name: str, part: CamContact, force: float) -> float:
    """Return the secant stiffness of a Hertz contact at full lift, N/m."""
    structure = build_structure(model)
    cam = model.cams[part.cam]
    line = hertz_line(structure, name, part, cam)
    width, give, rest, reference, _, limit = line.law().constants
    limit *= float(line.radius(np.array([event_extremes(cam.event)[1].at]), 0)[0])
    depth = np.geomspace(1e-8, 1e-4, 400)
    there = [width * line_load(x, limit, give, rest, reference)[0] for x in depth.tolist()]
    return force / float(np.interp(force, there, depth))
