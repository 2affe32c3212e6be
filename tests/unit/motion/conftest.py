"""Derivatives checked against the curve below them, without differences and their error."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest

POINTS, WEIGHTS = np.polynomial.legendre.leggauss(16)
ROUNDING = 1e-2
"""Rounding of the curve below over that of the derivative's integral, in units of the bound: see `derivative_error`."""


def error_over(curve, order, start, end):
    """Greatest difference of integral and rise over panels of one smooth piece, and what to measure it by."""
    edges = np.linspace(start, end, 2 + int(40 * (end - start)))
    edges[-1] = np.nextafter(end, start)  # the last value before a joint, whose own value is that to the right
    half = 0.5 * np.diff(edges)
    within = (edges[:-1] + half)[:, None] + half[:, None] * POINTS
    derivative, below = curve(within, order), curve(edges, order - 1)
    error = np.abs(derivative @ WEIGHTS * half - np.diff(below)).max()
    return error, np.array([2.0 * half[0] * np.abs(derivative).max(), np.abs(below).max()])


@pytest.fixture(scope="session")
def derivative_error():
    """Return how far a derivative is from that of the curve below it, between joints, as part of its size.

    The integral of the derivative over a short panel is the rise of the curve below, whatever the step: sixteen Gauss
    points are exact to rounding for all laws here. A central difference would be good to six digits only. What is
    left is rounding: 1e-16 of the curve below on each panel, hence 1e-14 in these units.
    """

    def error(curve, order, joints):
        found = [error_over(curve, order, a, b) for a, b in pairwise(joints)]
        size = np.array([1.0, ROUNDING]) @ np.max([scale for _, scale in found], axis=0)
        return max(e for e, _ in found) / size if size else 0.0

    return error
