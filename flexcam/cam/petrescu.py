"""Profiles and efficiency of F. I. T. Petrescu and R. V. V. Petrescu, Settings of the valve spring (2013)."""

from __future__ import annotations

import numpy as np

from flexcam.checks import positive
from flexcam.linalg import FloatArray
from flexcam.motion import Event


def relaxed_arm(event: Event, base_radius: float, angle: FloatArray) -> FloatArray:
    """Return r_a = sqrt(2 r_0 s + s^2), which takes the place of s' in the relaxed profile, m."""
    lift = np.maximum(event(angle), 0.0)
    return np.sqrt(lift * (2.0 * positive("base_radius", base_radius, "m") + lift))


def petrescu_profile(event: Event, base_radius: float, angle: FloatArray, *, relaxed: bool = True) -> FloatArray:
    """Return the profile under a flat follower: relaxed, with r_a, or classical, with s'.

    x = r_a cos phi + (r_0 + s) sin phi, y = (r_0 + s) cos phi - r_a sin phi. Only the classical one lifts the follower
    by s; it is the profile of `flexcam.cam.cam_profile` for a cam that turns counterclockwise.
    """
    arm = _arm(event, base_radius, angle, relaxed=relaxed)
    height = base_radius + event(angle)
    return np.column_stack([
        arm * np.cos(angle) + height * np.sin(angle), height * np.cos(angle) - arm * np.sin(angle),
    ])  # fmt: skip


def petrescu_efficiency(event: Event, base_radius: float, angle: FloatArray, *, relaxed: bool = True) -> FloatArray:
    """Return sin^2(tau) = r_a^2/((r_0 + s)^2 + r_a^2), with s' in place of r_a for the classical profile."""
    arm = _arm(event, base_radius, angle, relaxed=relaxed)
    return arm**2 / ((base_radius + event(angle)) ** 2 + arm**2)


def _arm(event: Event, base_radius: float, angle: FloatArray, *, relaxed: bool) -> FloatArray:
    positive("base_radius", base_radius, "m")
    return relaxed_arm(event, base_radius, angle) if relaxed else event(angle, 1)
