"""Lift events: lift over the cam angle, its joints and extremes, and the valve events of a lift."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from dataclasses import dataclass
from functools import cached_property, lru_cache
from itertools import accumulate
from typing import Literal

import numpy as np

from flexcam.cams.law_criteria import LIMIT_OFFSET, Extreme, bisect, curve_minimum
from flexcam.cams.motion_law import Law, Ramp, RampTransition, ReversedLaw
from flexcam.core import FloatArray
from flexcam.core.errors import positive, refuse
from flexcam.core.units import IN_RADIANS, format_quantity

_SNAP = 1e-9  # angles this close to a joint (rad) count as on it, so that rounding does not select the side of a jump
GRID = np.linspace(0.0, math.tau, 7201)
_ROUNDING = 1e-12


class Event(ABC):
    """Periodic lift over the cam angle."""

    @property
    def joints(self) -> tuple[float, ...]:
        """Cam angles, rad from 0 to 2 pi, where a derivative may jump; none for a smooth lift."""
        return ()

    @cached_property
    def height(self) -> float:
        """Largest lift, ramps included, m, with a relative accuracy of 1e-9."""
        peak = float(GRID[np.argmax(self(GRID))])
        return float(self(peak + np.linspace(-1.0, 1.0, 2001) * (GRID[1] - GRID[0])).max())

    @abstractmethod
    def __call__(self, angle: FloatArray, order: int = 0) -> FloatArray:
        """Return the derivative of the given order (0 to 4) by the cam angle (rad), m/rad^order, shape as `angle`."""


@lru_cache(maxsize=256)
def unique_event(event: Event) -> Event:
    """Return one object for equal events: values at cam angles are cached by object."""
    return event


@dataclass(frozen=True, eq=False)
class Segment:
    """Segment of cam angle with one law, forwards or backwards, or a dwell (None).

    Start and span are rad from the beginning of the event; base is the lift at the lower end, m.
    """

    start: float
    span: float
    base: float
    height: float = 0.0
    law: Law | None = None
    backwards: bool = False

    def __call__(self, local: FloatArray, order: int) -> FloatArray:
        """Return the derivative at angles from the beginning of the event; at a jump the right limit."""
        base = np.full_like(local, self.base if order == 0 else 0.0)
        if self.law is None:
            return base
        z = np.clip((local - self.start) / self.span, 0.0, 1.0)
        z = 1.0 - z if self.backwards else z
        for jump in self.law.breaks:
            z = np.where(np.abs(z - jump) < _SNAP, np.nextafter(jump, 0.0) if self.backwards else jump, z)
        span = -self.span if self.backwards else self.span
        return base + self.height / span**order * self.law(z, order)

    def joints(self) -> list[float]:
        """Return start, inner jumps and end, rad from the beginning of the event."""
        inner = self.law.breaks if self.law else ()
        inside = [1.0 - z if self.backwards else z for z in inner]
        return [self.start, *(self.start + z * self.span for z in inside), self.start + self.span]


@dataclass(frozen=True)
class LiftEvent(Event):
    """Lift of a follower over the cam angle: ramps, rise, dwell and return.

    Parameters
    ----------
    law
        Law of the rise.
    lift
        Height of the rise above the ramp, m.
    rise, fall, dwell
        Cam angles of rise, return and upper dwell, rad; the rest of the revolution is the lower dwell.
    phase
        Cam angle at which the rise begins, rad; an opening ramp precedes it.
    fall_law
        Law of the return, run backwards; None for the mirror image of the rise.
    ramp, closing_ramp
        Ramps before the rise and after the return; the closing ramp defaults to the opening one.
    single_dwell
        Position of the only dwell, for laws that end at rest but begin with an acceleration: ``high`` (the return runs
        into the next rise) or ``low`` (the law is reversed, so that the rise runs into the return). None for two
        dwells.

    Raises
    ------
    InputError
        If an angle is out of range, the sum exceeds one revolution, a ramp is too steep for the lift, or the dwells
        contradict `single_dwell`.

    Examples
    --------
    >>> from flexcam.cams import LAWS
    >>> event = LiftEvent(LAWS["shm"], lift=0.006, rise=math.pi, fall=math.pi)
    >>> event(np.array([0.0, math.pi, 2.0 * math.pi]))
    array([0.   , 0.006, 0.   ])
    """

    law: Law
    lift: float
    rise: float
    fall: float
    dwell: float = 0.0
    phase: float = 0.0
    fall_law: Law | None = None
    ramp: Ramp | None = None
    closing_ramp: Ramp | None = None
    single_dwell: Literal["high", "low"] | None = None

    def __post_init__(self) -> None:
        positive("lift", self.lift, "m")
        positive("rise", self.rise, "rad")
        positive("return", self.fall, "rad")
        positive("dwell", self.dwell, "rad", zero=True)
        if not math.isfinite(self.phase):
            raise refuse("phase", self.phase, "a finite angle, rad")
        total = sum(ramp.duration for ramp in self._ramps if ramp) + self.rise + self.dwell + self.fall
        if total > math.tau + _SNAP:
            given = f"{math.degrees(total):g} deg in all"
            why = "the event repeats every revolution"
            remedy = "shorten it; if these are crank angles, halve them"
            degrees = [angle for angle in (self.rise, self.dwell, self.fall) if angle > 2.0 * math.tau]
            degrees += [ramp.duration for ramp in self._ramps if ramp and ramp.duration > math.pi]
            if degrees:  # without a unit
                remedy = IN_RADIANS.format(max(degrees))
            raise refuse("rise + dwell + return", given, "up to 360 deg of cam angle, ramps included", why, remedy)
        if self.single_dwell == "low" and self.dwell > 0.0:
            raise refuse("dwell", f"{math.degrees(self.dwell):g} deg", "0", 'single_dwell = "low" has no upper dwell')
        if self.single_dwell == "high" and total < math.tau - _SNAP:
            why = 'single_dwell = "high" has no lower dwell'
            raise refuse("rise + dwell + return", f"{math.degrees(total):g} deg in all", "360 deg", why)
        if self.single_dwell not in (None, "high", "low"):
            raise refuse("single_dwell", repr(self.single_dwell), "'high' or 'low'")
        if self.single_dwell == "high" and (self.ramp or self.closing_ramp):
            raise refuse("ramps", "ramps", "none", 'single_dwell = "high" has no lower dwell to ramp from')
        opening, closing = self._ramps
        if closing and closing.height >= self._top:
            given, top = f"a closing ramp of {1e3 * closing.height:.4g} mm", f"below {1e3 * self._top:.4g} mm"
            raise refuse("ramps.closing_height", given, top, "the return ends at that height", "make the ramp lower")
        parts = ("opening", opening, self.rise, self.lift), ("closing", closing, self.fall, self._fall_lift)
        for name, ramp, span, height in parts:
            if ramp and ramp.slope * span / height > 1.0:
                given = f"a maximum slope of {ramp.slope * 1e3:.4g} mm/rad in the {name} ramp"
                why = "the main lift cannot continue such a slope"
                allowed = f"a maximum slope of at most {1e3 * height / span:.4g} mm/rad"
                excess = max(ramp.slope * span / height for _, other, span, height in parts if other == ramp)
                longer = math.ceil(10.0 * math.degrees(ramp.duration * excess)) / 10.0
                added = (math.radians(longer) - ramp.duration) * self._ramps.count(ramp)
                remedy = "reduce the height of the ramp"
                if total + added <= math.tau:
                    remedy = f"make the ramp at least {longer:g} deg long, or reduce its height"
                raise refuse("ramps", given, allowed, why, remedy)

    @property
    def _ramps(self) -> tuple[Ramp | None, Ramp | None]:
        return self.ramp, self.closing_ramp or self.ramp

    @property
    def _fall_lift(self) -> float:
        closing = self._ramps[1]
        return self._top - (closing.height if closing else 0.0)

    @property
    def _top(self) -> float:
        """Lift of the upper dwell, ramp included, m."""
        return self.lift + (self.ramp.height if self.ramp else 0.0)

    @cached_property
    def height(self) -> float:
        """Largest lift including the ramp, m; above that of the upper dwell if a law overshoots 1."""
        top = -curve_minimum(lambda angle: -self(angle), self.joints).value
        return top if top > self._top * (1.0 + _ROUNDING) else self._top

    @cached_property
    def segments(self) -> tuple[Segment, ...]:
        """Segments from the beginning of the opening ramp (or of the rise); the lower dwell follows."""
        opening, closing = self._ramps
        rise_law = ReversedLaw(self.law) if self.single_dwell == "low" else self.law
        fall_law = self.fall_law or self.law
        fall_law = ReversedLaw(fall_law) if self.single_dwell == "low" else fall_law
        low, end = (ramp.height if ramp else 0.0 for ramp in (opening, closing))
        parts = [
            (opening.duration if opening else 0.0, 0.0, low, opening, False),
            (self.rise, low, self.lift, _from(rise_law, opening, self.rise / self.lift), False),
            (self.dwell, self._top, 0.0, None, False),
            (self.fall, end, self._fall_lift, _from(fall_law, closing, self.fall / self._fall_lift), True),
            (closing.duration if closing else 0.0, 0.0, end, closing, True),
        ]
        starts = accumulate((span for span, *_ in parts), initial=0.0)
        return tuple(Segment(start, *part) for start, part in zip(starts, parts, strict=False) if part[0] > 0.0)

    @property
    def start(self) -> float:
        """Cam angle at which the event begins: that of the opening ramp, or the phase, rad."""
        return self.phase - (self.ramp.duration if self.ramp else 0.0)

    @property
    def joints(self) -> tuple[float, ...]:
        """Cam angles, rad from 0 to 2 pi, where a derivative may jump."""
        angles = [self.start + angle for segment in self.segments for angle in segment.joints()]
        return unique_angles(np.array(angles))

    def __call__(self, angle: FloatArray, order: int = 0) -> FloatArray:
        """Return the derivative of the given order (0 to 4) by the cam angle (rad), m/rad^order, shape as `angle`."""
        local = np.mod(np.asarray(angle, dtype=float) - self.start + _SNAP, math.tau) - _SNAP
        value = np.zeros_like(local)
        if not local.size:
            return value
        first, last = float(local.min()), float(local.max())
        for segment in self.segments:
            begin, end = segment.start - _SNAP, segment.start + segment.span - _SNAP
            if begin <= first and last < end:
                return segment(local, order)
            if first < end and begin <= last:
                inside = (local >= begin) & (local < end)
                value[inside] = segment(local[inside], order)
        return value


@dataclass(frozen=True, eq=False)
class DelayedEvent(Event):
    """Event delayed by a phase.

    Examples
    --------
    >>> from flexcam.cams import HarmonicLift
    >>> DelayedEvent(HarmonicLift(0.003, (-0.003,), (0.0,)), math.pi)(np.array([math.pi])).round(9)
    array([0.])
    """

    event: Event
    phase: float  #: delay in cam angle, rad

    @cached_property
    def height(self) -> float:
        """Largest lift, m."""
        return self.event.height

    @property
    def joints(self) -> tuple[float, ...]:
        """Cam angles, rad from 0 to 2 pi, where a derivative may jump."""
        return unique_angles(np.array(self.event.joints) + self.phase) if self.event.joints else ()

    def __call__(self, angle: FloatArray, order: int = 0) -> FloatArray:
        """Return the derivative of the given order (0 to 4) by the cam angle (rad), m/rad^order, shape as `angle`."""
        return self.event(np.asarray(angle, dtype=float) - self.phase, order)


def describe_height(event: Event) -> str:
    """Return the largest lift as text, with the height of the ramp if there is one."""
    inner = event.event if isinstance(event, DelayedEvent) else event
    ramp, text = inner.ramp if isinstance(inner, LiftEvent) else None, format_quantity("m", event.height)
    return f"{text} including the {format_quantity('m', ramp.height)} ramp" if ramp else text


def unique_angles(angles: FloatArray) -> tuple[float, ...]:
    """Return unique angles, rad from 0 to 2 pi, ascending."""
    wrapped = np.sort(np.mod(angles + _SNAP, math.tau) - _SNAP)
    distinct = np.concatenate([[True], np.diff(wrapped) > 2.0 * _SNAP])[: len(wrapped)]
    return tuple((wrapped[distinct] + 0.0).tolist())


def _from(law: Law, ramp: Ramp | None, span_by_lift: float) -> Law:
    return RampTransition(law, ramp.slope * span_by_lift) if ramp else law


@lru_cache(maxsize=64)  # the same cam is evaluated at every speed
def event_extremes(event: Event, order: int = 0) -> tuple[Extreme, Extreme]:
    """Return the minimum and maximum of a lift or of its derivative."""
    peak = curve_minimum(lambda angle: -event(angle, order), event.joints)
    return curve_minimum(lambda angle: event(angle, order), event.joints), Extreme(-peak.value, peak.at)


_DWELL_TOLERANCE = 1e-9  # relative difference of lifts within a dwell
_PEAK_WIDTH, _JOINT_TOLERANCE = 1e-3, 1e-5  # half the width of a peak, and its distance from a joint, rad
_STEP_TOLERANCE = 1e-6  # relative size of a step, to the largest value of its curve, below which it is zero


def centreline(event: Event) -> float:
    """Return the cam angle of the maximum lift, rad from 0 to 2 pi: the middle of an upper dwell."""
    peak = event_extremes(event)[1]
    ends = event.joints
    for start, end in zip(ends, (*ends[1:], *(angle + math.tau for angle in ends[:1])), strict=True):
        middle = 0.5 * (start + end)
        if (event(np.array([start, middle, end])) >= peak.value * (1.0 - _DWELL_TOLERANCE)).all():
            return middle % math.tau
    guess = np.array([peak.at])  # to the square root of rounding: the velocity passes zero sharply
    crossing = bisect(lambda angle: event(angle, 1) <= 0.0, guess - _PEAK_WIDTH, guess + _PEAK_WIDTH)
    crest = float(crossing[0])
    joint = (angle for angle in ends if abs(math.remainder(angle - crest, math.tau)) <= _JOINT_TOLERANCE)
    return next(joint, crest) % math.tau


@dataclass(frozen=True)
class Joint:
    """Boundary between two segments."""

    angle: float  #: cam angle, rad
    #: right minus left of lift, velocity, acceleration and jerk: m, m/rad, m/rad^2, m/rad^3; zero where continuous
    steps: tuple[float, float, float, float]

    @property
    def smooth(self) -> bool:
        """True if all derivatives are continuous."""
        return not any(self.steps)


def joints(event: Event) -> list[Joint]:
    """Return all joints of an event with the steps there."""
    angles = np.array(event.joints)
    steps = np.zeros((len(angles), 4))
    for order in range(4):
        step = event(angles, order) - event(angles - LIMIT_OFFSET, order)
        # Subtract the change of the smooth curve between both places.
        step -= LIMIT_OFFSET * event(angles - LIMIT_OFFSET, order + 1)
        size = float(np.abs(event(GRID[::2], order)).max(initial=0.0))
        steps[:, order] = np.where(np.abs(step) > _STEP_TOLERANCE * size, step, 0.0)
    return [Joint(a, (s[0], s[1], s[2], s[3])) for a, s in zip(angles.tolist(), steps.tolist(), strict=True)]


THRESHOLDS = {"1 mm": 1e-3, "0.05 in": 0.05 * 0.0254}
"""Valve lifts at which events are evaluated."""

_CYCLE = 4.0 * math.pi


@dataclass(frozen=True)
class ValveEvent:
    """Opening and closing of a valve at a lift, in crank angles of a four-stroke cycle."""

    lift: float  #: the lift, m
    #: `opens`, `closes`: crank angles, rad, `opens` from 0 to 4 pi; crank and cam angle are zero together
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
    is_open = event(GRID[:-1]) > cam_lift
    if not is_open.any() or is_open.all():
        return None

    def crossings(*, rising: bool) -> list[float]:
        change = (is_open == rising) & (np.roll(is_open, 1) != rising)
        low, high = GRID[:-1][change] - GRID[1], GRID[:-1][change]
        return bisect(lambda angle: (event(angle) > cam_lift) == rising, low, high).tolist()

    openings, closings = crossings(rising=True), crossings(rising=False)
    pairs = [(a, min((b - a) % (2.0 * math.pi) for b in closings)) for a in openings]
    start, span = max(pairs, key=lambda pair: pair[1])
    start %= math.tau
    return ValveEvent(lift, 2.0 * start, 2.0 * (start + span))


def overlap(one: ValveEvent, other: ValveEvent) -> float:
    """Return the crank angle over which both valves are open."""
    shifts = (-_CYCLE, 0.0, _CYCLE)
    return sum(max(0.0, min(one.closes, other.closes + s) - max(one.opens, other.opens + s)) for s in shifts)
