"""The least value of a curve over a revolution.

A grid finds the valleys between the joints, ever finer grids their floors, and the value just before a joint is carried
on to it from two places beside it: to rounding for curves that are smooth between the joints.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from itertools import pairwise

import numpy as np

from flexcam.linalg import FloatArray, IntArray
from flexcam.motion.criteria import Extreme

Curve = Callable[[FloatArray], FloatArray]

_REVOLUTION = 2.0 * math.pi
_SPACING = math.radians(0.05)
_LEAST_POINTS = 33
_BESIDE = 1e-8
"""Distance from a joint at which the side before it is read, rad: a closer angle is taken for the joint."""

_SAME = 1e-12
"""Part of the least value by which others may lie above it and still be the same; the first place is told."""

_VALLEYS = 24
"""Valleys whose floors are sought, those that look deepest."""

_FINER = 9
"""Times that a valley's grid is made four times finer: 1e-8 rad, where the floor is flat to rounding."""


def lowest(curve: Curve, joints: Sequence[float] = ()) -> Extreme:
    """Return the least value of a curve over a revolution."""
    edges = [0.0, *(at for at in joints if _BESIDE < at < _REVOLUTION - _BESIDE), _REVOLUTION]
    pieces = [_piece(start, end) for start, end in pairwise(edges)]
    angles = np.concatenate(pieces)
    values = _whole(curve(angles))
    sizes = np.cumsum([len(piece) for piece in pieces])
    valleys = _valleys(values, sizes)
    low, high = (angles[np.clip(valleys + step, *_limits(valleys, sizes))] for step in (-1, 1))
    floors, at = _floors(curve, low, high)
    before = np.array(edges[1:])
    carried = _whole(2.0 * curve(before - _BESIDE) - curve(before - 2.0 * _BESIDE))
    all_values, places = np.concatenate([values, floors, carried]), np.concatenate([angles, at, before])
    least = float(all_values.min())
    return Extreme(least, float(places[all_values <= least + _SAME * abs(least)].min()))


def _piece(start: float, end: float) -> FloatArray:
    """Return the grid of a smooth piece, which ends just before its joint."""
    return np.linspace(start, end - _BESIDE, max(_LEAST_POINTS, math.ceil((end - start) / _SPACING)))


def _whole(values: FloatArray) -> FloatArray:
    """Return values without those that are none, such as a curvature where a curve stands still."""
    return np.where(np.isnan(values), np.inf, values)


def _limits(at: IntArray, sizes: IntArray) -> tuple[IntArray, IntArray]:
    """Return the first and the last index of the pieces in which indices lie."""
    piece = np.searchsorted(sizes, at, side="right")
    starts = np.concatenate([[0], sizes[:-1]])
    return starts[piece], sizes[piece] - 1


def _valleys(values: FloatArray, sizes: IntArray) -> IntArray:
    """Return the indices of the deepest valleys, ends of pieces among them."""
    first, last = _limits(np.arange(len(values)), sizes)
    at = np.arange(len(values))
    left, right = values[np.maximum(at - 1, first)], values[np.minimum(at + 1, last)]
    end = (at == first) | (at == last)
    found = np.flatnonzero((values <= left) & (values <= right) & (end | (values < left) | (values < right)))
    found = np.union1d(found, [np.argmin(values)])
    return found[np.argsort(values[found], kind="stable")[:_VALLEYS]]


def _floors(curve: Curve, low: FloatArray, high: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the least values between pairs of angles, and where they lie."""
    rows, parts = np.arange(len(low)), np.linspace(0.0, 1.0, 9)
    at, values = low, np.full(len(low), np.inf)
    for _ in range(_FINER):
        angles = low[:, None] + (high - low)[:, None] * parts
        seen = _whole(curve(angles.ravel())).reshape(angles.shape)
        best = np.argmin(seen, axis=1)
        at, values = angles[rows, best], seen[rows, best]
        low, high = angles[rows, np.maximum(best - 1, 0)], angles[rows, np.minimum(best + 1, len(parts) - 1)]
    return values, at
