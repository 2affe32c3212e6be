"""Lift of a follower from a given cam profile."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from flexcam.cams.followers import Follower, Turn
from flexcam.core import ComplexArray, FloatArray, IntArray
from flexcam.core.errors import finite_array, refuse

_AT_ONCE = 2_000_000
"""Number of pairs of angle and point evaluated together."""

_REFINEMENTS = 6


def lift_from_profile(points: ArrayLike, follower: Follower, angle: ArrayLike, *, turn: Turn = 1) -> FloatArray:
    """Return the lift of a follower on a profile given by points.

    The follower rests on the point with the highest lift. Between the points the profile is a periodic spline of degree
    5 over the chord length, so that a roller too large for a hollow bridges it.
    """
    from scipy.interpolate import make_interp_spline

    xy = finite_array("points", points, (None, 2))
    if len(xy) < 12:
        raise refuse("points", f"{len(xy)} points", "12 or more")
    closed = xy[:, 0] + 1j * xy[:, 1]
    closed = np.append(closed, closed[0])
    chord = np.concatenate([[0.0], np.cumsum(np.abs(np.diff(closed)))])
    if (np.diff(chord) <= 0.0).any():
        raise refuse("points", "the same point twice", "different points, the first not repeated")
    curve = make_interp_spline(chord, np.column_stack([closed.real, closed.imag]), k=5, bc_type="periodic")
    turned = np.exp(1j * turn * finite_array("angle", np.ravel(angle), (None,)))
    length = float(chord[-1])

    def lift(at: FloatArray) -> FloatArray:
        x, y = np.moveaxis(np.asarray(curve(np.mod(at, length)), dtype=float), -1, 0)
        return follower.lift_at((x + 1j * y) * turned[:, None])

    if not len(turned):
        return np.zeros(np.shape(angle))
    # Fine enough for a roller much smaller than the cam.
    count = min(
        _MOST_SAMPLES, max(len(xy), _LEAST_SAMPLES, math.ceil(8.0 * length / min(follower.roller_radius, length)))
    )
    at = np.linspace(0.0, length, count, endpoint=False)
    x, y = np.moveaxis(np.asarray(curve(at), dtype=float), -1, 0)
    starts = _find_highest_peaks(np.asarray(x + 1j * y, dtype=np.complex128), at, follower, turned)
    found = np.max([_refine_maximum(lift, start, float(at[1])) for start in starts.T], axis=0)
    if not np.isfinite(found).all():
        raise refuse("points", "a profile the follower does not touch", "one within its reach", "", "check the unit")
    return found.reshape(np.shape(angle))


@dataclass(frozen=True)
class Bridge:
    """Hollow that a follower bridges.

    Parameters
    ----------
    depth
        Largest gap between the follower and the hollow, along its path, m.
    point
        Position of the largest gap, m, frame of the cam.
    """

    depth: float
    point: tuple[float, float]


def find_bridges(points: ArrayLike, follower: Follower, *, turn: Turn = 1) -> Bridge | None:
    """Return the deepest hollow of a profile that a follower bridges because it is too large or flat; else None."""
    angle = np.linspace(0.0, 2.0 * math.pi, _SAMPLE_ANGLES, endpoint=False)
    lift = lift_from_profile(points, follower, angle, turn=turn)
    xy = finite_array("points", points, (None, 2))
    turned, left = np.exp(1j * turn * angle), np.full(len(xy), math.inf)
    rows = max(1, _AT_ONCE // len(xy))
    for i in range(0, len(angle), rows):
        high = follower.lift_at((xy[:, 0] + 1j * xy[:, 1]) * turned[i : i + rows, None])
        left = np.minimum(left, (lift[i : i + rows, None] - high).min(axis=0))
    worst = int(np.argmax(np.where(np.isfinite(left), left, 0.0)))
    depth = float(left[worst])
    return Bridge(depth, (float(xy[worst, 0]), float(xy[worst, 1]))) if depth > _CONTACT_TOLERANCE else None


_SAMPLE_ANGLES = 2880
_CONTACT_TOLERANCE = 1e-6
"""Contact tolerance: between sampled cam angles, 1/8 deg apart, a contact is missed by a tenth of this."""

_LEAST_SAMPLES, _MOST_SAMPLES = 360, 20_000
_CANDIDATES = 3
"""Peaks evaluated per angle: at a jump of the contact two are almost equal."""


def _find_highest_peaks(points: ComplexArray, at: FloatArray, follower: Follower, turned: ComplexArray) -> FloatArray:
    """Return the positions of the highest peaks on the curve, shape (angles, candidates)."""
    rows = max(1, _AT_ONCE // len(points))
    parts = [turned[i : i + rows, None] for i in range(0, len(turned), rows)]
    return np.concatenate([at[_peaks(follower.lift_at(points * part))] for part in parts])


def _peaks(values: FloatArray) -> IntArray:
    """Return the positions of the highest peaks of every row, each row a closed curve."""
    peak = (values >= np.roll(values, 1, axis=1)) & (values >= np.roll(values, -1, axis=1))
    return np.argpartition(-np.where(peak, values, -math.inf), _CANDIDATES, axis=1)[:, :_CANDIDATES]


def _refine_maximum(lift: Callable[[FloatArray], FloatArray], start: FloatArray, spacing: float) -> FloatArray:
    """Return the maximum near the starting points, by successive parabolas through three points."""
    at, width = start, spacing
    best = lift(at[:, None])[:, 0]
    for _ in range(_REFINEMENTS):
        around = at[:, None] + width * np.linspace(-1.0, 1.0, 5)
        values = lift(around)
        peak = np.clip(np.argmax(values, axis=1), 1, 3)
        rows = np.arange(len(at))
        left, middle, right = (values[rows, peak + k] for k in (-1, 0, 1))
        with np.errstate(divide="ignore", invalid="ignore"):  # minus infinity if out of reach
            bend = left - 2.0 * middle + right
            shift = np.where(np.isfinite(bend) & (bend < 0.0), 0.5 * (left - right) / bend, 0.0)
        at = around[rows, peak] + 0.5 * width * np.clip(shift, -1.0, 1.0)
        best = np.fmax(best, np.fmax(middle, lift(at[:, None])[:, 0]))
        width *= 0.25
    return np.where(np.isfinite(best), best, -math.inf)
