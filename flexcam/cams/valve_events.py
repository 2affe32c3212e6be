"""Valve events: opening, closing, duration and overlap in crank degrees at a given lift."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from flexcam.cams.lift_event import Event
from flexcam.core import FloatArray
from flexcam.core.errors import positive

THRESHOLDS = {"1 mm": 1e-3, "0.05 in": 0.05 * 0.0254}
"""Valve lifts at which events are evaluated."""

_CYCLE = 4.0 * math.pi
_GRID = np.linspace(0.0, 2.0 * math.pi, 7201)


@dataclass(frozen=True)
class ValveEvent:
    """Opening and closing of a valve at a lift, in crank angles of a four-stroke cycle.

    Parameters
    ----------
    lift
        The lift, m.
    opens, closes
        Crank angles, rad, `opens` from 0 to 4 pi, `closes` after it; crank and cam angle are zero together.
    """

    lift: float
    opens: float
    closes: float

    @property
    def duration(self) -> float:
        """Crank angle between the two, rad."""
        return self.closes - self.opens

    @property
    def centre(self) -> float:
        """Crank angle halfway between opening and closing, rad from 0 to 4 pi."""
        return math.fmod(0.5 * (self.opens + self.closes), _CYCLE)


def valve_event(event: Event, lift: float, *, ratio: float = 1.0, lash: float = 0.0) -> ValveEvent | None:
    """Return the crank angles between which a valve is open beyond a lift."""
    positive("lift", lift, "m")
    positive("ratio", ratio, "")
    positive("lash", lash, "m", zero=True)
    cam_lift = (lift + lash) / ratio
    above = event(_GRID[:-1]) > cam_lift
    if not above.any() or above.all():
        return None
    ups, downs = (np.flatnonzero(change) for change in (above & ~np.roll(above, 1), ~above & np.roll(above, 1)))
    opened = [_crossing(event, cam_lift, float(_GRID[i] - _GRID[1]), float(_GRID[i])) for i in ups]
    closed = [_crossing(event, cam_lift, float(_GRID[i] - _GRID[1]), float(_GRID[i])) for i in downs]
    pairs = [(a, min((b - a) % (2.0 * math.pi) for b in closed)) for a in opened]
    start, span = max(pairs, key=lambda pair: pair[1])
    start = start % (2.0 * math.pi)
    return ValveEvent(lift, 2.0 * start, 2.0 * (start + span))


def overlap(one: ValveEvent, other: ValveEvent) -> float:
    """Return the crank angle over which both valves are open."""
    shifts = (-_CYCLE, 0.0, _CYCLE)
    return sum(max(0.0, min(one.closes, other.closes + s) - max(one.opens, other.opens + s)) for s in shifts)


def _crossing(event: Event, lift: float, low: float, high: float) -> float:
    """Return the angle at which the lift crosses a value between two angles, by bisection."""
    rising = _lift_above(event, lift, high)
    for _ in range(60):
        middle = 0.5 * (low + high)
        low, high = (low, middle) if _lift_above(event, lift, middle) == rising else (middle, high)
    return 0.5 * (low + high)


def _lift_above(event: Event, lift: float, angle: float) -> bool:
    value: FloatArray = event(np.array([angle]))
    return bool(value[0] > lift)
