"""Laws made of a line and a few harmonics."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from flexcam.checks import refuse
from flexcam.linalg import FloatArray


@dataclass(frozen=True)
class Harmonic:
    """s = z - sum c_n sin(2 pi n z)/(2 pi n): the cycloidal law is the one with c_1 = 1 alone.

    s' vanishes at both ends if the c_n sum to 1.

    Parameters
    ----------
    harmonics
        Pairs of order n and coefficient c_n.

    Raises
    ------
    InputError
        If an order is no whole number from 1 or a coefficient not finite.

    Examples
    --------
    >>> Harmonic(((1, 1.0),))(np.array([0.5])).round(12)
    array([0.5])
    """

    harmonics: tuple[tuple[int, float], ...]

    def __post_init__(self) -> None:
        if not all(n >= 1 and n == int(n) and math.isfinite(c) for n, c in self.harmonics):
            raise refuse("harmonics", list(self.harmonics), "pairs of a whole number from 1 and a finite number")

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

    def residual(self, ratio: FloatArray) -> FloatArray:
        """Return the residual amplitude: abs(sin pi l)/(pi l) times abs(1 + sum c_n l^2/(n^2 - l^2))."""
        total = np.sinc(ratio)
        for n, c in self.harmonics:
            # sin(pi l)/(n - l) = (-1)^(n + 1) sin(pi (l - n))/(l - n): finite where they meet.
            total = total + c * ratio * (-1.0) ** (n + 1) * np.sinc(ratio - n) / (n + ratio)
        return np.abs(total)


PAVLOVIC_TRIGONOMETRIC = Harmonic(((1, 15.0 / 16.0), (2, 1.0 / 24.0)))
"""z - 15 sin(2 pi z)/(32 pi) - sin(4 pi z)/(96 pi), as the figures of V. D. Pavlovic and M. M. Lutovac, New class of
camshaft transfer functions, were computed; s' = 1/48 at both ends, which breaks the paper's conditions (2) and (4). The
classical law is Gutman's, with 6 pi in place of 4 pi."""

GUTMAN = Harmonic(((1, 15.0 / 16.0), (3, 1.0 / 16.0)))
"""Gutman's 1-3 law: z - 15 sin(2 pi z)/(32 pi) - sin(6 pi z)/(96 pi)."""

FREUDENSTEIN = Harmonic(((1, 27.0 / 28.0), (3, 1.0 / 28.0)))
"""Freudenstein's 1-3 law: z - (27/28 sin 2 pi z + 1/84 sin 6 pi z)/(2 pi)."""
