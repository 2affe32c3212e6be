"""Gauss quadrature over the rise, panel by panel between a law's joints."""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from flexcam.linalg import FloatArray

_POINTS = 16


def quadrature(breaks: tuple[float, ...], panels: int = 64) -> list[tuple[FloatArray, FloatArray]]:
    """Return Gauss points and weights of panels of which none holds a joint."""
    points, weights = np.polynomial.legendre.leggauss(_POINTS)
    edges = np.unique(np.concatenate([np.linspace(0.0, 1.0, panels + 1), breaks]))
    return [(0.5 * (a + b) + 0.5 * (b - a) * points, 0.5 * (b - a) * weights) for a, b in pairwise(edges)]
