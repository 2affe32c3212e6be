"""What the cam prescribes within one step, from a few instants of it.

Where a contact switches, several instants of one step are looked at. Polynomials through a few of them give what lies
between to rounding; where a law has a corner within the step they do not, and every instant is computed from the laws.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from flexcam.integrate.local import Schedule
from flexcam.integrate.moment import Instant
from flexcam.linalg import FloatArray

_NODES = 0.5 * (1.0 - np.cos(np.pi * np.arange(6) / 5.0))
"""Chebyshev's points of the step, both ends among them."""

_WEIGHTS = np.array([0.5, -1.0, 1.0, -1.0, 1.0, -0.5])
"""Of the barycentric formula for these points: J.-P. Berrut and L. N. Trefethen, SIAM Review 46 (2004), eq. 5.4."""

_CHECKED = np.array([0.05, 0.5, 0.8])
"""Where the polynomials are held against the laws."""

_SAME = 1e-12

Prescribed = Callable[[FloatArray], tuple[FloatArray, Schedule]]
"""Loads and schedule at some times, s."""


class Window:
    """One step, looked into.

    Parameters
    ----------
    begin, end
        s.
    prescribed
        What the laws say at some times.
    """

    def __init__(self, begin: float, end: float, prescribed: Prescribed) -> None:
        self.begin, self.end = begin, end
        loads, schedule = prescribed(begin + (end - begin) * np.concatenate([_NODES, _CHECKED]))
        self._senses, self._acts = schedule.senses, schedule.acts
        parts = (loads, schedule.sense, schedule.sense_rate, schedule.act, schedule.offset, schedule.offset_rate)
        table = np.hstack([*parts, schedule.angle[:, None]])
        self._cuts = np.cumsum([part.shape[1] for part in parts])
        self._table = table[: len(_NODES)]
        between = np.array([_blended(x) @ self._table for x in _CHECKED.tolist()])
        size = np.abs(table).max(axis=0, initial=0.0)
        self.smooth = bool((np.abs(between - table[len(_NODES) :]) <= _SAME * size).all())

    def at(self, time: float) -> Instant:
        """Return what is prescribed at a time of the step, s."""
        row = _blended((time - self.begin) / (self.end - self.begin)) @ self._table
        load, sense, sense_rate, act, offset, offset_rate, angle = np.split(row[None], self._cuts, axis=1)
        schedule = Schedule(sense, sense_rate, act, offset, offset_rate, angle[:, 0], self._senses, self._acts)
        return Instant(time, load[0], schedule)


def _blended(x: float) -> FloatArray:
    """Return the shares of the points in the value at a part x of the step, shape (6,)."""
    apart = x - _NODES
    nearest = int(np.argmin(np.abs(apart)))
    if apart[nearest] == 0.0:
        return np.eye(len(_NODES))[nearest]
    shares = _WEIGHTS / apart
    return shares / shares.sum()
