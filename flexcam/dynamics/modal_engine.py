"""Modal engine: advance modal coordinates in blocks of steps, and step by step where blocks are not possible."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import NDArray

from flexcam.core import FloatArray, IntArray
from flexcam.dynamics.blocks import Arrays, SaveAt, Series
from flexcam.dynamics.engine import STOPPED, Engine, all_within, first_track, in_range, stack_motion
from flexcam.dynamics.generalized_alpha import Scheme
from flexcam.dynamics.local_forces import LocalForces
from flexcam.dynamics.modal_coordinates import ModalCoordinates
from flexcam.dynamics.modal_step import USUAL, ModalStep, ModeParameters, StepBlock, block_length, drop_vanished
from flexcam.dynamics.problem import Problem
from flexcam.dynamics.status import Status
from flexcam.dynamics.step_state import ProbeTrajectory, Trajectory

_GROUP = 16
"""Number of blocks whose loads are summed together."""

_AT_ONCE = 1024
"""Number of single steps in memory together."""


@dataclass(frozen=True, eq=False)
class StepBlocks:
    """Successive blocks of steps, or single steps."""

    row: int  #: instants from the first sequence to the beginning of this one
    begins: FloatArray  #: states at the beginning of blocks, shape (b, 3, n)
    ends: FloatArray  #: states at their end, shape (b, 3, n)
    causes: FloatArray  #: causes of the change of state in a block, shape (b, 3, n)
    rising: FloatArray  #: load histories over every block minus their initial values, shape (b, k (L + 1))
    states: FloatArray | None = None  #: after every step of a sequence without blocks, shape (3, m, n)


class ModalPropagator:
    """State of the modes and its propagation through `modal_problem`, whose damping is diagonal.

    A sequence begins at the beginning of the last block, so that blocks lie at the same steps for any division of a
    run. After `every` steps the coordinates are recomputed from the unknowns, if they are expanded exactly.
    """

    def __init__(self, problem: Problem, scheme: Scheme, natural: ModalCoordinates, every: int) -> None:
        self._problem, self._natural, self._exactly = problem, natural, natural.exactly
        self._vectors = problem.system.load_vectors()
        self._every = every if self._exactly else USUAL * _GROUP
        self.at = -1  #: step of the state, -1 before the start
        self.state = np.zeros((3, problem.system.size))  #: coordinates and their rates times powers of the step, (3, n)
        self.causes = np.zeros_like(self.state)  #: see `StepBlock`, shape (3, n); kept within a group of blocks
        self.steps = ModalStep.of(scheme, ModeParameters.of(problem))
        self.stride = StepBlock.of(self.steps, block_length(self._every))
        strides, rest = divmod(self._every, block_length(self._every))
        self._group = 1 if rest else max(count for count in range(1, _GROUP + 1) if strides % count == 0)
        self.pushes = self.steps.light * self._vectors  #: modal forces of unit load histories, shape (k, n)
        self._left = np.zeros((0, 0)) if self.stride is None else self._by_history(self.stride)
        self.scale = problem.step ** np.arange(3.0)[:, None]  #: powers of the step

    @property
    def length(self) -> int:
        """Steps of a block; none if motions grow within one."""
        return self.stride.length if self.stride else 0

    def _by_history(self, stride: StepBlock) -> FloatArray:
        """Return states at the end of a block per unit of every history at every instant, shape (k (L + 1), 3 n)."""
        late = np.concatenate([np.zeros((3, 1, len(stride.stiff))), stride.answer[:, ::-1]], axis=1)
        parts = np.einsum("kn,sjn->kjsn", self.pushes, late)
        return parts.reshape(parts.shape[0] * parts.shape[1], self.state.size)

    def begin(self, first: Trajectory) -> None:
        """Begin at an instant."""
        self.at, self.state = 0, np.array([first.d[0], first.v[0], first.a[0]]) * self.scale

    def histories(self, last: int) -> FloatArray:
        """Return the load histories from the state up to a step, padded with zeros to the end of a block."""
        times = self._problem.times(np.arange(self.at, last + 1))
        known = self._problem.system.load_histories(self._problem.drive.at(times))
        return np.concatenate([known, np.zeros((self.length, known.shape[1]))])

    def modal_forces(self, histories: FloatArray) -> FloatArray:
        """Return the modal forces of every step, shape (m, n), from load histories, shape (m + 1, k)."""
        return self.steps.modal_forces(np.einsum("tk,kn->tn", histories, self._vectors))

    def sequences(self, last: int, histories: FloatArray) -> Iterator[StepBlocks]:
        """Yield sequences up to a step, where the last block may extend beyond it, and set the state there."""
        first = at = self.at
        while at < last:
            rest = self._every - at % self._every
            if self.stride and rest >= self.length:
                count = -(-(last - at) // self.length)
                count = min(count, rest // self.length) if self._every % self.length else count
                stretch = self._blocks(self.stride, count, last, histories[at - first :], at - first)
                at += count * self.length
            else:
                at = min(at + rest, at + _AT_ONCE, last)
                stretch = self._single(at, histories[self.at - first :], self.at - first)
            yield stretch

    def _blocks(self, stride: StepBlock, count: int, last: int, histories: FloatArray, row: int) -> StepBlocks:
        """Return blocks of steps, and set the state to the end of the last complete one."""
        length = stride.length
        over = sliding_window_view(histories[: count * length + 1], length + 1, axis=0)[::length]
        rising = (over - over[:, :, :1]).reshape(count, over[0].size)
        pushes = np.einsum("bk,kn->bn", histories[: count * length + 1 : length], self.pushes)
        ends = self._load_response(rising, self.at // length)
        begins, causes = np.empty_like(ends), np.empty((count + 1, *self.state.shape))
        state, causes[0] = self.state, self.causes
        for few in self._groups(count):
            at = self.at + few.start * length
            if at // length % self._group == 0:
                state = drop_vanished(self._recompute(state, at))
                causes[few.start] = stride.causes(state, pushes[few.start])
            ahead = slice(few.start, few.stop + 1)
            stride.advance(state, pushes[ahead], causes[ahead], ends[few])
            begins[few.start], begins[few.start + 1 : few.stop] = state, ends[few.start : few.stop - 1]
            state = ends[few.stop - 1]
        complete = count if self.at + count * length <= last else count - 1
        if complete:
            self.at += complete * length
            self.state, self.causes = ends[complete - 1], causes[complete]
        return StepBlocks(row, begins, ends, causes[:-1], rising)

    def _groups(self, count: int) -> Iterator[slice]:
        """Yield the blocks that belong to one group."""
        ahead = self.at // self.length % self._group
        firsts = [0, *range(self._group - ahead, count, self._group), count]
        return (slice(first, last) for first, last in pairwise(firsts))

    def _load_response(self, rising: FloatArray, first: int) -> FloatArray:
        """Return the contribution of loads to the states in blocks, shape (b, 3, n).

        Blocks are grouped between steps that are the same in every run, as the bits of a matrix product depend on its
        size and on the position of a row in it.
        """
        count, ahead = len(rising), first % self._group
        whole = -(-(ahead + count) // self._group)
        padded = np.zeros((whole * self._group, rising.shape[1]))
        padded[ahead : ahead + count] = rising
        added = padded.reshape(whole, self._group, rising.shape[1]) @ self._left
        return added.reshape(-1, *self.state.shape)[ahead : ahead + count]

    def _single(self, end: int, histories: FloatArray, row: int) -> StepBlocks:
        """Return single steps, and advance the state."""
        pushed = self.modal_forces(histories[: end - self.at + 1])
        states = np.empty((3, *pushed.shape))
        self.steps.walk(self._recompute(self.state, self.at), pushed, states)
        self.at, self.state = end, states[:, -1].copy()
        nothing = np.zeros((0, *self.state.shape))
        return StepBlocks(row, nothing, nothing, nothing, nothing[:, 0], states)

    def _recompute(self, state: FloatArray, at: int) -> FloatArray:
        """Return the state at a step recomputed from the saved unknowns, or unchanged if none are saved."""
        if not (self._exactly and at and at % self._every == 0):
            return state
        return self._natural.recompute(state / self.scale) * self.scale


class ModalEngine(Engine):
    """Engine of a linear problem (`modal_problem`) in modal coordinates; `stop` is called before every block of steps.

    At saved fields the coordinates are recomputed from the unknowns, so that a resumed run is identical bit by bit.
    """

    def __init__(
        self, problem: Problem, scheme: Scheme, save: SaveAt, stop: Callable[[], bool], natural: ModalCoordinates
    ) -> None:
        self._problem, self._system, self._stop = problem, problem.system, stop
        self._forces = LocalForces(problem.system)
        self._course = ModalPropagator(problem, scheme, natural, save.field_every)

    def advance(self, steps: IntArray) -> tuple[Trajectory, Status]:
        """Return the instants of some successive steps, see `Engine`."""
        if self._stop():
            return Trajectory.empty(self._system.size, self._forces), STOPPED
        first, at = self._first_instant(), self._problem.times(steps)
        row = int(steps[0]) - self._course.at
        walked = self._advance_states(int(steps[-1]))
        walked[1:] /= self._course.scale[1:, None]
        track = self._track(at, walked[:, row:]) if first is None else self._restore_first(first, at, walked)
        before = None if first is not None else stack_motion(self._track(at[:1], walked[:, row - 1 : row]))[0]
        return in_range(track, before, self._system, self._problem.drive.at(at).angle)

    def _first_instant(self) -> Trajectory | None:
        """Return the first instant if the run is at its start; else None."""
        if self._course.at >= 0:
            return None
        first = first_track(self._problem, self._forces)
        self._course.begin(first)
        return first

    def _advance_states(self, last: int) -> FloatArray:
        """Return the states from the current one up to a step, shape (3, m + 1, n)."""
        course, count = self._course, last - self._course.at + 1
        histories = course.histories(last)
        pushed, found = course.modal_forces(histories), np.empty((3, len(histories), self._system.size))
        found[:, 0] = course.state
        for stretch in course.sequences(last, histories):
            self._write_states(stretch, pushed, found)
        return found[:, :count]

    def _write_states(self, stretch: StepBlocks, pushed: FloatArray, found: FloatArray) -> None:
        """Write the states of a sequence, for all blocks together."""
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
        (d, v, a), nothing, sides = walked, np.zeros((len(at), 0)), np.zeros((len(at), 0), dtype=bool)
        return Trajectory(at, d, v, a, nothing, nothing, nothing, sides, np.arange(len(at)))

    def _restore_first(self, first: Trajectory, at: FloatArray, walked: FloatArray) -> Trajectory:
        """Return the first instant unchanged, and those after it."""
        return first if len(at) == 1 else Trajectory.concatenate([first, self._track(at[1:], walked[:, 1:])])

    def state(self) -> Arrays:
        """Return the state of the modes, see `Engine`."""
        course = self._course
        return {"at": np.array(course.at), "amounts": course.state, "causes": course.causes}

    def restore(self, state: Arrays) -> None:
        """Restore the state, see `Engine`."""
        course = self._course
        course.at, course.state, course.causes = int(state["at"]), state["amounts"], state["causes"]


@dataclass(frozen=True, eq=False)
class OutputMatrices:
    """Matrices for the motion of p rows in a block."""

    rows: FloatArray  #: shape (p, n)
    seen: FloatArray  #: motion after every step per cause and per change of load, shape (3 n + k (L + 1), L 3 p)

    @classmethod
    def of(cls, rows: FloatArray, course: ModalPropagator) -> OutputMatrices:
        """Return the matrices for a propagator with blocks."""
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
        for instant in range(1, length + 1):  # forces act from their instant on
            later[:, instant, instant - 1 :] = answers[:, : length + 1 - instant]
        return cls(rows, seen.reshape(len(seen), length * count))

    def evaluate(self, stretch: StepBlocks, course: ModalPropagator) -> FloatArray:
        """Return displacements, velocities and accelerations after every step of a sequence, shape (m, 3, p)."""
        if stretch.states is not None:
            return (stretch.states / course.scale[:, None] @ self.rows.T).swapaxes(0, 1)
        count, p = len(stretch.begins), len(self.rows)
        found = np.concatenate([stretch.causes.reshape(count, -1), stretch.rising], axis=1) @ self.seen
        found = found.reshape(count, -1, 3, p)
        found[:, :, 0] += (stretch.begins[:, 0] @ self.rows.T)[:, None]
        return found.reshape(-1, 3, p)


class ProbeEngine(ModalEngine):
    """Engine of a linear problem in modal coordinates that computes the probes only."""

    def __init__(
        self, problem: Problem, scheme: Scheme, save: SaveAt, stop: Callable[[], bool], natural: ModalCoordinates
    ) -> None:
        super().__init__(problem, scheme, save, stop, natural)
        self._save = save
        self._view = OutputMatrices.of(probe_rows(problem), self._course)

    def advance_probes(self, steps: IntArray) -> tuple[ProbeTrajectory, Status]:
        """Return the saved results of successive steps, up to the last in range, and a status, see `Engine`."""
        rows = self._view.rows
        if self._stop():
            return ProbeTrajectory.empty(len(rows), self._system.size), STOPPED
        saved = self._save.fields(steps, self._problem.steps)
        earlier = self.state()
        seen = self._evaluate(steps, saved)
        if seen is not None:
            return seen, Status()
        self.restore(earlier)  # repeat instant by instant to find the diverging motion
        track, status = self.advance(steps)
        probes = Series(*(one @ rows.T for one in (track.d, track.v, track.a)))
        return ProbeTrajectory(
            track.time, probes, Series(track.d, track.v, track.a).at(saved[: len(track.time)])
        ), status

    def _evaluate(self, steps: IntArray, saved: NDArray[np.bool_]) -> ProbeTrajectory | None:
        """Return the saved results of steps; None if a value diverges."""
        first, course = self._first_instant(), self._course
        begin, at = course.at, self._problem.times(steps)
        histories, rows = course.histories(int(steps[-1])), steps[saved] - begin
        found = np.empty((len(histories), 3, len(self._view.rows)))
        fields = np.empty((3, len(rows), self._system.size))
        if first is not None:
            fields[:, 0] = first.d[0], first.v[0], first.a[0]
            found[0] = fields[:, 0] @ self._view.rows.T
        for stretch in course.sequences(int(steps[-1]), histories):
            seen = self._view.evaluate(stretch, course)
            found[stretch.row + 1 : stretch.row + 1 + len(seen)] = seen
            within = (rows > stretch.row) & (rows <= stretch.row + len(seen))
            fields[:, within] = self._states(stretch, rows[within], histories) / course.scale[:, None]
        found = found[int(steps[0]) - begin : int(steps[-1]) - begin + 1]
        if not (all_within(found) and all_within(fields) and all_within(course.state)):
            return None
        return ProbeTrajectory(at, Series(*found.swapaxes(0, 1)), Series(*fields))

    def _states(self, stretch: StepBlocks, rows: IntArray, histories: FloatArray) -> FloatArray:
        """Return the states at selected rows of a sequence, shape (3, r, n)."""
        if stretch.states is not None:
            return stretch.states[:, rows - stretch.row - 1]
        which, past = np.divmod(rows - stretch.row - 1, self._course.length)
        found = stretch.ends[which].swapaxes(0, 1).copy()
        for i in np.flatnonzero(past < self._course.length - 1).tolist():  # the last step of a run may not end a block
            row = stretch.row + int(which[i]) * self._course.length
            pushed = self._course.modal_forces(histories[row : row + int(past[i]) + 2])
            states = np.empty((3, *pushed.shape))
            self._course.steps.walk(stretch.begins[which[i]], pushed, states)
            found[:, i] = states[:, -1]
        return found


def probe_rows(problem: Problem) -> FloatArray:
    """Return the rows of all probes of a problem."""
    return np.concatenate([np.zeros((0, problem.system.size)), *(one.rows for one in problem.system.probes)])
