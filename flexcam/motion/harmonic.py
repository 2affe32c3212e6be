"""Laws made of a line and a few harmonics."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from flexcam.linalg import FloatArray


@dataclass(frozen=True)
class Harmonic:
    """s = z - sum c_n sin(2 pi n z)/(2 pi n): the cycloidal law is the one with c_1 = 1 alone.

    s' vanishes at both ends if the c_n sum to 1.

    Parameters
    ----------
    harmonics
        Pairs of order n and coefficient c_n.

    Examples
    --------
    >>> Harmonic(((1, 1.0),))(np.array([0.5])).round(12)
    array([0.5])
    """

    harmonics: tuple[tuple[int, float], ...]

    @property
    def breaks(self) -> tuple[float, ...]:
        """Positions of inner jumps."""
        return ()

    def __call__(self, z: FloatArray, order: int = 0) -> FloatArray:
        """Return the derivative of the given order at z."""
        value = (z, np.ones_like(z))[order] if order < 2 else np.zeros_like(z)
        for n, c in self.harmonics:
            w = 2.0 * math.pi * n
            value = value - c * w ** (order - 1) * np.sin(w * z + order * math.pi / 2.0)
        return value


GUTMAN = Harmonic(((1, 15.0 / 16.0), (3, 1.0 / 16.0)))
"""Gutman's 1-3 law: z - 15 sin(2 pi z)/(32 pi) - sin(6 pi z)/(96 pi)."""

FREUDENSTEIN = Harmonic(((1, 27.0 / 28.0), (3, 1.0 / 28.0)))
"""Freudenstein's 1-3 law: z - (27/28 sin 2 pi z + 1/84 sin 6 pi z)/(2 pi)."""
