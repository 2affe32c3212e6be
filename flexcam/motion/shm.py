"""Simple harmonic motion."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from flexcam.linalg import FloatArray


@dataclass(frozen=True)
class SimpleHarmonic:
    """s = (1 - cos pi z)/2; its acceleration steps where it meets a dwell.

    Source: R. L. Norton, Cam Design and Manufacturing Handbook, 2nd ed. (2009), ch. 2.

    Examples
    --------
    >>> SimpleHarmonic()(np.array([0.0, 0.5, 1.0]))
    array([0. , 0.5, 1. ])
    """

    @property
    def breaks(self) -> tuple[float, ...]:
        """Positions of inner jumps."""
        return ()

    def __call__(self, z: FloatArray, order: int = 0) -> FloatArray:
        """Return the derivative of the given order at z."""
        offset = 0.5 if order == 0 else 0.0
        return offset - 0.5 * math.pi**order * np.cos(math.pi * z + order * math.pi / 2.0)

    def residual(self, ratio: FloatArray) -> FloatArray:
        """Return the residual amplitude abs(cos pi l)/abs(4 l^2 - 1), with its limit pi/4 at l = 1/2."""
        # cos pi l = sin(pi (1/2 - l)); the factor (1 - 2 l) cancels.
        return np.abs(0.5 * math.pi * np.sinc(0.5 - ratio) / (2.0 * ratio + 1.0))
