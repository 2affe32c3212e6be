"""The way through time of a linear system whose natural motions nothing couples: all of them side by side.

They go from stride to stride (`course`); what is between is found for all strides at once, a step of each at a time.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from flexcam.checkpoint import Arrays
from flexcam.integrate.course import Course, Stretch
from flexcam.integrate.engine import STOPPED, everything, first_track, in_range
from flexcam.integrate.generalized_alpha import Scheme
from flexcam.integrate.local import LocalForces
from flexcam.integrate.moment import Track
from flexcam.integrate.problem import Problem
from flexcam.integrate.uncoupled import Natural
from flexcam.linalg import FloatArray, IntArray
from flexcam.response import SaveAt, Stats, Status


class Superposed:
    """Walks through a linear problem in its natural motions.

    Parameters
    ----------
    problem
        `uncoupled`, without local forces, its damping diagonal.
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
        self, problem: Problem, scheme: Scheme, save: SaveAt, stop: Callable[[], bool], natural: Natural
    ) -> None:
        self._problem, self._system, self._stop = problem, problem.system, stop
        self._forces = LocalForces(problem.system)
        self._course = Course(problem, scheme, natural, save.field_every)

    def advance(self, steps: IntArray) -> tuple[Track, Status]:
        """Return the instants of some successive steps, as `Engine` says."""
        if self._stop():
            return Track.none(self._system.size, self._forces), STOPPED
        first, at = self._begun(), self._problem.times(steps)
        row = int(steps[0]) - self._course.at
        walked = self._walked(int(steps[-1]))
        walked[1:] /= self._course.scale[1:, None]
        track = self._track(at, walked[:, row:]) if first is None else self._led(first, at, walked)
        before = None if first is not None else everything(self._track(at[:1], walked[:, row - 1 : row]))[0]
        return in_range(track, before, self._system, self._problem.drive.at(at).angle)

    def _begun(self) -> Track | None:
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

    def _put(self, stretch: Stretch, pushed: FloatArray, found: FloatArray) -> None:
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

    def _track(self, at: FloatArray, walked: FloatArray) -> Track:
        (d, v, a), nothing = walked, np.zeros((len(at), 0))
        return Track(at, d, v, a, nothing, nothing, nothing, np.arange(len(at)))

    def _led(self, first: Track, at: FloatArray, walked: FloatArray) -> Track:
        """Return the first instant, with every bit that it begins with, and those behind it."""
        return first if len(at) == 1 else Track.joined([first, self._track(at[1:], walked[:, 1:])])

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
