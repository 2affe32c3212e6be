"""The course of natural motions through time: from stride to stride, and step by step where no stride fits."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import NDArray

from flexcam.core import FloatArray, IntArray
from flexcam.dynamics.blocks import SaveAt, Series
from flexcam.dynamics.checkpoint import Arrays
from flexcam.dynamics.engine import STOPPED, all_within, first_track, in_range, stack_motion
from flexcam.dynamics.generalized_alpha import Scheme
from flexcam.dynamics.local_forces import LocalForces
from flexcam.dynamics.modal_coordinates import ModalCoordinates
from flexcam.dynamics.modal_step import USUAL, ModalStep, ModeParameters, StepBlock, drop_vanished, stride_length
from flexcam.dynamics.problem import Problem
from flexcam.dynamics.status import Stats, Status
from flexcam.dynamics.step_state import ProbeTrajectory, Trajectory

_GROUP = 16
"""Strides whose loads are summed up together."""

_AT_ONCE = 1024
"""Steps in memory together where no stride fits."""


@dataclass(frozen=True, eq=False)
class StepBlocks:
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


class ModalPropagator:
    """Where the motions are, and how they go on.

    A stretch begins at the last stride's begin, so that strides lie at the same steps however a run is divided.

    Parameters
    ----------
    problem
        `modal_problem`, without local forces, its damping diagonal.
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
        What changes them, as `StepBlock` has it, where the state is within a group of strides, shape (3, n).
    """

    def __init__(self, problem: Problem, scheme: Scheme, natural: ModalCoordinates, every: int) -> None:
        self._problem, self._natural, self._exactly = problem, natural, natural.exactly
        self._vectors = problem.system.load_vectors()
        self._every = every if self._exactly else USUAL * _GROUP
        self.at, self.state = -1, np.zeros((3, problem.system.size))
        self.causes = np.zeros_like(self.state)
        self.steps = ModalStep.of(scheme, ModeParameters.of(problem))
        self.stride = StepBlock.of(self.steps, stride_length(self._every))
        strides, rest = divmod(self._every, stride_length(self._every))
        self._group = 1 if rest else max(count for count in range(1, _GROUP + 1) if strides % count == 0)
        self.pushes = self.steps.light * self._vectors
        self._left = np.zeros((0, 0)) if self.stride is None else self._by_history(self.stride)
        self.scale = problem.step ** np.arange(3.0)[:, None]

    @property
    def length(self) -> int:
        """Steps of a stride; none where motions grow within one."""
        return self.stride.length if self.stride else 0

    def _by_history(self, stride: StepBlock) -> FloatArray:
        """Return states at the end of a stride per unit of every history at every instant, shape (k (L + 1), 3 n)."""
        late = np.concatenate([np.zeros((3, 1, len(stride.stiff))), stride.answer[:, ::-1]], axis=1)
        parts = np.einsum("kn,sjn->kjsn", self.pushes, late)
        return parts.reshape(parts.shape[0] * parts.shape[1], self.state.size)

    def begin(self, first: Trajectory) -> None:
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

    def stretches(self, last: int, histories: FloatArray) -> Iterator[StepBlocks]:
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

    def _strides(self, stride: StepBlock, count: int, last: int, histories: FloatArray, row: int) -> StepBlocks:
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
                state = drop_vanished(self._anew(state, at))
                causes[few.start] = stride.causes(state, pushes[few.start])
            ahead = slice(few.start, few.stop + 1)
            stride.land(state, pushes[ahead], causes[ahead], ends[few])
            begins[few.start], begins[few.start + 1 : few.stop] = state, ends[few.start : few.stop - 1]
            state = ends[few.stop - 1]
        self._go_on(count if self.at + count * length <= last else count - 1, ends, causes)
        return StepBlocks(row, begins, ends, causes[:-1], rising)

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

    def _single(self, end: int, histories: FloatArray, row: int) -> StepBlocks:
        """Return steps one by one, and go on behind them."""
        pushed = self.pushed(histories[: end - self.at + 1])
        states = np.empty((3, *pushed.shape))
        self.steps.walk(self._anew(self.state, self.at), pushed, states)
        self.at, self.state = end, states[:, -1].copy()
        nothing = np.zeros((0, *self.state.shape))
        return StepBlocks(row, nothing, nothing, nothing, nothing[:, 0], states)

    def _anew(self, state: FloatArray, at: int) -> FloatArray:
        """Return the state at a step as it follows from the unknowns that are saved; as it is where none are."""
        if not (self._exactly and at and at % self._every == 0):
            return state
        return self._natural.taken_anew(state / self.scale) * self.scale


class ModalEngine:
    """Walks through a linear problem in its natural motions.

    Parameters
    ----------
    problem
        `modal_problem`, without local forces, its damping diagonal.
    scheme
        Of the generalized-alpha family.
    save
        What is kept: at saved fields the amounts are taken anew from the unknowns, so that a run from there is this
        one bit by bit.
    stop
        Asked before every block of steps.
    natural
        The motions, for that.
    """

    def __init__(
        self, problem: Problem, scheme: Scheme, save: SaveAt, stop: Callable[[], bool], natural: ModalCoordinates
    ) -> None:
        self._problem, self._system, self._stop = problem, problem.system, stop
        self._forces = LocalForces(problem.system)
        self._course = ModalPropagator(problem, scheme, natural, save.field_every)

    def advance(self, steps: IntArray) -> tuple[Trajectory, Status]:
        """Return the instants of some successive steps, as `Engine` says."""
        if self._stop():
            return Trajectory.none(self._system.size, self._forces), STOPPED
        first, at = self._begun(), self._problem.times(steps)
        row = int(steps[0]) - self._course.at
        walked = self._walked(int(steps[-1]))
        walked[1:] /= self._course.scale[1:, None]
        track = self._track(at, walked[:, row:]) if first is None else self._led(first, at, walked)
        before = None if first is not None else stack_motion(self._track(at[:1], walked[:, row - 1 : row]))[0]
        return in_range(track, before, self._system, self._problem.drive.at(at).angle)

    def _begun(self) -> Trajectory | None:
        """Return the first instant, where the run is to begin; None behind it."""
        if self._course.at >= 0:
            return None
        first = first_track(self._problem, self._forces)
        self._course.begin(first)
        return first

    def _walked(self, last: int) -> FloatArray:
        """Return the states from that of the course up to a step, shape (3, m + 1, n)."""
        course, count = self._course, last - self._course.at + 1
        histories = course.histories(last)
        pushed, found = course.pushed(histories), np.empty((3, len(histories), self._system.size))
        found[:, 0] = course.state
        for stretch in course.stretches(last, histories):
            self._put(stretch, pushed, found)
        return found[:, :count]

    def _put(self, stretch: StepBlocks, pushed: FloatArray, found: FloatArray) -> None:
        """Put the states of a stretch, those of all strides side by side."""
        first, n = stretch.row, self._system.size
        if stretch.states is not None:
            found[:, first + 1 : first + 1 + stretch.states.shape[1]] = stretch.states
            return
        count, length = len(stretch.begins), self._course.length
        end = first + count * length
        within = found[:, first + 1 : end + 1].reshape(3, count, length, n).swapaxes(1, 2)
        pushes = pushed[first:end].reshape(count, length, n).swapaxes(0, 1)
        self._course.steps.walk(stretch.begins.swapaxes(0, 1), pushes, within)
        found[:, first + length : end + 1 : length] = stretch.ends.swapaxes(0, 1)

    def _track(self, at: FloatArray, walked: FloatArray) -> Trajectory:
        (d, v, a), nothing = walked, np.zeros((len(at), 0))
        return Trajectory(at, d, v, a, nothing, nothing, nothing, np.arange(len(at)))

    def _led(self, first: Trajectory, at: FloatArray, walked: FloatArray) -> Trajectory:
        """Return the first instant, with every bit that it begins with, and those behind it."""
        return first if len(at) == 1 else Trajectory.joined([first, self._track(at[1:], walked[:, 1:])])

    def counted(self, stats: Stats) -> Stats:
        """Return the figures as they are: there is nothing to iterate on."""
        return stats

    def state(self) -> Arrays:
        """Return where the motions are, as `Engine` says."""
        course = self._course
        return {"at": np.array(course.at), "amounts": course.state, "causes": course.causes}

    def restore(self, state: Arrays) -> None:
        """Go on, as `Engine` says."""
        course = self._course
        course.at, course.state, course.causes = int(state["at"]), state["amounts"], state["causes"]


@dataclass(frozen=True, eq=False)
class View:
    """What rows see of the motions in a stride.

    Parameters
    ----------
    rows
        Shape (p, n).
    seen
        Displacements, velocities and accelerations after every step, by what changes the states and by what changes
        of the loads' histories, shape (3 n + k (L + 1), L 3 p).
    """

    rows: FloatArray
    seen: FloatArray

    @classmethod
    def of(cls, rows: FloatArray, course: ModalPropagator) -> View:
        """Return what rows see of a course that has strides."""
        stride, length, count = course.stride, course.length, 3 * len(rows)
        if stride is None:
            return cls(rows, np.zeros((0, 0)))
        causes, histories = 3 * rows.shape[1], len(course.pushes)
        seen = np.zeros((causes + histories * (length + 1), length, count))
        by_cause = np.einsum("sjcn,pn->cnjsp", stride.within / course.scale[:, None, None], rows)
        seen[:causes] = by_cause.reshape(causes, length, count)
        answers = np.einsum("sjn,knp->kjsp", stride.answer / course.scale[:, None], course.pushes[:, :, None] * rows.T)
        answers = answers.reshape(histories, length, count)
        later = seen[causes:].reshape(histories, length + 1, length, count)
        for instant in range(1, length + 1):  # what is pushed then is answered from then on
            later[:, instant, instant - 1 :] = answers[:, : length + 1 - instant]
        return cls(rows, seen.reshape(len(seen), length * count))

    def of_stretch(self, stretch: StepBlocks, course: ModalPropagator) -> FloatArray:
        """Return displacements, velocities and accelerations after every step of a stretch, shape (m, 3, p)."""
        if stretch.states is not None:
            return (stretch.states / course.scale[:, None] @ self.rows.T).swapaxes(0, 1)
        count, p = len(stretch.begins), len(self.rows)
        found = np.concatenate([stretch.causes.reshape(count, -1), stretch.rising], axis=1) @ self.seen
        found = found.reshape(count, -1, 3, p)
        found[:, :, 0] += (stretch.begins[:, 0] @ self.rows.T)[:, None]
        return found.reshape(-1, 3, p)


class ProbeEngine(ModalEngine):
    """Walks through a linear problem in its natural motions, and looks at the probes alone.

    Parameters
    ----------
    problem, scheme, save, stop, natural
        As for `ModalEngine`.
    """

    def __init__(
        self, problem: Problem, scheme: Scheme, save: SaveAt, stop: Callable[[], bool], natural: ModalCoordinates
    ) -> None:
        super().__init__(problem, scheme, save, stop, natural)
        self._save = save
        self._view = View.of(probe_rows(problem), self._course)

    def glance(self, steps: IntArray) -> tuple[ProbeTrajectory, Status]:
        """Return what is kept of some successive steps, up to the last in range, and a status as `Engine` says."""
        rows = self._view.rows
        if self._stop():
            return ProbeTrajectory.none(len(rows), self._system.size), STOPPED
        saved = self._save.fields(steps, self._problem.steps)
        earlier = self.state()
        seen = self._seen(steps, saved)
        if seen is not None:
            return seen, Status()
        self.restore(earlier)  # again, instant by instant, to see which motion left the range of numbers
        track, status = self.advance(steps)
        probes = Series(*(one @ rows.T for one in (track.d, track.v, track.a)))
        return ProbeTrajectory(
            track.time, probes, Series(track.d, track.v, track.a).at(saved[: len(track.time)])
        ), status

    def _seen(self, steps: IntArray, saved: NDArray[np.bool_]) -> ProbeTrajectory | None:
        """Return what is kept of some steps; None where something leaves the range of numbers."""
        first, course = self._begun(), self._course
        begin, at = course.at, self._problem.times(steps)
        histories, rows = course.histories(int(steps[-1])), steps[saved] - begin
        found = np.empty((len(histories), 3, len(self._view.rows)))
        fields = np.empty((3, len(rows), self._system.size))
        if first is not None:
            fields[:, 0] = first.d[0], first.v[0], first.a[0]
            found[0] = fields[:, 0] @ self._view.rows.T
        for stretch in course.stretches(int(steps[-1]), histories):
            seen = self._view.of_stretch(stretch, course)
            found[stretch.row + 1 : stretch.row + 1 + len(seen)] = seen
            within = (rows > stretch.row) & (rows <= stretch.row + len(seen))
            fields[:, within] = self._states(stretch, rows[within], histories) / course.scale[:, None]
        found = found[int(steps[0]) - begin : int(steps[-1]) - begin + 1]
        if not (all_within(found) and all_within(fields) and all_within(course.state)):
            return None
        return ProbeTrajectory(at, Series(*found.swapaxes(0, 1)), Series(*fields))

    def _states(self, stretch: StepBlocks, rows: IntArray, histories: FloatArray) -> FloatArray:
        """Return the states at some rows of a stretch, shape (3, r, n)."""
        if stretch.states is not None:
            return stretch.states[:, rows - stretch.row - 1]
        which, past = np.divmod(rows - stretch.row - 1, self._course.length)
        found = stretch.ends[which].swapaxes(0, 1).copy()
        for i in np.flatnonzero(past < self._course.length - 1).tolist():  # the last step of a run may end no stride
            row = stretch.row + int(which[i]) * self._course.length
            pushed = self._course.pushed(histories[row : row + int(past[i]) + 2])
            states = np.empty((3, *pushed.shape))
            self._course.steps.walk(stretch.begins[which[i]], pushed, states)
            found[:, i] = states[:, -1]
        return found


def probe_rows(problem: Problem) -> FloatArray:
    """Return the rows of all probes of a problem."""
    return np.concatenate([np.zeros((0, problem.system.size)), *(one.rows for one in problem.system.probes)])
