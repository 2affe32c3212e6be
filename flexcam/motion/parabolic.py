"""Parabolic motion: the least peak acceleration of all laws."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from flexcam.linalg import FloatArray


@dataclass(frozen=True)
class Parabolic:
    """s = 2 z^2 up to the middle, 1 - 2 (1 - z)^2 after it; the acceleration is 4, then -4.

    Source: R. L. Norton, Cam Design and Manufacturing Handbook, 2nd ed. (2009), ch. 2 (constant acceleration).

    Examples
    --------
    >>> Parabolic()(np.array([0.0, 0.5, 1.0]), order=2)
    array([ 4., -4., -4.])
    """

    @property
    def breaks(self) -> tuple[float, ...]:
        """Positions of inner jumps."""
        return (0.5,)

    def __call__(self, z: FloatArray, order: int = 0) -> FloatArray:
        """Return the derivative of the given order at z."""
        if order > 2:
            return np.zeros_like(z)
        first = (2.0 * z**2, 4.0 * z, np.full_like(z, 4.0))[order]
        second = (1.0 - 2.0 * (1.0 - z) ** 2, 4.0 * (1.0 - z), np.full_like(z, -4.0))[order]
        return np.where(z < 0.5, first, second)

    def residual(self, ratio: FloatArray) -> FloatArray:
        """Return the residual amplitude 4 sin^2(pi l/2)/(pi l)^2."""
        return np.sinc(0.5 * ratio) ** 2
