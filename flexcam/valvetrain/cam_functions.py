"""Functions of the cam angle derived from a cam profile, with derivatives."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache, wraps
from typing import TypeVar

import numpy as np

from flexcam.cams import CamProfile, Event, Follower, SwingFlatFollower, Turn, profile_at
from flexcam.cams.profile import Motion
from flexcam.core import FloatArray
from flexcam.core.errors import refuse
from flexcam.dynamics import AngleFunction, CamFunctionCache, DerivedCamFunction
from flexcam.dynamics.law_data import CamLift
from flexcam.valvetrain.parts import Cam

ANGLES = np.linspace(0.0, 2.0 * np.pi, 7201)
"""Cam angles of the profile that is checked, and of the sums of the sliding path."""


def _profile(cam: Cam, angle: FloatArray, motion: Motion | None = None) -> CamProfile:
    if cam.follower is None:
        raise refuse("follower", "none", "a follower and a base circle", "the profile follows from them")
    return profile_at(cam.event, cam.follower, angle, cam.turn, motion)


@lru_cache(maxsize=64)
def _shape(event: Event, follower: Follower | None, turn: Turn) -> Cam:
    """Return one cam for all with equal profiles and angles."""
    return Cam("", event, follower, turn)


def _shape_of(cam: Cam) -> Cam:
    return _shape(cam.event, cam.follower, cam.turn)


T = TypeVar("T")


def _by_shape(make: Callable[[Cam], T]) -> Callable[[Cam], T]:
    """Cache a function of a cam, computed once for all cams with equal profiles and angles."""
    cached = lru_cache(maxsize=64)(make)

    @wraps(make)
    def function(cam: Cam) -> T:
        return cached(_shape_of(cam))

    return function


@_by_shape
def profile_table(cam: Cam) -> CamProfile:
    """Return the profile at `ANGLES`, for several tables."""
    return _profile(cam, ANGLES)


@lru_cache(maxsize=64)
def lift_polynomials(event: Event) -> CamLift:
    """Return the lift as polynomials of the cam angle."""
    return CamLift.of(event, event.joints)


@dataclass(frozen=True, eq=False)
class _OfProfile(DerivedCamFunction):
    """Function of the cam angle derived from the profile, with its derivative."""

    cam: Cam
    value: Callable[[CamProfile], FloatArray]
    slope: Callable[[CamProfile], FloatArray]

    def of(self, cam: CamFunctionCache, order: int) -> FloatArray:
        """Return a derivative, see `DerivedCamFunction`."""
        return (self.value, self.slope)[order](cached_profile(self.cam, cam))


def cached_profile(cam: Cam, at: CamFunctionCache) -> CamProfile:
    """Return the profile at cam angles, computed once for all cams of one shape and cached."""
    shape = _shape_of(cam)

    def compute() -> CamProfile:
        event = cam.event
        return _profile(shape, at.angle, (at(event, 0), at(event, 1), at(event, 2)))

    return at.lookup((cached_profile, shape), compute)


Values = Callable[[CamProfile], FloatArray]


def _profile_function(value: Values, slope: Values) -> Callable[[Cam], AngleFunction]:
    """Return the function of a cam that gives a value of its profile and its derivative over the cam angle."""

    @_by_shape
    def function(cam: Cam) -> AngleFunction:
        """Return a function of the cam angle."""
        return _OfProfile(cam, value, slope)

    return function


def _by_reach_rate(profile: CamProfile, value: FloatArray | float, rate: FloatArray | float) -> FloatArray:
    """Return the derivative of a value by the reach."""
    return (rate - value * profile.touch.reach_rate / profile.touch.reach) / profile.touch.reach


def face_sliding(follower: Follower | None) -> float:
    """Return the path of a swinging flat face along itself to the right, per lift."""
    return follower.side * follower.face / follower.arm if isinstance(follower, SwingFlatFollower) else 0.0


def _along_face(profile: CamProfile) -> FloatArray:
    return profile.touch.sliding + face_sliding(profile.follower) * profile.velocity


def _along_face_rate(profile: CamProfile) -> FloatArray:
    return profile.touch.sliding_rate + face_sliding(profile.follower) * profile.acceleration


lift_ratio = _profile_function(lambda p: p.push.real, lambda p: p.push_rate.real)
"""Lift per motion of the cam along the initial lift direction."""

transverse_lift_ratio = _profile_function(lambda p: -p.push.imag, lambda p: -p.push_rate.imag)
"""Lift per motion of the cam to the right; for a translating follower the tangent of the pressure angle."""

pressure_tangent = _profile_function(
    lambda p: np.tan(p.pressure_angle), lambda p: p.touch.pressure_rate / p.touch.reach**2
)
"""Tangent of the pressure angle relative to the rotated arm."""

sliding_ratio = _profile_function(lambda p: p.touch.sliding, lambda p: p.touch.sliding_rate)
"""Sliding path per cam angle, m, of the cam's surface to the right of a flat face."""

normal_force_ratio = _profile_function(lambda p: 1.0 / p.touch.reach, lambda p: _by_reach_rate(p, 1.0, 0.0))
"""Force along the normal per force along the lift."""

reach = _profile_function(lambda p: p.touch.reach, lambda p: p.touch.reach_rate)
"""Lift per motion along the normal."""

cam_sliding = _profile_function(
    lambda p: _along_face(p) / p.touch.reach, lambda p: _by_reach_rate(p, _along_face(p), _along_face_rate(p))
)
"""Path per cam angle, m, of the cam's surface along a flat face, divided by the reach."""

_sliding_by_reach = _profile_function(
    lambda p: p.touch.sliding / p.touch.reach, lambda p: _by_reach_rate(p, p.touch.sliding, p.touch.sliding_rate)
)


def outer_flank(radius: FloatArray, roller: float) -> FloatArray:
    """Return the radius of curvature of the outer flank of a groove, parallel to the inner one; convex is positive."""
    return -(radius + 2.0 * roller)


@lru_cache(maxsize=64)
def relative_radius(cam: Cam, most: float, *, outer: bool = False) -> AngleFunction:
    """Return the relative radius of curvature of cam, or outer flank of a groove, and follower, m, up to a limit.

    It has no derivative.
    """
    roller = cam.follower.roller_radius if cam.follower else np.inf

    def radius(profile: CamProfile) -> FloatArray:
        flank = outer_flank(profile.radius, roller) if outer else profile.radius
        return 1.0 / np.maximum(1.0 / flank + 1.0 / roller, 1.0 / most)

    return _OfProfile(cam, radius, lambda profile: np.zeros_like(profile.radius))


@_by_shape
def sliding_distance(cam: Cam) -> AngleFunction:
    """Return the sliding path since cam angle zero, divided by the reach, m."""
    return _SlidingDistance(_sliding_by_reach(cam), cam, face_sliding(cam.follower))


class _SlidingDistance(DerivedCamFunction):
    """Sliding path since cam angle zero, m; `path` is its derivative.

    The motion of the face itself, `face_ratio` times the lift, is added because it is part of the follower's motion.
    """

    def __init__(self, path: AngleFunction, cam: Cam, face_ratio: float) -> None:
        from scipy.interpolate import CubicHermiteSpline

        self._cam, self._face_ratio = cam, face_ratio
        width = ANGLES[1]
        x, w = np.polynomial.legendre.leggauss(4)
        values = path((ANGLES[:-1, None] + 0.5 * width * (1.0 + x)).ravel(), 0).reshape(-1, 4)
        sums = np.concatenate([[0.0], np.cumsum(0.5 * width * (values @ w))])
        self._path, self._whole = path, float(sums[-1])
        self._within = CubicHermiteSpline(ANGLES, sums, path(ANGLES, 0))

    def of(self, cam: CamFunctionCache, order: int) -> FloatArray:
        """Return a derivative, see `DerivedCamFunction`."""
        revolutions, remainder = np.divmod(cam.angle, 2.0 * np.pi)
        distance = cam(self._path, order - 1) if order else revolutions * self._whole + self._within(remainder)
        if not self._face_ratio:
            return distance
        profile = cached_profile(self._cam, cam)
        if order:
            return distance + self._face_ratio * _by_reach_rate(profile, profile.lift, profile.velocity)
        return distance + self._face_ratio * profile.lift / profile.touch.reach
