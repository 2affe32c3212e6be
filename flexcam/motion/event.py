"""One lift of a cam over its revolution: rise, dwell and return, repeated without end."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from flexcam.checks import positive, refuse
from flexcam.linalg import FloatArray
from flexcam.motion.law import Law

_SNAP = 1e-9
"""Angles this close to a joint (rad) count as on it, so that rounding of k * step cannot choose the side of a jump."""


@dataclass(frozen=True)
class LiftEvent:
    """Lift of a follower over the cam angle.

    Parameters
    ----------
    law
        Law of the rise; the return is its mirror image.
    lift
        Full lift, m.
    rise, fall, dwell
        Cam angles of rise, return and upper dwell, rad; the rest of the revolution is the lower dwell.
    phase
        Cam angle at which the rise begins, rad.

    Raises
    ------
    InputError
        If an angle is out of range or they take more than one revolution together.

    Examples
    --------
    >>> from flexcam.motion import SimpleHarmonic
    >>> event = LiftEvent(SimpleHarmonic(), lift=0.006, rise=math.pi, fall=math.pi)
    >>> event(np.array([0.0, math.pi, 2.0 * math.pi]))
    array([0.   , 0.006, 0.   ])
    """

    law: Law
    lift: float
    rise: float
    fall: float
    dwell: float = 0.0
    phase: float = 0.0

    def __post_init__(self) -> None:
        positive("lift", self.lift, "m")
        positive("rise", self.rise, "rad")
        positive("return", self.fall, "rad")
        positive("dwell", self.dwell, "rad", zero=True)
        total = self.rise + self.dwell + self.fall
        if total > 2.0 * math.pi + _SNAP:
            given = f"{math.degrees(total):g} deg in all"
            raise refuse("rise + dwell + return", given, "up to 360 deg", "the event repeats every revolution",
                         "a number without a unit is in rad: write '180 deg'")  # fmt: skip

    def __call__(self, angle: FloatArray, order: int = 0) -> FloatArray:
        """Return the derivative of the lift by the cam angle.

        Parameters
        ----------
        angle
            Cam angle, rad, any shape.
        order
            0 (the lift, m) to 4 (m/rad^4).

        Returns
        -------
        ndarray
            Shape as `angle`.
        """
        local = np.mod(np.asarray(angle, dtype=float) - self.phase + _SNAP, 2.0 * math.pi) - _SNAP
        rising, top, falling = (local < edge - _SNAP for edge in self._edges())
        up = self._part(local / self.rise, order, self.rise)
        down = self._part(1.0 - (local - self.rise - self.dwell) / self.fall, order, -self.fall)
        held = self.lift if order == 0 else 0.0
        return np.select([rising, top, falling], [up, np.full_like(local, held), down], 0.0)

    def _edges(self) -> tuple[float, float, float]:
        return self.rise, self.rise + self.dwell, self.rise + self.dwell + self.fall

    def _part(self, z: FloatArray, order: int, span: float) -> FloatArray:
        """Return the law's part; the return runs backwards: its span is negative, its jumps are seen from below."""
        z = np.clip(z, 0.0, 1.0)
        for jump in self.law.breaks:
            z = np.where(np.abs(z - jump) < _SNAP, jump if span > 0.0 else np.nextafter(jump, 0.0), z)
        return self.lift / span**order * self.law(z, order)
