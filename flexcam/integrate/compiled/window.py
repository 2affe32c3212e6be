"""What the cam prescribes within some steps, from a few instants of each.

Where a contact switches, several instants of one step are looked at. Polynomials through a few of them give what lies
between to rounding; where a law has a corner within the step they do not, and every instant is computed from the laws.
Steps with events stand near each other, and laws are evaluated for many instants as fast as for few.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from flexcam.linalg import FloatArray, IntArray

_NODES = 0.5 * (1.0 - np.cos(np.pi * np.arange(6) / 5.0))
"""Chebyshev's points of the step, both ends among them."""

_WEIGHTS = np.array([0.5, -1.0, 1.0, -1.0, 1.0, -0.5])
"""Of the barycentric formula for these points: J.-P. Berrut and L. N. Trefethen, SIAM Review 46 (2004), eq. 5.4."""

_CHECKED = np.array([0.05, 0.5, 0.8])
"""Where the polynomials are held against the laws."""

_LOOKED_AT = np.concatenate([_NODES, _CHECKED])

SAME = 1e-12
"""By how much polynomials may miss what is prescribed, as a part of its largest value."""

NOISE = 1e-9
"""The same of rates and of what contacts take from the cam: laws that are inverted or tabulated have noise of 1e-10."""

LOOSE = 1e-3
"""Of what only bounds a law, as the radius from which the load of a line contact is taken as straight on."""

AT_ONCE = 16
"""Steps that are looked into together."""

Prescribed = Callable[[FloatArray], FloatArray]
"""Loads and what follows from the cam at some times (s), side by side."""


def _shares(x: FloatArray) -> FloatArray:
    """Return the shares of the points in the values at some parts of the step, shape (len(x), 6)."""
    shares = _WEIGHTS / (x[:, None] - _NODES)
    return shares / shares.sum(axis=1, keepdims=True)


_BETWEEN = _shares(_CHECKED)


class Windows:
    """Some successive steps, looked into.

    Parameters
    ----------
    first
        Number of the first among the steps that are marched.
    ends
        When each of them ends, s, shape (w,).
    step
        s.
    prescribed
        What the laws say at some times.
    same
        By how much polynomials may miss every column, as a part of its largest value, shape (columns,).

    Attributes
    ----------
    tables
        Loads and what follows from the cam at the points of every step, shape (w, 6, columns).
    rows
        The first step, and of each whether polynomials tell what is between its points.
    """

    def __init__(self, first: int, ends: FloatArray, step: float, prescribed: Prescribed, same: FloatArray) -> None:
        times = (ends - step)[:, None] + step * _LOOKED_AT
        found = prescribed(times.ravel()).reshape(len(ends), len(_LOOKED_AT), -1)
        self.tables = np.ascontiguousarray(found[:, : len(_NODES)])
        size = np.maximum(found.max(axis=(0, 1)), -found.min(axis=(0, 1)))
        off = np.abs(_BETWEEN @ self.tables - found[:, len(_NODES) :])
        smooth = (off <= same * size).all(axis=(1, 2))
        self.rows: IntArray = np.array([first, *smooth], dtype=np.intp)

    def cover(self, row: int) -> bool:
        """Tell whether a step is among them."""
        return 0 <= row - int(self.rows[0]) < len(self.tables)

    def at(self, row: int, part: float) -> FloatArray | None:
        """Return what is prescribed at a part of a step, shape (columns,); None where polynomials do not tell it."""
        which = row - int(self.rows[0])
        if not self.rows[1 + which] or not 0.0 <= part <= 1.0:
            return None
        table, nodes = self.tables[which], _NODES.tolist()
        return table[nodes.index(part)] if part in nodes else _shares(np.array([part]))[0] @ table


def points() -> FloatArray:
    """Return the points of a step for machine code."""
    return np.array([_NODES, _WEIGHTS, np.zeros(len(_NODES))])
