"""Cycloidal motion."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from flexcam.linalg import FloatArray


@dataclass(frozen=True)
class Cycloidal:
    """s = z - sin(2 pi z)/(2 pi); its acceleration is continuous from dwell to dwell.

    Source: R. L. Norton, Cam Design and Manufacturing Handbook, 2nd ed. (2009), ch. 2.

    Examples
    --------
    >>> Cycloidal()(np.array([0.0, 0.5, 1.0])).round(12)
    array([0. , 0.5, 1. ])
    """

    @property
    def breaks(self) -> tuple[float, ...]:
        """Positions of inner jumps."""
        return ()

    def __call__(self, z: FloatArray, order: int = 0) -> FloatArray:
        """Return the derivative of the given order at z."""
        line = (z, np.ones_like(z))[order] if order < 2 else np.zeros_like(z)
        return line - (2.0 * math.pi) ** (order - 1) * np.sin(2.0 * math.pi * z + order * math.pi / 2.0)

    def residual(self, ratio: FloatArray) -> FloatArray:
        """Return the residual amplitude abs(sin pi l)/(pi l abs(1 - l^2)), with its limit 1/2 at l = 1."""
        return np.abs(np.sinc(ratio - 1.0) / (ratio * (1.0 + ratio)))
