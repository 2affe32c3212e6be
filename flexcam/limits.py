"""Up to which speed a train follows its cam, and what gives way first.

May import `runner` and everything below it; `flexcam limits` prints what stands here.
Each limit is a question to a run at one speed; the lowest speed at which the answer is yes is bracketed and halved.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace

import numpy as np

from flexcam.case import Case
from flexcam.case.tables.contacts import SeatRecord
from flexcam.checks import positive, refuse
from flexcam.integrate import solve
from flexcam.linalg import FloatArray
from flexcam.response import Response
from flexcam.runner import Prepared, prepare
from flexcam.train import CamContact, CompressionSink, Lash, Model, Seat, buckling_load, build_structure

_RPM = math.pi / 30.0
_REVOLUTIONS = 3
_OPEN = math.radians(0.5)
"""Cam angle over which a contact must be open to count as lost: a single step may be a numerical accident."""


@dataclass(frozen=True)
class Limit:
    """A speed at which something gives way.

    Parameters
    ----------
    rpm
        Camshaft speed, rpm; None where it does not happen up to the highest speed looked at.
    tolerance_rpm
        How closely it is bracketed.
    words
        What happens there.
    """

    rpm: float | None
    tolerance_rpm: float
    words: str


@dataclass(frozen=True)
class Limits:
    """The limits of a train.

    Parameters
    ----------
    limits
        By name: ``loss_of_contact``, ``bounce``, ``coil_clash``, ``buckling``.
    lowest_rpm, highest_rpm
        Camshaft speeds between which they were looked for.
    rigid_rpm
        Camshaft speed at which a rigid train would lose contact: where its inertia equals its springs; None if never.
    """

    limits: Mapping[str, Limit]
    lowest_rpm: float
    highest_rpm: float
    rigid_rpm: float | None

    @property
    def first(self) -> str | None:
        """Name of the limit that comes first; None where none was met."""
        met = {name: one.rpm for name, one in self.limits.items() if one.rpm is not None}
        return min(met, key=lambda name: met[name]) if met else None


Question = Callable[[Response, Prepared, CompressionSink], bool]


def find_limits(
    case: Case, *, lowest: float, highest: float, tolerance: float = _RPM, bounce_height: float = 1e-4, count: int = 7
) -> Limits:
    """Find the speeds at which a train loses contact, its valve bounces, its coils clash and its pushrod buckles.

    Parameters
    ----------
    case
        A case with a true (unilateral) contact.
    lowest, highest
        Camshaft speeds between which to look, rad/s.
    tolerance
        Width of the bracket, rad/s.
    bounce_height
        Height above the seat from which a valve that has closed counts as bouncing, m.
    count
        Speeds looked at before a bracket is halved.

    Returns
    -------
    Limits
        What was found.

    Raises
    ------
    InputError
        If the case has no unilateral contact, or the speeds are out of order.
    """
    positive("lowest", lowest, "rad/s")
    positive("tolerance", tolerance, "rad/s")
    if not highest > lowest:
        raise refuse("highest", f"{highest / _RPM:g} rpm", f"above {lowest / _RPM:g} rpm")
    model = prepare(_at(case, lowest)).model
    if not any(isinstance(one, CamContact) and one.unilateral for one in model.contacts.values()):
        why = "only a follower that may leave its cam can lose it"
        raise refuse(
            "contacts", "no unilateral contact", 'a contact with model = "unilateral"', why, "change the model"
        )
    seen: dict[float, dict[str, bool]] = {}
    questions = _questions(model, bounce_height)

    def ask(speed: float) -> dict[str, bool]:
        if speed not in seen:
            ready = prepare(_at(case, speed))
            sink = CompressionSink(build_structure(ready.model))
            response = solve(ready.problem, ready.scheme, save=replace(ready.save, field_every=4), sinks=[sink])
            seen[speed] = {
                name: not response.status.ok or q(response, ready, sink) for name, (q, _) in questions.items()
            }
        return seen[speed]

    speeds = np.geomspace(lowest, highest, max(count, 2)).tolist()
    found = {name: _bracketed(name, words, speeds, ask, tolerance) for name, (_, words) in questions.items()}
    return Limits(found, lowest / _RPM, highest / _RPM, _rigid(case))


def _bracketed(
    name: str, words: str, speeds: list[float], ask: Callable[[float], dict[str, bool]], tolerance: float
) -> Limit:
    """Return the lowest speed of a list at which something happens, halved towards the one before."""
    first = next((i for i, speed in enumerate(speeds) if ask(speed)[name]), None)
    if first is None:
        return Limit(None, tolerance / _RPM, f"{words}: not up to {speeds[-1] / _RPM:.6g} rpm")
    if first == 0:
        return Limit(speeds[0] / _RPM, math.inf, f"{words}: already at the lowest speed looked at")
    low, high = speeds[first - 1], speeds[first]
    while high - low > tolerance:
        middle = 0.5 * (low + high)
        low, high = (low, middle) if ask(middle)[name] else (middle, high)
    return Limit(high / _RPM, (high - low) / _RPM, words)


def _questions(model: Model, bounce_height: float) -> dict[str, tuple[Question, str]]:
    questions: dict[str, tuple[Question, str]] = {"loss_of_contact": (_lost, "the follower leaves its cam on the lift")}
    if any(isinstance(one, Seat) for one in model.contacts.values()):
        questions["bounce"] = (
            lambda response, ready, sink: _bounces(response, ready, bounce_height),
            f"the valve leaves its seat again by more than {1e3 * bounce_height:g} mm",
        )
    if any(spring.clash_travel is not None for spring in model.springs.values()):
        questions["coil_clash"] = (lambda response, ready, sink: _clashed(response), "coils of a spring touch")
    questions["buckling"] = (_buckled, "a member's compression passes its buckling load")
    return questions


def _lost(response: Response, ready: Prepared, sink: CompressionSink) -> bool:
    """Tell whether a follower is off its cam somewhere on the main lift, in the last revolution."""
    del sink
    last = _last_revolution(response, ready)
    for name, contact in ready.model.driven.items():
        cam = ready.model.cams[contact.cam]
        angle = response.angle[last]
        lifted = cam.event(angle) > _main_lift(ready.model, contact.cam)
        off = lifted & (response.channels[f"contacts.{name}.force"][last] <= 0.0)
        if float(off.sum()) * float(angle[1] - angle[0]) > _OPEN:
            return True
    return False


def _main_lift(model: Model, cam: str) -> float:
    """Return the lift above which a cam has taken up ramps and play."""
    ramp = getattr(model.cams[cam].event, "ramp", None)
    plays = [
        one.gap / (model.rockers[one.rocker].ratio if one.rocker else 1.0)
        for one in model.contacts.values()
        if isinstance(one, Lash)
    ]
    return max([0.02 * model.cams[cam].event.height, *plays, *([ramp.height] if ramp else [])])


def _bounces(response: Response, ready: Prepared, height: float) -> bool:
    """Tell whether a valve, once closed, rises again before its cam lifts it."""
    last = _last_revolution(response, ready)
    for name, contact in ready.model.contacts.items():
        if not isinstance(contact, Seat):
            continue
        moved = response[contact.at].displacement[last].reshape(-1, len(response[contact.at].components))
        lift = moved @ contact.direction[: moved.shape[1]] if moved.shape[1] > 1 else moved[:, 0]
        closed = response.channels[f"contacts.{name}.force"][last] > 0.0
        top = int(np.argmax(lift))
        behind = np.roll(lift, -top), np.roll(closed, -top)
        at = int(np.argmax(behind[1])) if behind[1].any() else len(lift)
        before_next = _dwell_after(ready, response.angle[last], top)
        if float(behind[0][at:before_next].max(initial=0.0)) > height:
            return True
    return False


def _dwell_after(ready: Prepared, angle: FloatArray, top: int) -> int:
    """Return how many steps behind the top a cam begins to lift again."""
    lifts = sum((np.abs(cam.event(angle)) for cam in ready.model.cams.values()), np.zeros(len(angle)))
    behind = np.roll(lifts, -top)
    low = np.flatnonzero(behind <= 1e-9 + 1e-6 * float(behind.max()))
    return int(low[-1]) if low.size else len(angle)


def _clashed(response: Response) -> bool:
    return any(float(v.max()) > 0.0 for name, v in response.channels.items() if name.endswith(".clash"))


def _buckled(response: Response, ready: Prepared, sink: CompressionSink) -> bool:
    del response
    structure = build_structure(ready.model)
    return any(force > 0.0 and force > buckling_load(structure, name) for name, force in sink.compression().items())


def _last_revolution(response: Response, ready: Prepared) -> slice:
    steps = round(2.0 * math.pi / ready.case.speed / ready.problem.step)
    return slice(max(0, len(response.time) - steps), None)


def _rigid(case: Case) -> float | None:
    """Return the camshaft speed at which the rigid train's contact force first falls to zero, rpm."""
    one = prepare(_at(case, 1.0), rigid=True)
    angle = np.linspace(0.0, 2.0 * math.pi, 7201)
    worst: list[float] = []
    for name in one.model.driven:
        still, moving = (_rigid_force(case, name, speed, angle) for speed in (1e-3, 1.0))
        inertia = moving - still  # per (rad/s)^2
        pulls = inertia < 0.0
        if pulls.any():
            worst.append(float(np.sqrt((still[pulls] / -inertia[pulls]).min())))
    return min(worst) / _RPM if worst else None


def _rigid_force(case: Case, contact: str, speed: float, angle: FloatArray) -> FloatArray:
    ready = prepare(_at(case, speed), rigid=True)
    steps = replace(ready.problem, step=(angle[1] - angle[0]) / speed, steps=len(angle) - 1)
    return solve(steps, ready.scheme).channels[f"contacts.{contact}.force"]


def _at(case: Case, speed: float) -> Case:
    run = case.record.run
    changed = {"speed": speed, "crank_speed": None, "revolutions": float(_REVOLUTIONS)}
    seats = [one.at for one in case.record.contacts.values() if isinstance(one, SeatRecord)]
    output = case.record.output.model_copy(update={"probes": list(dict.fromkeys([*case.record.output.probes, *seats]))})
    return replace(
        case, record=case.record.model_copy(update={"run": run.model_copy(update=changed), "output": output})
    )
