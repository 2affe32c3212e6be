"""What an engine's train did in a run: contact, seating, springs, pushrods, shaft, in figures of one revolution."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from flexcam.core import FloatArray
from flexcam.dynamics import Response
from flexcam.valvetrain.model import Model
from flexcam.valvetrain.parts import CamContact, Seat
from flexcam.valvetrain.train_topology import play_of

Bools = NDArray[np.bool_]

_TOUCH = 1e-6
"""Height above the seat, m, from which a valve that has closed counts as open again; less for small lifts."""

_TOUCH_PART = 2e-4
"""The same as a part of the lift, which is the smaller one up to 5 mm: a watch has no micrometres to spare."""

_WHOLE = math.radians(355.0)
"""Cam angle of a record from which on its end meets its begin, rad: a swinging speed may leave a little out."""

_PARTED = 0.05
"""Part of the lift, above ramps and play, from which on a cam is on its main lift: below it ringing decides."""

OPEN = math.radians(0.5)
"""Cam angle over which a contact must be open to count as lost, rad: a single step may be a numerical accident."""

BOUNCE_HEIGHT = 1e-4
"""Height above the seat from which a valve that has closed counts as bouncing, m."""


@dataclass(frozen=True)
class Seating:
    """How a valve comes down.

    Parameters
    ----------
    velocity
        At the first touch after the lift, m/s, towards the seat.
    bounces
        How often it rises again before its cam lifts it.
    height
        Of the highest bounce, m.
    angle
        Cam angle of the first touch, rad.
    """

    velocity: float
    bounces: int
    height: float
    angle: float


def seating(gap: FloatArray, velocity: FloatArray, angle: FloatArray) -> Seating | None:
    """Return how a valve came down within one revolution."""
    top = int(np.argmax(gap))
    height, speed, at = (np.roll(one, -top) for one in (gap, velocity, angle))
    shut = np.flatnonzero(height <= 0.0)
    if not len(shut) or gap[top] <= _TOUCH or _unfinished(gap, angle):
        return None
    first, last = int(shut[0]), int(shut[-1])
    between = height[first : last + 1]
    touch = min(_TOUCH, _TOUCH_PART * float(gap[top]))
    rising = np.diff(np.concatenate([[0], (between > touch).astype(int)])) > 0
    largest = max(float(between.max()), 0.0)
    return Seating(max(-float(speed[first - 1]), 0.0), int(rising.sum()), largest, float(at[first]))


def _unfinished(gap: FloatArray, angle: FloatArray) -> bool:
    """Tell whether a record ends with a lift that does not go on at its begin, as that of a whole revolution does."""
    if gap[-1] <= _TOUCH:
        return False
    around = float(angle[-1] - angle[0]) * len(angle) / max(len(angle) - 1, 1)
    step = np.abs(np.diff(gap)).max(initial=0.0) + _PARTED * gap.max()
    return around < _WHOLE or bool(abs(gap[0] - gap[-1]) > step)


@dataclass(frozen=True)
class Metric:
    """A named result of a run.

    Parameters
    ----------
    name
        Such as ``contacts.seat.seating_velocity``.
    value
        SI.
    unit
        SI unit.
    """

    name: str
    value: float
    unit: str


def train_metrics(model: Model, response: Response, period: float) -> list[Metric]:
    """Return what a train did in the last revolution of a run."""
    if not len(response.time):
        return []
    last = response.latest(period)
    figures: list[Metric] = []
    for name, contact in model.driven.items():
        if isinstance(contact, CamContact) and contact.unilateral:
            angle = separation(model, response, name, last)
            figures.append(Metric(f"contacts.{name}.open_on_the_lift", angle, "rad"))
    for name, contact in model.contacts.items():
        if isinstance(contact, Seat) and f"contacts.{name}.gap" in response.channels:  # a rigid train knows no seat
            figures += _seat(response, f"contacts.{name}", last)
    for channel, unit in response.outline.channels:
        end = channel.rpartition(".")[2]
        values = response.channels[channel][last]
        if end in _LARGEST:
            size = values if end in _SIGNED else np.abs(values)
            figures.append(Metric(f"{channel}.largest", float(size.max()), unit))
        if end in _LEAST:
            figures.append(Metric(f"{channel}.least", float(values.min()), unit))
        if end == _USE and float(values.max()) > 0.0:
            figures.append(Metric(_margin(channel), 1.0 / float(values.max()), "1"))
    return figures


def train_metric_names(model: Model, channels: Iterable[str]) -> list[str]:
    """Return the names of all figures that `train_metrics` may give, whatever a run does."""
    known = list(channels)
    free = [name for name, one in model.driven.items() if isinstance(one, CamContact) and one.unilateral]
    seats = [name for name, one in model.contacts.items() if isinstance(one, Seat) and f"contacts.{name}.gap" in known]
    names = [f"contacts.{name}.open_on_the_lift" for name in free]
    names += [f"contacts.{name}.{one}" for name in seats for one in _SEATING]
    for channel in known:
        end = channel.rpartition(".")[2]
        names += [f"{channel}.largest"] * (end in _LARGEST) + [f"{channel}.least"] * (end in _LEAST)
        names += [_margin(channel)] * (end == _USE)
    return names


_USE = "buckling_use"
"""End of the name of a channel: compression by the load at which a member buckles."""


def _margin(channel: str) -> str:
    return channel.removesuffix(_USE) + "buckling_margin"


_SEATING = ("seating_velocity", "bounces", "bounce_height")
"""Figures of a seat."""

_LARGEST = (
    "force", "torque", "pressure", "sliding", "friction", "surge", "stress", "compression", "twist", "deflection",
    "leak_down",
)  # fmt: skip
"""Ends of the names of channels whose largest size says something."""

_SIGNED = ("compression",)
"""Those of which only the positive side is meant."""

_LEAST = ("clearance",)


def _seat(response: Response, where: str, last: Bools) -> list[Metric]:
    gap, velocity = (response.channels[f"{where}.{one}"][last] for one in ("gap", "velocity"))
    came = seating(gap, velocity, response.angle[last])
    if came is None:
        return []
    told = (came.velocity, "m/s"), (float(came.bounces), "1"), (came.height, "m")
    return [Metric(f"{where}.{name}", *one) for name, one in zip(_SEATING, told, strict=True)]


def separation(model: Model, response: Response, contact: str, instants: Bools) -> float:
    """Return over how much cam angle a follower is off its cam on the main lift."""
    cam = model.driven[contact].cam
    angle = response.angle[instants]
    if len(angle) < 2:
        return 0.0
    lifted = model.cams[cam].event(angle) > main_lift(model, cam)
    off = lifted & (response.channels[f"contacts.{contact}.force"][instants] <= 0.0)
    return float(off.sum()) * float(angle[-1] - angle[0]) / (len(angle) - 1)


def main_lift(model: Model, cam: str) -> float:
    """Return the lift above which a cam has taken up ramps and play."""
    event = model.cams[cam].event
    ramp = getattr(event, "ramp", None)
    return _PARTED * event.height + max(play_of(model, cam), float(ramp.height) if ramp else 0.0)
