"""A cam that turns by its own inertia: its speed follows from the energy of cam and follower.

Equations of the paper on the settings of the valve spring (one-mass model, variable speed): with the reduced inertia
``J = m_c/2 (r0^2 + 4 r0 s + 2 s^2) + m_t s'^2`` the energy ``J omega^2`` stays what it is at the mean speed and the
inertia ``m_c/2 (r0 + h)^2``.
"""

from __future__ import annotations

import numpy as np

from flexcam.checks import did_you_mean, refuse
from flexcam.linalg import FloatArray
from flexcam.motion import Event
from flexcam.system import AngleFunction, SpeedByAngle
from flexcam.train.model import Model


def free_running(
    model: Model,
    speed: float,
    cam: str,
    cam_mass: float,
    follower_mass: float,
    start: float = 0.0,
    time: float = 0.0,
) -> SpeedByAngle:
    """Return the drive of a freely running cam."""
    if cam not in model.cams:
        raise refuse(
            "run.free_running.cam", repr(cam), f"one of {', '.join(model.cams)}", "", did_you_mean(cam, model.cams)
        )
    part = model.cams[cam]
    if part.follower is None:
        why = "the inertia of the cam follows from its base circle"
        raise refuse(f"cams.{cam}", "no base circle", "base_radius and follower", why, "add both")
    omega = free_speed(part.event, part.follower.base_radius, speed, cam_mass, follower_mass)
    return SpeedByAngle(omega, start, time)


def free_speed(event: Event, base_radius: float, speed: float, cam_mass: float, follower_mass: float) -> AngleFunction:
    """Return the speed of a freely running cam over its angle."""
    r0, mean = base_radius, 0.5 * cam_mass * (base_radius + event.height) ** 2

    def inertia(angle: FloatArray) -> tuple[FloatArray, FloatArray]:
        s, slope, bend = (event(angle, order) for order in range(3))
        disc = 0.5 * cam_mass * (r0**2 + 4.0 * r0 * s + 2.0 * s**2)
        return disc + follower_mass * slope**2, 2.0 * slope * (cam_mass * (r0 + s) + follower_mass * bend)

    def omega(angle: FloatArray, order: int) -> FloatArray:
        J, change = inertia(angle)
        found = speed * np.sqrt(mean / J)
        return found if order == 0 else -0.5 * found * change / J

    return omega
