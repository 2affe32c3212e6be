"""The profile that a lift and a follower ask for, and what it does to them."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from flexcam.cam.follower import ComplexArray, Follower, Touch, Turn
from flexcam.checks import positive, refuse
from flexcam.linalg import FloatArray
from flexcam.motion import Event, Extreme, lowest

_REVOLUTION = 2.0 * math.pi
_MOST_POINTS = 1_000_000
_STRAIGHT = 1e-9
"""Curvature of the path of a roller's centre, over that of the roller, that is none."""


@dataclass(frozen=True, eq=False)
class CamProfile:
    """A cam, point by point, in its own frame: the one in which the follower stands where the cam angle is zero.

    Parameters
    ----------
    follower
        The follower it was made for.
    turn
        Sense of rotation: 1 counterclockwise, -1 clockwise.
    angle
        Cam angles, rad, shape (n,).
    lift, velocity, acceleration
        Of the follower, m, m/rad, m/rad^2, shape (n,).
    touch
        Contact in the fixed frame.
    event
        The lift it was made of.
    """

    follower: Follower
    turn: Turn
    angle: FloatArray
    lift: FloatArray
    velocity: FloatArray
    acceleration: FloatArray
    touch: Touch
    event: Event

    @cached_property
    def extremes(self) -> ProfileExtremes:
        """Extremes over the whole revolution, between the points too."""
        return profile_extremes(self.event, self.follower, self.turn)

    @property
    def points(self) -> FloatArray:
        """Profile, m, shape (n, 2), frame of the cam."""
        return self._turned(self.touch.point)

    @property
    def pitch(self) -> FloatArray:
        """Path of the roller's centre (the profile itself for a flat face), m, shape (n, 2), frame of the cam."""
        return self._turned(self.touch.trace)

    @property
    def normals(self) -> FloatArray:
        """Outward unit normals, shape (n, 2), frame of the cam."""
        return self._turned(self.touch.normal)

    @property
    def radius(self) -> FloatArray:
        """Radius of curvature, m, shape (n,): negative where hollow."""
        return self.touch.radius

    @property
    def pressure_angle(self) -> FloatArray:
        """Angle from the normal to the follower's motion on the rise, rad, counterclockwise, shape (n,)."""
        return np.angle(self.touch.motion * np.conj(self.touch.normal))

    @property
    def pressure_rate(self) -> FloatArray:
        """Derivative of the pressure angle by the cam angle, 1, shape (n,)."""
        return self.touch.pressure_rate

    @property
    def push(self) -> ComplexArray:
        """Lift per motion of the cam along the lift as it begins (real part) and to its left, shape (n,)."""
        return self.touch.normal * np.conj(self.follower.lift_direction) / self.touch.reach

    @property
    def push_rate(self) -> ComplexArray:
        """Derivative of `push` by the cam angle, shape (n,)."""
        return self.push * (1j * self.touch.turning - self.touch.reach_rate / self.touch.reach)

    @property
    def offset(self) -> FloatArray:
        """Distance of the contact from the normal's parallel through the cam's centre, m; s' under a flat follower."""
        return -(self.touch.point * np.conj(1j * self.touch.normal)).real

    def _turned(self, fixed: ComplexArray) -> FloatArray:
        own = fixed * np.exp(-1j * self.turn * self.angle)
        return np.column_stack([own.real, own.imag])

    def cutter_path(self, radius: float) -> FloatArray:
        """Return the path of a cutter's or grinding wheel's centre, m, shape (n, 2), frame of the cam."""
        return self.points + positive("cutter", radius, "m") * self.normals


def cam_profile(event: Event, follower: Follower, *, count: int = 720, turn: Turn = 1) -> CamProfile:
    """Return the profile of a cam at even cam angles."""
    if not 12 <= count <= _MOST_POINTS:
        raise refuse("count", count, f"a whole number from 12 to {_MOST_POINTS}")
    return profile_at(event, follower, np.linspace(0.0, _REVOLUTION, count, endpoint=False), turn)


Motion = tuple[FloatArray, FloatArray, FloatArray]
"""Lift, velocity and acceleration at some cam angles, m, m/rad, m/rad^2."""


def profile_at(
    event: Event, follower: Follower, angle: FloatArray, turn: Turn = 1, motion: Motion | None = None
) -> CamProfile:
    """Return the profile of a cam at given cam angles."""
    lift, velocity, acceleration = motion or (event(angle), event(angle, 1), event(angle, 2))
    # A radius is infinite at a point of inflection, and where the pitch curve stands still.
    with np.errstate(divide="ignore", invalid="ignore"):
        touch = follower.touch(lift, velocity, acceleration, turn)
    return CamProfile(follower, turn, angle, lift, velocity, acceleration, touch, event)


@dataclass(frozen=True)
class ProfileExtremes:
    """What is largest and least on a profile, each with its cam angle, rad.

    Parameters
    ----------
    convex
        Least radius of curvature where the profile is convex, m; zero or less where it is undercut.
    hollow
        Radius of the tightest hollow, m, above zero; None where there is none.
    pressure_angle
        The steepest, signed, rad.
    offset
        Least and largest distance of the contact, m.
    sliding
        The fastest, signed, m/rad.
    """

    convex: Extreme
    hollow: Extreme | None
    pressure_angle: Extreme
    offset: tuple[Extreme, Extreme]
    sliding: Extreme


def profile_extremes(event: Event, follower: Follower, turn: Turn = 1) -> ProfileExtremes:
    """Return the extremes of a profile over the whole revolution.

    Under a roller the curvature of its centre's path is what is looked at: it passes smoothly through the points of
    inflection and through undercut, where the radius of the profile leaps.
    """

    def seen(measure: Callable[[CamProfile], FloatArray], sign: float = 1.0) -> Extreme:
        found = lowest(lambda angle: sign * measure(profile_at(event, follower, angle, turn)), event.joints)
        return Extreme(sign * found.value, found.at)

    def largest(measure: Callable[[CamProfile], FloatArray]) -> Extreme:
        ends = seen(measure), seen(measure, -1.0)
        return max(ends, key=lambda one: abs(one.value))

    convex, hollow = _curvatures(seen, follower)
    offset = seen(lambda made: made.offset), seen(lambda made: made.offset, -1.0)
    steepest, fastest = largest(lambda made: made.pressure_angle), largest(lambda made: made.touch.sliding)
    return ProfileExtremes(convex, hollow, steepest, offset, fastest)


def _curvatures(
    seen: Callable[[Callable[[CamProfile], FloatArray], float], Extreme], follower: Follower
) -> tuple[Extreme, Extreme | None]:
    """Return the least radius of convex parts and that of the tightest hollow."""
    roller = follower.roller_radius
    if not math.isfinite(roller):
        return seen(lambda made: made.radius, 1.0), None

    def bend(made: CamProfile) -> FloatArray:
        with np.errstate(divide="ignore"):
            return 1.0 / (made.radius + roller)

    tight, deep = seen(bend, -1.0), seen(bend, 1.0)
    hollow = Extreme(roller - 1.0 / deep.value, deep.at) if deep.value < -_STRAIGHT / roller else None
    return Extreme(1.0 / tight.value - roller, tight.at), hollow
