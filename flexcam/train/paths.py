"""How far what a rigid train moves has gone at a lift of its cam: through levers that turn, behind plays."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from flexcam.linalg import FloatArray
from flexcam.train.model import Lever

Coordinate = Callable[[FloatArray], tuple[FloatArray, FloatArray, FloatArray]]
"""A path of the rigid train over the lift, m, with its first two derivatives."""


def in_proportion(lift: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return the path of what the cam moves directly: the lift itself."""
    return lift, np.ones_like(lift), np.zeros_like(lift)


def turned(before: Coordinate, lever: Lever, end: int, share: float) -> Coordinate:
    """Return the path of a lever's driven end (0), or of its point (1), over the lift."""

    def moved(lift: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        c, c1, c2 = before(lift)
        path, slope, bend = lever.path_at(share * c)
        slope, bend = share * slope * c1, share**2 * bend * c1**2 + share * slope * c2
        if end == 0:
            return path, slope, bend
        y, by_path, by_path_twice = lever.reach(path, 1)
        return y, by_path * slope, by_path_twice * slope**2 + by_path * bend

    return moved


def behind(before: Coordinate, gap: float, rest: float | None) -> Coordinate:
    """Return the path behind a play: nothing moves before it is taken up."""

    def moved(lift: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        h, h1, h2 = before(lift)
        if rest is None:
            return h - gap, h1, h2
        on = h - gap > rest
        return np.where(on, h - gap, rest), np.where(on, h1, 0.0), np.where(on, h2, 0.0)

    return before if gap == 0.0 and rest is None else moved
