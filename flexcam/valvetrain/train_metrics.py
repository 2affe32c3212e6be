"""Metrics of a run over one revolution: contact, seating, springs, pushrods and shaft."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from itertools import permutations

import numpy as np
from numpy.typing import NDArray

from flexcam.cams import event_extremes
from flexcam.core import FloatArray
from flexcam.core.errors import InputError
from flexcam.dynamics import ConstantSpeed, Response, RunFailedError, equilibrium
from flexcam.valvetrain.cam_functions import sliding_ratio
from flexcam.valvetrain.camshaft import driven_cam
from flexcam.valvetrain.model import Model
from flexcam.valvetrain.parts import Adjuster, Cam, CamContact, Lash, Seat
from flexcam.valvetrain.rigid_kinematics import driving_contact, is_in_train, largest_lashes, moved_nodes
from flexcam.valvetrain.rigid_model import rigid_motion
from flexcam.valvetrain.structure import build_structure
from flexcam.valvetrain.system_builder import build_system

Bools = NDArray[np.bool_]

_REOPENING_LIFT = 1e-6  # lift above the seat, m, above which a closed valve counts as reopened; less for small lifts
_TOUCH_PART = 2e-4  # the same relative to the lift, which governs up to 5 mm, as for watch mechanisms

# tolerance of cam angle for a complete revolution, rad: a fluctuating speed may leave a gap
_REVOLUTION_TOLERANCE = math.radians(355.0)
# fraction of the lift, above ramps and lash, above which a cam is on its main lift: below it ringing dominates
_MAIN_LIFT_FRACTION = 0.05
_LARGEST_MAIN_LIFT = 0.5  # largest fraction of the lift for the same, for a lash that takes up most of the lift

OPEN = math.radians(0.5)
"""Cam angle of an open contact that counts as contact loss, rad: a single step may be numerical."""

BOUNCE_HEIGHT = 1e-4
"""Lift above the seat above which a closed valve counts as bouncing, m."""


@dataclass(frozen=True)
class Seating:
    """Seating of a valve."""

    #: velocity at the first touch after the lift, m/s, towards the seat, extrapolated from the last two instants
    velocity: float
    bounces: int  #: number of bounces before the next lift
    height: float  #: height of the highest bounce, m
    angle: float  #: cam angle of the first touch, rad


def valve_seating(model: Model, response: Response, name: str, instants: Bools) -> Seating | None:
    """Return the seating of a valve at the instants of a revolution; contacts during its opening are no bounces."""
    seat, angle = model.contacts[name], response.angle[instants]
    gap, velocity = (response.channels[f"contacts.{name}.{quantity}"][instants] for quantity in ("gap", "velocity"))
    contact = driving_contact(model, seat.at) if isinstance(seat, Seat) else None
    if contact is None:
        return seating(gap, velocity, angle)
    cam = model.cams[model.cam_contacts[contact].cam]
    return seating(gap, velocity, angle, _flanks(cam, angle)["opening flank"] & (cam.lift(angle, 0) > 0.0))


def seating(gap: FloatArray, velocity: FloatArray, angle: FloatArray, opening: Bools | None = None) -> Seating | None:
    """Return the seating of a valve within one revolution; instants at which the cam opens it have no bounces."""
    top, is_open = int(np.argmax(gap)), gap[-1] > _REOPENING_LIFT
    if is_open and _is_short(angle):
        return None
    order, is_cut = np.roll(np.arange(len(gap)), -top), is_open and not _continues(gap)
    if is_cut:  # nothing is known after the end
        order = order[: len(gap) - top]
    height, speed, angles = gap[order], velocity[order], angle[order]
    shut = np.flatnonzero(_touches(height, speed))
    if not len(shut) or gap[top] <= _REOPENING_LIFT:
        return None
    first, last = int(shut[0]), len(order) if is_cut else int(shut[-1])
    rises = np.zeros(len(gap), dtype=bool) if opening is None else opening
    begins = shut[shut < last]
    heights = np.maximum.reduceat(np.where(rises[order], 0.0, height)[:last], begins) if len(begins) else np.zeros(1)
    touch = min(_REOPENING_LIFT, _TOUCH_PART * float(gap[top]))
    largest = float(heights.max()) if heights.max() > _GAP_ROUNDING * gap[top] else 0.0
    bounces = int((heights > touch).sum())
    return Seating(_touch_velocity(height[:first], speed[:first]), bounces, largest, float(angles[first]))


def _touches(gap: FloatArray, velocity: FloatArray) -> Bools:
    """Return at which instants a valve is at its seat, or rebounds from it since the instant before.

    A seat with restitution throws the valve back within a step, perhaps several times: the velocity jumps, and the
    travel of the step before would have passed the seat.
    """
    touched = gap <= _GAP_ROUNDING * gap.max()
    reached = gap[1:-1] <= _STEP_MARGIN * (gap[:-2] - gap[1:-1])
    touched[2:] |= ~touched[1:-1] & reached & (velocity[1:-1] < 0.0) & (velocity[2:] > 0.5 * velocity[1:-1])
    return touched


# gap relative to the lift up to which a valve is at its seat, as it is in the rigid model but for rounding
_GAP_ROUNDING = 1e-12
_STEP_MARGIN = 1.5  # travel of a step relative to that of the one before, up to which a rebound is possible


def _touch_velocity(gap: FloatArray, velocity: FloatArray) -> float:
    """Return the velocity towards the seat at the touch that follows some instants, m/s.

    Between the last instant and the touch the acceleration is that before it: the square of the velocity is then a
    linear function of the gap.
    """
    speed = max(-float(velocity[-1]), 0.0)
    if len(gap) < 2 or not gap[-2] > gap[-1] or velocity[-2] > 0.0:
        return speed
    gain = (speed**2 - float(velocity[-2]) ** 2) / float(gap[-2] - gap[-1])
    value = math.sqrt(max(speed**2 + gain * float(gap[-1]), 0.0))
    return min(max(value, 0.5 * speed), 1.5 * speed)  # beyond that the last instants are no guide


def _is_short(angle: FloatArray) -> bool:
    """Return whether a record is shorter than a revolution."""
    around = float(angle[-1] - angle[0]) * len(angle) / max(len(angle) - 1, 1)
    return around < _REVOLUTION_TOLERANCE


def _continues(gap: FloatArray) -> bool:
    """Return whether the beginning of a record continues its end."""
    step = np.abs(np.diff(gap)).max(initial=0.0) + _MAIN_LIFT_FRACTION * gap.max()
    return bool(abs(gap[0] - gap[-1]) <= step)


@dataclass(frozen=True)
class Metric:
    """Named scalar result of a run."""

    name: str  #: such as ``contacts.seat.seating_velocity``
    value: float  #: SI
    unit: str  #: SI unit
    angle: float | None = None  #: cam angle of an extreme of a channel, rad; None of other metrics


def train_metrics(model: Model, response: Response, period: float, names: Sequence[str] | None = None) -> list[Metric]:
    """Return the metrics of the last revolution of a run; with names at least those, without costly other ones.

    A shorter run has no means.
    """
    if not len(response.time):
        return []
    last = response.latest(period)
    figures = [
        Metric(f"contacts.{name}.{_OPEN}", separation(model, response, name, last), "rad")
        for name in spring_held_contacts(model) if names is None or f"contacts.{name}.{_OPEN}" in names
    ]  # fmt: skip
    for name, contact in model.cam_contacts.items():
        if isinstance(contact, CamContact):
            figures += _extreme(model, response, f"contacts.{name}.{_NOSE_FORCE}", "N", last)
    for name, contact in model.contacts.items():
        if isinstance(contact, Seat) and f"contacts.{name}.gap" in response.channels:  # the rigid model has no seat
            if (landing := valve_seating(model, response, name, last)) is not None:
                values = (landing.velocity, "m/s"), (float(landing.bounces), "1"), (landing.height, "m")
                figures += [Metric(f"contacts.{name}.{end}", *pair) for end, pair in zip(_SEATING, values, strict=True)]
            if names is None or f"contacts.{name}.{_LOFT}" in names:
                loft = valve_loft(model, response, name, contact, last)
                figures += [] if loft is None else [Metric(f"contacts.{name}.{_LOFT}", loft, "m")]
        if isinstance(contact, Lash) and f"contacts.{name}.gap" in response.channels:
            gap = float(response.channels[f"contacts.{name}.gap"][last].max())
            figures.append(Metric(f"contacts.{name}.{_GAP}", gap, "rad" if contact.turns else "m"))
    if response.time[-1] - response.time[0] > period * (1.0 - _SAME_SPAN):
        figures += _drive(model, response, last)
    for channel, unit in response.outline.channels:
        name, values = _metric_name(channel), response.channels[channel][last]
        if name.endswith("margin"):
            figures += [Metric(name, 1.0 / float(values.max()), "1")] if float(values.max()) > 0.0 else []
        elif name.endswith("nose"):
            nose = _nose(model, channel.split(".")[1], response.angle[last])
            figures += [] if nose is None else [Metric(name, float(values[nose]), unit)]
        elif name:
            figures += _extreme(model, response, name, unit, last)
    return figures


def extreme_history(model: Model, response: Response, name: str, *, window: bool = True) -> FloatArray | None:
    """Return the history whose largest value is a metric, shape (m,), or None for a metric that is no extreme.

    Of a minimum it is the negative history. It is minus infinity outside the window of the metric, such as the nose.
    """
    channel, _, kind = name.rpartition(".")
    if name.endswith(f".{_NOSE_FORCE}"):
        contact = channel.split(".")[1]
        nose = _flanks(model.cams[model.cam_contacts[contact].cam], response.angle)["nose"]
        return np.where(nose | (not window), -response.channels[f"contacts.{contact}.force"], -np.inf)
    if kind not in ("least", "largest") or channel not in response.channels or _metric_name(channel) != name:
        return None
    values = response.channels[channel]
    return -values if kind == "least" else values if channel.endswith(_SIGNED) else np.abs(values)


def _extreme(model: Model, response: Response, name: str, unit: str, last: Bools) -> list[Metric]:
    """Return the metric that is an extreme of a history in the last revolution, if any instant counts."""
    history = extreme_history(model, response, name)
    if history is None or not np.isfinite(history[last]).any():
        return []
    history, angle = history[last], response.angle[last]
    index, sign = int(history.argmax()), -1.0 if name.endswith("least") else 1.0
    place = float(np.mod(angle[index], 2.0 * math.pi)) if np.ptp(history) and not name.endswith(_NOSE_FORCE) else None
    return [Metric(name, sign * float(history[index]), unit, place)]


def train_metric_names(model: Model, channels: Iterable[str]) -> list[str]:
    """Return the names of all metrics that `train_metrics` may return."""
    available = list(channels)
    seats = [name for name, c in model.contacts.items() if isinstance(c, Seat) and f"contacts.{name}.gap" in available]
    contacts = [name for name, c in model.cam_contacts.items() if isinstance(c, CamContact)]
    lashes = [name for name, c in model.contacts.items() if isinstance(c, Lash) and f"contacts.{name}.gap" in available]
    names = [f"contacts.{name}.{_OPEN}" for name in spring_held_contacts(model)]
    names += [f"contacts.{name}.{_NOSE_FORCE}" for name in contacts]
    names += [f"contacts.{name}.{metric}" for name in seats for metric in (*_SEATING, _LOFT)]
    names += [f"contacts.{name}.{_GAP}" for name in lashes]
    names += [f"{where}.{mean}" for where in _parts_with(available, "torque") for mean in _DRIVE]
    names += [f"{where}.{_FRICTION_POWER}" for kind in ("friction", "power") for where in _parts_with(available, kind)]
    return [*names, *filter(None, map(_metric_name, available))]


def _parts_with(channels: Iterable[str], quantity: str) -> list[str]:
    """Return the parts that have a channel of a quantity, such as ``contacts.intake``."""
    return [name.removesuffix(f".{quantity}") for name in channels if name.endswith(f".{quantity}")]


def _metric_name(channel: str) -> str:
    """Return the name of the metric of a channel; empty if it has none."""
    where, _, quantity = channel.rpartition(".")
    if quantity == "buckling_use":
        return f"{where}.buckling_margin"
    if quantity == "clearance":
        return f"{channel}.least"
    if quantity in ("film", "lambda"):  # zero where the entrainment velocity changes its sign, so no minimum
        return f"{channel}.nose"
    return f"{channel}.largest" if quantity in _LARGEST else ""


def _nose(model: Model, contact: str, angle: FloatArray) -> int | None:
    cam = model.cams[model.cam_contacts[contact].cam]
    cosine = np.cos(cam.angle(angle) - event_extremes(cam.event)[1].at)
    return int(np.argmax(cosine)) if float(cosine.max()) > math.cos(_NOSE_TOLERANCE) else None


_NOSE_TOLERANCE = math.radians(2.0)  # cam angle within which an instant counts as that of maximum lift


_SEATING = ("seating_velocity", "bounces", "bounce_height")  # metrics of a seat

_LARGEST = (
    "force", "torque", "pressure", "sliding", "friction", "surge", "stress", "compression", "twist", "deflection",
    "leak_down", "flash_temperature", "wear", "eccentricity",
)  # fmt: skip
"""Suffixes of channels with a metric of maximum magnitude."""

# suffixes of channels whose metric is the maximum with its sign: a column that pumped up has a negative leak-down
_SIGNED = (".compression", ".leak_down")


_LOFT, _NOSE_FORCE, _FRICTION_POWER = "valve_loft", "nose_force.least", "friction_power.mean"
_GAP, _OPEN = "gap.largest", "open_on_the_lift"
_DRIVE = ("torque.mean", "power.mean")


def valve_loft(model: Model, response: Response, name: str, seat: Seat, instants: Bools) -> float | None:
    """Return the largest lift of a valve over the nose of its cam above that of the rigid train, m, if there is one.

    The rigid train includes the thermal expansion.
    """
    contact, angle = driving_contact(model, seat.at), response.angle[instants]
    if contact is None or contact in opposed_contacts(model):  # an opposed cam stops the valve over the nose
        return None
    try:
        motion, expansion = rigid_motion(model), _thermal_lift(model, contact, seat)
    except (InputError, RunFailedError):  # no rigid train or no equilibrium exists
        return None
    nose = _flanks(model.cams[model.cam_contacts[contact].cam], angle)["nose"]
    if not nose.any():
        return None
    row = build_structure(model).row(seat.at, seat.direction)
    rigid = motion.along(row[None], ConstantSpeed(1.0).at(angle))[0][:, 0]
    loft = response.channels[f"contacts.{name}.gap"][instants] - rigid
    if float(np.abs(loft[nose]).max()) < _RIGID:  # the rigid model, in which nothing expands
        return float(loft[nose].max())
    return float(loft[nose].max()) - expansion


_RIGID = 1e-9  # largest difference to the rigid train, m, that is rounding


def _thermal_lift(model: Model, name: str, seat: Seat) -> float:
    """Return the change of a valve's static lift at the nose of its cam by the temperatures of the members, m."""
    contact = model.cam_contacts[name]
    heated = any(member.temperature for member in model.members.values())
    if not heated or any(
        isinstance(part, Adjuster) and is_in_train(model, contact, part) for part in model.contacts.values()
    ):
        return 0.0  # an adjuster takes up the expansion
    cam = model.cams[contact.cam]
    row = build_structure(model).row(seat.at, seat.direction)
    return float(row @ _expansion(model, cam.drive_angle(event_extremes(cam.event)[1].at)))


@lru_cache(maxsize=32)
def _expansion(model: Model, angle: float) -> FloatArray:
    """Return the change of the static displacement at an angle of the drive by the temperatures, shape (n,)."""
    cold = replace(model, members={name: replace(member, temperature=0.0) for name, member in model.members.items()})
    drive = ConstantSpeed(1.0, start=angle)
    hot, reference = (equilibrium(build_system(variant, 1.0), drive).displacement for variant in (model, cold))
    return hot - reference


def opposed_contacts(model: Model) -> dict[str, str]:
    """Return the contacts of desmodromic pairs: each with one whose cam moves the same nodes in the opposite sense."""
    nodes = {name: set(moved_nodes(model, contact)) for name, contact in model.cam_contacts.items()}
    directions = {name: contact.direction[:3] for name, contact in model.cam_contacts.items()}
    return {
        a: b for a, b in permutations(nodes, 2) if float(directions[a] @ directions[b]) < 0.0 and nodes[a] & nodes[b]
    }


def spring_held_contacts(model: Model) -> list[str]:
    """Return the unilateral contacts whose followers springs hold on their cams; opposed cams open in turn."""
    opposed = opposed_contacts(model)
    contacts = ((name, contact) for name, contact in model.cam_contacts.items() if name not in opposed)
    return [name for name, contact in contacts if isinstance(contact, CamContact) and contact.unilateral]


def _drive(model: Model, response: Response, last: Bools) -> list[Metric]:
    """Return mean torque and power of every cam and shaft drive, and the mean friction power of contacts and slides.

    The mean torque is that over the angle of the shaft: times the angle of a revolution it is the work of the drive.
    """
    begin = max(int(np.argmax(last)) - 1, 0)  # the revolution with both ends
    time, angle = response.time[begin:], response.angle[begin:]
    if len(time) < _MIN_INSTANTS:
        return []
    metrics, duration = list[Metric](), float(time[-1] - time[0])
    for where in _parts_with(response.channels, "torque"):
        cam = driven_cam(model, where)
        shaft_angle = angle if cam is None else cam.angle(angle)
        torque, span = response.channels[f"{where}.torque"][begin:], float(shaft_angle[-1] - shaft_angle[0])
        work = float(np.trapezoid(torque, shaft_angle))
        work = work if abs(work) > _ROUNDING * span * float(np.abs(torque).max()) else 0.0
        values = (work / span, "N m"), (work / duration, "W")
        metrics += [Metric(f"{where}.{name}", *value) for name, value in zip(_DRIVE, values, strict=True)]
    for where in _parts_with(response.channels, "friction"):
        cam = model.cams[model.cam_contacts[where.removeprefix("contacts.")].cam]
        shaft_angle = cam.angle(angle)
        loss = response.channels[f"{where}.friction"][begin:] * sliding_ratio(cam)(shaft_angle, 0)
        mean = float(np.trapezoid(np.abs(loss), shaft_angle)) / duration
        metrics.append(Metric(f"{where}.{_FRICTION_POWER}", mean, "W"))
    for where in _parts_with(response.channels, "power"):
        mean = float(np.trapezoid(response.channels[f"{where}.power"][begin:], time)) / duration
        metrics.append(Metric(f"{where}.{_FRICTION_POWER}", mean, "W"))
    return metrics


_MIN_INSTANTS = 2
_SAME_SPAN = 1e-6  # relative difference of times that is rounding
_ROUNDING = 1e-12  # relative to the largest torque


def separation(model: Model, response: Response, contact: str, instants: Bools) -> float:
    """Return the cam angle of contact loss on the main lift."""
    return sum(separation_by_flank(model, response, contact, instants).values())


def separation_by_flank(model: Model, response: Response, contact: str, instants: Bools) -> dict[str, float]:
    """Return the cam angle of contact loss on the main lift: opening flank, nose, closing flank.

    The nose lies between the maximum velocities of opening and closing: there the acceleration points to the cam, and
    only the spring holds the follower.
    """
    cam, angle = model.cams[model.cam_contacts[contact].cam], response.angle[instants]
    if len(angle) < _MIN_INSTANTS:
        return {}
    lost = contact_loss(model, response, contact, instants)
    step = float(angle[-1] - angle[0]) / (len(angle) - 1)
    return {name: float((lost & flank).sum()) * step for name, flank in _flanks(cam, angle).items()}


def contact_loss(model: Model, response: Response, contact: str, instants: Bools | None = None) -> Bools:
    """Return at which of some instants, by default all, a contact is open on the main lift of its cam."""
    cam, selection = model.cam_contacts[contact].cam, slice(None) if instants is None else instants
    lifted = model.cams[cam].lift(response.angle[selection], 0) > main_lift(model, cam)
    return lifted & (response.channels[f"contacts.{contact}.force"][selection] <= 0.0)


def _flanks(cam: Cam, angle: FloatArray) -> dict[str, Bools]:
    closing, opening = (end.at for end in event_extremes(cam.event, 1))
    past, nose = np.mod(cam.angle(angle) - opening, 2.0 * math.pi), (closing - opening) % (2.0 * math.pi)
    middle = nose + 0.5 * (2.0 * math.pi - nose)
    return {
        "opening flank": past >= middle, "nose": past <= nose, "closing flank": (past > nose) & (past < middle)
    }  # fmt: skip


def main_lift(model: Model, cam: str) -> float:
    """Return the lift above which ramps and lash are taken up."""
    event = model.cams[cam].event
    ramp = getattr(event, "ramp", None)
    limit = _MAIN_LIFT_FRACTION * event.height + max(largest_lashes(model)[cam], float(ramp.height) if ramp else 0.0)
    return min(limit, _LARGEST_MAIN_LIFT * event.height)
