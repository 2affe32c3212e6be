"""Many steps of natural motions at once: a step is linear, so the state after many follows from one matrix product.

A motion is a state s = (q, h v, h^2 a), and a step of length h takes it to ``A s + b p``, with p what its load pushes.
After L steps it is ``A^L s`` and what the loads of these steps add: both are known before the run begins.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from flexcam.integrate.family import Steps
from flexcam.linalg import FloatArray, LongArray

_FEWEST, USUAL, _LONG, _MOST = 16, 40, 64, 128
"""Steps of a stride: the longer, the less is done one after the other, and the less side by side."""

_SELDOM = 1024
"""Steps between saved fields from which strides are long."""

_GROWN = 1e6
"""Growth over a stride beyond which a motion is walked step by step, to see where it leaves the range of numbers."""

_GONE = 1e-130
"""Added and taken away, it leaves nothing of a motion that is none any more, and everything of any other.

What dies out further would end in numbers that processors handle very slowly.
"""


def stride_length(every: int) -> int:
    """Return the steps of a stride where motions are taken anew after every so many steps."""
    usual = USUAL if every < _SELDOM else _LONG
    even = [length for length in range(_FEWEST, _MOST + 1) if every % length == 0]
    if even:
        return min(even, key=lambda length: abs(length - usual))
    return every if every <= _MOST else min(range(usual - 8, usual + 8), key=lambda length: every % length)


@dataclass(frozen=True, eq=False)
class Stride:
    """So many steps at once.

    What a stride changes is told by what is out of balance at its begin, and by how loads change from there: under a
    steady load both vanish, where sums of what each instant's load does would leave their rounding.

    Parameters
    ----------
    length
        L, steps.
    stiff
        What a displacement takes from the push, shape (n,).
    change
        Of states, by what pushes at the begin less what the displacement takes, by h v and by h^2 a: by its causes,
        shape (3, 3, n).
    shift
        Of these causes, by themselves, shape (3, 3, n).
    within
        States after every step by the same three, shape (3, L, 3, n); a displacement at the begin is to be added.
    answer
        States after every step, per unit of the push at the end of the first one, shape (3, L, n).
    """

    length: int
    stiff: FloatArray
    change: FloatArray
    shift: FloatArray
    within: FloatArray
    answer: FloatArray

    @classmethod
    def of(cls, steps: Steps, length: int) -> Stride | None:
        """Return that of a step; None where motions grow within it."""
        n = len(steps.stiff)
        begin, pushed, found = np.zeros((3, 4, n)), np.zeros((length, 4, n)), np.empty((3, length, 4, n))
        begin[[0, 1, 2], [0, 1, 2]], pushed[0, 3] = 1.0, 1.0
        steps.walk(begin, pushed, found)
        if not np.abs(found[:, :, :3]).max(initial=0.0) < _GROWN:
            return None
        within, pulse, old = found[:, :, :3], found[:, :, 3], steps.old
        # By a steady push; the displacement that it balances would change it by as much less.
        within[:, :, 0] = np.cumsum(pulse, axis=1)
        change = _repeated(steps.change(), length)[:, [3, 1, 2]]
        shift = np.concatenate([-steps.stiff * change[:1], change[1:]]).astype(float)
        answer = (1.0 - old) * pulse
        answer[:, 1:] += old * pulse[:, :-1]  # a step is pushed by what acts at its begin too
        return cls(length, steps.stiff, change.astype(float), shift, within, answer)

    def causes(self, begin: FloatArray, push: FloatArray) -> FloatArray:
        """Return what changes a state under a push, shape (3, n)."""
        return np.concatenate([(push - self.stiff * begin[0])[None], begin[1:]])

    def land(self, begin: FloatArray, pushes: FloatArray, causes: FloatArray, ends: FloatArray) -> None:
        """Put where a state is after every stride, and what changes it there."""
        shifts = ends.copy()
        shifts[:, 0] *= -self.stiff
        shifts[:, 0] += pushes[1:] - pushes[:-1]
        for now, later, shift in zip(causes, causes[1:], shifts, strict=False):
            np.einsum("oin,in->on", self.shift, now, out=later)
            later += shift
            later += now
        ends += np.einsum("oin,bin->bon", self.change, causes[:-1])
        ends[0] += begin
        np.add.accumulate(ends, axis=0, out=ends)


def alive(state: FloatArray) -> FloatArray:
    """Return a state without the motions that are none any more."""
    return (state + _GONE) - _GONE


def _repeated(change: LongArray, times: int) -> LongArray:
    """Return ``A^L - 1`` from ``A - 1``: by doubling, without ever adding the one."""
    if times == 1:
        return change
    half = _repeated(change, times // 2)
    twice = 2.0 * half + _after(half, half)
    return twice + change + _after(change, twice) if times % 2 else twice


def _after(later: LongArray, earlier: LongArray) -> LongArray:
    return np.einsum("oin,ifn->ofn", later[:, :3], earlier)
