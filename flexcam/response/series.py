"""Motions over time, and the motion between saved instants."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from flexcam.linalg import FloatArray, IntArray

SLOPES = {"displacement": "velocity", "velocity": "acceleration"}
"""Motions that are cubics between two instants, and what their slopes are."""


@dataclass(frozen=True, eq=False)
class Series:
    """Displacement, velocity and acceleration over some instants, arrays of one shape (times, columns)."""

    displacement: FloatArray
    velocity: FloatArray
    acceleration: FloatArray

    @classmethod
    def joined(cls, parts: Sequence[Series]) -> Series:
        """Return the parts one after the other."""
        return cls(*(np.concatenate([getattr(p, name) for p in parts]) for name in cls.__annotations__))

    def between(self, own: FloatArray, times: FloatArray) -> Series:
        """Return the motion at other times than its own, s, rising, from the instants on both sides of each.

        Displacements are cubics with the velocities at both ends, velocities cubics with the accelerations,
        accelerations straight lines: of higher order than the integrators, and without overshoot where a law jumps.
        """
        right = np.clip(np.searchsorted(own, times, side="right"), 1, len(own) - 1)
        left = right - 1
        length = (own[right] - own[left])[:, None]
        x = (times - own[left])[:, None] / length
        d, v, a = self.displacement, self.velocity, self.acceleration
        moved = _cubic(x, d[left], d[right], length * v[left], length * v[right])
        moving = _cubic(x, v[left], v[right], length * a[left], length * a[right])
        return Series(moved, moving, a[left] + x * (a[right] - a[left]))

    def at(self, instants: NDArray[np.bool_] | IntArray | slice) -> Series:
        """Return the chosen instants: yes or no for each, or their places."""
        return Series(self.displacement[instants], self.velocity[instants], self.acceleration[instants])


def _cubic(x: FloatArray, old: FloatArray, new: FloatArray, slope: FloatArray, new_slope: FloatArray) -> FloatArray:
    """Return Hermite's cubic at x from 0 to 1."""
    y = 1.0 - x
    return y * y * ((1.0 + 2.0 * x) * old + x * slope) + x * x * ((3.0 - 2.0 * x) * new - y * new_slope)
