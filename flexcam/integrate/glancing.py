"""What the probes see of natural motions, found without them: of a linear run whose channels nobody asks for."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from flexcam.integrate.course import Course, Stretch
from flexcam.integrate.engine import STOPPED, all_within
from flexcam.integrate.generalized_alpha import Scheme
from flexcam.integrate.moment import Glance
from flexcam.integrate.problem import Problem
from flexcam.integrate.superposed import Superposed
from flexcam.integrate.uncoupled import Natural
from flexcam.linalg import FloatArray, IntArray
from flexcam.response import SaveAt, Series, Status


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
    def of(cls, rows: FloatArray, course: Course) -> View:
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

    def of_stretch(self, stretch: Stretch, course: Course) -> FloatArray:
        """Return displacements, velocities and accelerations after every step of a stretch, shape (m, 3, p)."""
        if stretch.states is not None:
            return (stretch.states / course.scale[:, None] @ self.rows.T).swapaxes(0, 1)
        count, p = len(stretch.begins), len(self.rows)
        found = np.concatenate([stretch.causes.reshape(count, -1), stretch.rising], axis=1) @ self.seen
        found = found.reshape(count, -1, 3, p)
        found[:, :, 0] += (stretch.begins[:, 0] @ self.rows.T)[:, None]
        return found.reshape(-1, 3, p)


class Glancing(Superposed):
    """Walks through a linear problem in its natural motions, and looks at the probes alone.

    Parameters
    ----------
    problem, scheme, save, stop, natural
        As for `Superposed`.
    """

    def __init__(
        self, problem: Problem, scheme: Scheme, save: SaveAt, stop: Callable[[], bool], natural: Natural
    ) -> None:
        super().__init__(problem, scheme, save, stop, natural)
        self._save = save
        self._view = View.of(watched_rows(problem), self._course)

    def glance(self, steps: IntArray) -> tuple[Glance, Status]:
        """Return what is kept of some successive steps, up to the last in range, and a status as `Engine` says."""
        rows = self._view.rows
        if self._stop():
            return Glance.none(len(rows), self._system.size), STOPPED
        saved = self._save.fields(steps, self._problem.steps)
        earlier = self.state()
        seen = self._seen(steps, saved)
        if seen is not None:
            return seen, Status()
        self.restore(earlier)  # again, instant by instant, to see which motion left the range of numbers
        track, status = self.advance(steps)
        probes = Series(*(one @ rows.T for one in (track.d, track.v, track.a)))
        return Glance(track.time, probes, Series(track.d, track.v, track.a).at(saved[: len(track.time)])), status

    def _seen(self, steps: IntArray, saved: NDArray[np.bool_]) -> Glance | None:
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
        return Glance(at, Series(*found.swapaxes(0, 1)), Series(*fields))

    def _states(self, stretch: Stretch, rows: IntArray, histories: FloatArray) -> FloatArray:
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


def watched_rows(problem: Problem) -> FloatArray:
    """Return the rows of all probes of a problem."""
    return np.concatenate([np.zeros((0, problem.system.size)), *(one.rows for one in problem.system.probes)])
