"""The course of natural motions through time: from stride to stride, and step by step where no stride fits."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

from flexcam.integrate.family import Motions, Steps
from flexcam.integrate.generalized_alpha import Scheme
from flexcam.integrate.moment import Track
from flexcam.integrate.problem import Problem
from flexcam.integrate.strides import USUAL, Stride, alive, stride_length
from flexcam.integrate.uncoupled import Natural
from flexcam.linalg import FloatArray

_GROUP = 16
"""Strides whose loads are summed up together."""

_AT_ONCE = 1024
"""Steps in memory together where no stride fits."""


@dataclass(frozen=True, eq=False)
class Stretch:
    """Some successive strides, or steps where no stride fits.

    Parameters
    ----------
    row
        Instants between the first of all stretches and the begin of this one.
    begins, ends
        States of strides, shape (b, 3, n).
    causes
        What changes the states in a stride, shape (b, 3, n).
    rising
        Histories of the loads over every stride less those at its begin, shape (b, k (L + 1)).
    states
        After every step, shape (3, m, n), of a stretch without strides.
    """

    row: int
    begins: FloatArray
    ends: FloatArray
    causes: FloatArray
    rising: FloatArray
    states: FloatArray | None = None


class Course:
    """Where the motions are, and how they go on.

    A stretch begins at the last stride's begin, so that strides lie at the same steps however a run is divided.

    Parameters
    ----------
    problem
        `uncoupled`, without local forces, its damping diagonal.
    scheme
        Of the generalized-alpha family.
    natural
        The motions.
    every
        Steps after which they are taken anew from the unknowns, if they are spread exactly.

    Attributes
    ----------
    at
        Step of the state, -1 before the start.
    pushes
        Of unit histories of the loads, shape (k, n).
    scale
        Powers of the step that amounts and their rates are multiplied with, shape (3, 1).
    state
        Amounts, velocities times the step and accelerations times its square, which are of one size, shape (3, n).
    causes
        What changes them, as `Stride` has it, where the state is within a group of strides, shape (3, n).
    """

    def __init__(self, problem: Problem, scheme: Scheme, natural: Natural, every: int) -> None:
        self._problem, self._natural, self._exactly = problem, natural, natural.exactly
        self._vectors = problem.system.load_vectors()
        self._every = every if self._exactly else USUAL * _GROUP
        self.at, self.state = -1, np.zeros((3, problem.system.size))
        self.causes = np.zeros_like(self.state)
        self.steps = Steps.of(scheme, Motions.of(problem))
        self.stride = Stride.of(self.steps, stride_length(self._every))
        strides, rest = divmod(self._every, stride_length(self._every))
        self._group = 1 if rest else max(count for count in range(1, _GROUP + 1) if strides % count == 0)
        self.pushes = self.steps.light * self._vectors
        self._left = np.zeros((0, 0)) if self.stride is None else self._by_history(self.stride)
        self.scale = problem.step ** np.arange(3.0)[:, None]

    @property
    def length(self) -> int:
        """Steps of a stride; none where motions grow within one."""
        return self.stride.length if self.stride else 0

    def _by_history(self, stride: Stride) -> FloatArray:
        """Return states at the end of a stride per unit of every history at every instant, shape (k (L + 1), 3 n)."""
        late = np.concatenate([np.zeros((3, 1, len(stride.stiff))), stride.answer[:, ::-1]], axis=1)
        parts = np.einsum("kn,sjn->kjsn", self.pushes, late)
        return parts.reshape(parts.shape[0] * parts.shape[1], self.state.size)

    def begin(self, first: Track) -> None:
        """Begin at an instant."""
        self.at, self.state = 0, np.array([first.d[0], first.v[0], first.a[0]]) * self.scale

    def histories(self, last: int) -> FloatArray:
        """Return those of the loads from the state up to a step, and zeros as far as a stride may lead beyond."""
        times = self._problem.times(np.arange(self.at, last + 1))
        known = self._problem.system.load_histories(self._problem.drive.at(times))
        return np.concatenate([known, np.zeros((self.length, known.shape[1]))])

    def pushed(self, histories: FloatArray) -> FloatArray:
        """Return what loads push in every step, shape (m, n), from their histories, shape (m + 1, k)."""
        return self.steps.pushed(np.einsum("tk,kn->tn", histories, self._vectors))

    def stretches(self, last: int, histories: FloatArray) -> Iterator[Stretch]:
        """Yield stretches up to a step, the last stride beyond it where it does not end there; then go on there."""
        first = at = self.at
        while at < last:
            rest = self._every - at % self._every
            if self.stride and rest >= self.length:
                count = -(-(last - at) // self.length)
                count = min(count, rest // self.length) if self._every % self.length else count
                stretch = self._strides(self.stride, count, last, histories[at - first :], at - first)
                at += count * self.length
            else:
                at = min(at + rest, at + _AT_ONCE, last)
                stretch = self._single(at, histories[self.at - first :], self.at - first)
            yield stretch

    def _strides(self, stride: Stride, count: int, last: int, histories: FloatArray, row: int) -> Stretch:
        """Return some strides, and go on behind the last one, or at its begin where its end is behind the last step."""
        length = stride.length
        over = sliding_window_view(histories[: count * length + 1], length + 1, axis=0)[::length]
        rising = (over - over[:, :, :1]).reshape(count, over[0].size)
        pushes = np.einsum("bk,kn->bn", histories[: count * length + 1 : length], self.pushes)
        ends = self._added(rising, self.at // length)
        begins, causes = np.empty_like(ends), np.empty((count + 1, *self.state.shape))
        state, causes[0] = self.state, self.causes
        for few in self._groups(count):
            at = self.at + few.start * length
            if at // length % self._group == 0:
                state = alive(self._anew(state, at))
                causes[few.start] = stride.causes(state, pushes[few.start])
            ahead = slice(few.start, few.stop + 1)
            stride.land(state, pushes[ahead], causes[ahead], ends[few])
            begins[few.start], begins[few.start + 1 : few.stop] = state, ends[few.start : few.stop - 1]
            state = ends[few.stop - 1]
        self._go_on(count if self.at + count * length <= last else count - 1, ends, causes)
        return Stretch(row, begins, ends, causes[:-1], rising)

    def _groups(self, count: int) -> Iterator[slice]:
        """Yield which of some strides belong to one group."""
        ahead = self.at // self.length % self._group
        firsts = [0, *range(self._group - ahead, count, self._group), count]
        return (slice(first, last) for first, last in pairwise(firsts))

    def _go_on(self, strides: int, ends: FloatArray, causes: FloatArray) -> None:
        """Let the state be that after some strides."""
        if strides:
            self.at += strides * self.length
            self.state, self.causes = ends[strides - 1], causes[strides]

    def _added(self, rising: FloatArray, first: int) -> FloatArray:
        """Return what loads add to the states in some strides, shape (b, 3, n).

        Strides are taken in groups between steps that are the same in every run, as the bits of a product of matrices
        depend on its size and on where in it a row stands.
        """
        count, ahead = len(rising), first % self._group
        whole = -(-(ahead + count) // self._group)
        padded = np.zeros((whole * self._group, rising.shape[1]))
        padded[ahead : ahead + count] = rising
        added = padded.reshape(whole, self._group, rising.shape[1]) @ self._left
        return added.reshape(-1, *self.state.shape)[ahead : ahead + count]

    def _single(self, end: int, histories: FloatArray, row: int) -> Stretch:
        """Return steps one by one, and go on behind them."""
        pushed = self.pushed(histories[: end - self.at + 1])
        states = np.empty((3, *pushed.shape))
        self.steps.walk(self._anew(self.state, self.at), pushed, states)
        self.at, self.state = end, states[:, -1].copy()
        nothing = np.zeros((0, *self.state.shape))
        return Stretch(row, nothing, nothing, nothing, nothing[:, 0], states)

    def _anew(self, state: FloatArray, at: int) -> FloatArray:
        """Return the state at a step as it follows from the unknowns that are saved; as it is where none are."""
        if not (self._exactly and at and at % self._every == 0):
            return state
        return self._natural.taken_anew(state / self.scale) * self.scale
