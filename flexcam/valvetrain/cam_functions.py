"""Functions of the cam angle derived from a cam profile, with derivatives."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from flexcam.cams import CamProfile, SwingFlatFollower, profile_at
from flexcam.cams.profile import Motion
from flexcam.core import FloatArray
from flexcam.core.errors import refuse
from flexcam.dynamics import AngleFunction, CamFunctionCache, DerivedCamFunction
from flexcam.valvetrain.parts import Cam

ANGLES = np.linspace(0.0, 2.0 * np.pi, 7201)
"""Cam angles of the curvature table, which is interpolated at every iteration."""


def _profile(cam: Cam, angle: FloatArray, motion: Motion | None = None) -> CamProfile:
    if cam.follower is None:
        raise refuse("follower", "none", "a follower and a base circle", "the profile follows from them")
    return profile_at(cam.event, cam.follower, angle, cam.turn, motion)


@lru_cache(maxsize=8)
def profile_table(cam: Cam) -> CamProfile:
    """Return the profile at `ANGLES`, for several tables."""
    return _profile(cam, ANGLES)


@dataclass(frozen=True, eq=False)
class _OfProfile(DerivedCamFunction):
    """Function of the cam angle derived from the profile, with its derivative."""

    cam: Cam
    value: Callable[[CamProfile], FloatArray]
    slope: Callable[[CamProfile], FloatArray]

    def of(self, cam: CamFunctionCache, order: int) -> FloatArray:
        return (self.value, self.slope)[order](cached_profile(self.cam, cam))


def cached_profile(cam: Cam, at: CamFunctionCache) -> CamProfile:
    """Return the profile at cam angles, computed once and cached."""

    def made() -> CamProfile:
        event = cam.event
        return _profile(cam, at.angle, (at(event, 0), at(event, 1), at(event, 2)))

    return at.lookup((cached_profile, id(cam)), made)


@lru_cache(maxsize=8)
def lift_ratio(cam: Cam) -> AngleFunction:
    """Return the lift per motion of the cam along the initial lift direction."""
    return _OfProfile(cam, lambda made: made.push.real, lambda made: made.push_rate.real)


@lru_cache(maxsize=8)
def transverse_lift_ratio(cam: Cam) -> AngleFunction:
    """Return the lift per motion of the cam to the right.

    For a translating follower this is the tangent of the pressure angle.
    """
    return _OfProfile(cam, lambda made: -made.push.imag, lambda made: -made.push_rate.imag)


@lru_cache(maxsize=8)
def pressure_tangent(cam: Cam) -> AngleFunction:
    """Return the tangent of the pressure angle relative to the rotated arm."""
    return _OfProfile(
        cam, lambda made: np.tan(made.pressure_angle), lambda made: made.pressure_rate / made.touch.reach**2
    )


@lru_cache(maxsize=8)
def sliding_ratio(cam: Cam) -> AngleFunction:
    """Return the sliding path per cam angle, m, of the cam's surface to the right of a flat face."""
    return _OfProfile(cam, lambda made: made.touch.sliding, lambda made: made.touch.sliding_rate)


@lru_cache(maxsize=8)
def normal_force_ratio(cam: Cam) -> AngleFunction:
    """Return the force along the normal per force along the lift."""
    return _OfProfile(cam, lambda made: 1.0 / made.touch.reach, lambda made: _by_reach_rate(made, 1.0, 0.0))


@lru_cache(maxsize=8)
def cam_sliding(cam: Cam) -> AngleFunction:
    """Return the path per cam angle, m, of the cam's surface along a flat face, divided by the reach."""
    off = face_sliding(cam)
    return _OfProfile(
        cam,
        lambda made: (made.touch.sliding + off * made.velocity) / made.touch.reach,
        lambda made: _by_reach_rate(
            made, made.touch.sliding + off * made.velocity, made.touch.sliding_rate + off * made.acceleration
        ),
    )


def _by_reach_rate(made: CamProfile, value: FloatArray | float, rate: FloatArray | float) -> FloatArray:
    """Return the derivative of a value by the reach."""
    return (rate - value * made.touch.reach_rate / made.touch.reach) / made.touch.reach


def face_sliding(cam: Cam) -> float:
    """Return the path of a swinging flat face along itself to the right, per lift."""
    one = cam.follower
    return one.side * one.face / one.arm if isinstance(one, SwingFlatFollower) else 0.0


@lru_cache(maxsize=8)
def sliding_distance(cam: Cam) -> AngleFunction:
    """Return the sliding path since cam angle zero, divided by the reach, m."""
    slid = _OfProfile(
        cam,
        lambda made: made.touch.sliding / made.touch.reach,
        lambda made: _by_reach_rate(made, made.touch.sliding, made.touch.sliding_rate),
    )
    return _SlidingDistance(slid, cam, face_sliding(cam))


class _SlidingDistance(DerivedCamFunction):
    """Sliding path since cam angle zero, m; `path` is its derivative.

    The motion of the face itself, `off` times the lift, is added because it is part of the follower's motion.
    """

    def __init__(self, path: AngleFunction, cam: Cam, off: float) -> None:
        self._cam, self._off = cam, off
        width = ANGLES[1]
        x, w = np.polynomial.legendre.leggauss(4)
        within = path((ANGLES[:-1, None] + 0.5 * width * (1.0 + x)).ravel(), 0).reshape(-1, 4)
        self._path, self._slopes = path, path(ANGLES, 0)
        self._sums = np.concatenate([[0.0], np.cumsum(0.5 * width * (within @ w))])

    def of(self, cam: CamFunctionCache, order: int) -> FloatArray:
        slid = cam(self._path, order - 1) if order else self._slid(cam.angle)
        if not self._off:
            return slid
        made = cached_profile(self._cam, cam)
        if order:
            return slid + self._off * _by_reach_rate(made, made.lift, made.velocity)
        return slid + self._off * made.lift / made.touch.reach

    def _slid(self, angle: FloatArray) -> FloatArray:
        width, sums, slopes = ANGLES[1], self._sums, self._slopes
        turns, rest = np.divmod(angle, 2.0 * np.pi)
        i = np.minimum((rest / width).astype(int), len(ANGLES) - 2)
        z = (rest - ANGLES[i]) / width
        y = 1.0 - z
        # Hermite's cubic through sums and slopes.
        ends = y * y * (1.0 + 2.0 * z) * sums[i] + z * z * (3.0 - 2.0 * z) * sums[i + 1]
        return turns * sums[-1] + ends + width * z * y * (y * slopes[i] - z * slopes[i + 1])


def interpolate_table(values: FloatArray) -> AngleFunction:
    """Return the interpolation of values at `ANGLES`, without derivatives."""

    def looked_up(angle: FloatArray, order: int) -> FloatArray:
        del order
        return np.interp(np.mod(angle, 2.0 * np.pi), ANGLES, values)

    return looked_up
