"""How the camshaft turns."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np

from flexcam.checks import positive
from flexcam.linalg import FloatArray


@dataclass(frozen=True, eq=False)
class CamMotion:
    """Cam angle and its rates at some instants, all of one shape.

    Parameters
    ----------
    angle, speed, rate
        rad, rad/s, rad/s^2.
    """

    angle: FloatArray
    speed: FloatArray
    rate: FloatArray


class Drive(Protocol):
    """How the camshaft turns."""

    def at(self, time: FloatArray) -> CamMotion:
        """Return the motion at the given times, s."""
        ...


@dataclass(frozen=True)
class ConstantSpeed:
    """Camshaft at constant speed.

    Parameters
    ----------
    speed
        rad/s, above zero.
    start
        Cam angle at time zero, rad.

    Examples
    --------
    >>> ConstantSpeed(2.0).at(np.array([0.5])).angle
    array([1.])
    """

    speed: float
    start: float = 0.0

    def __post_init__(self) -> None:
        positive("speed", self.speed, "rad/s")

    def at(self, time: FloatArray) -> CamMotion:
        """Return angle, speed and a zero rate at the given times, s."""
        time = np.asarray(time, dtype=float)
        return CamMotion(self.start + self.speed * time, np.full_like(time, self.speed), np.zeros_like(time))
