"""The engine of the compiled way: marches in machine code, and walks where a contact opens or closes."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from flexcam.checkpoint import Arrays, flattened
from flexcam.integrate.compiled.calling import DONE, CompiledStepper, March, Moving
from flexcam.integrate.compiled.window import Window
from flexcam.integrate.engine import STOPPED, everything, in_range, unsettled
from flexcam.integrate.events import Walker
from flexcam.integrate.first import Starter
from flexcam.integrate.local import LocalForces, Schedule
from flexcam.integrate.moment import Instant, Moment, Track
from flexcam.integrate.problem import Problem, State
from flexcam.integrate.scheme import Scheme
from flexcam.integrate.settle import NoConvergenceError
from flexcam.linalg import FloatArray, IntArray
from flexcam.response import Stats, Status

_FIRST = np.array([0, 1])


class Marching:
    """Walks through an uncoupled problem in machine code.

    Parameters
    ----------
    problem
        `uncoupled`.
    scheme
        Of the generalized-alpha family.
    forces
        Its local forces, stacked.
    stop
        Asked before every block of steps.
    """

    def __init__(self, problem: Problem, scheme: Scheme, forces: LocalForces, stop: Callable[[], bool]) -> None:
        self._problem, self._system, self._forces, self._stop = problem, problem.system, forces, stop
        self._march = March(problem, scheme, forces)
        self._whole = self._march.operator(problem.step)
        self._starter = Starter(problem.system, forces)
        self._walker = Walker(problem.step, forces, self._starter, self._at, self._stepper, balances=scheme.balances)
        self._window = Window(problem.times(_FIRST)[0], problem.times(_FIRST)[1], self._prescribed)
        self._last: Moment | None = None
        self._iterations = 0

    def advance(self, steps: IntArray) -> tuple[Track, Status]:
        """Return the instants of some successive steps, as `Engine` says."""
        if self._stop():
            return Track.none(self._system.size, self._forces), STOPPED
        at = self._problem.times(steps)
        loads, schedule = self._prescribed(at)
        before = None if self._last is None else everything(Track.of([[self._last]]))[0]
        track, status = self._marched(at, loads, schedule)
        if not len(track.ends):
            return track, status
        kept, left = in_range(track, before, self._system, schedule.angle)
        return kept, status if left.ok else left

    def _marched(self, at: FloatArray, loads: FloatArray, schedule: Schedule) -> tuple[Track, Status]:
        """March from event to event, and walk the step that holds one."""
        found, cam = np.empty((len(at), self._march.columns)), self._march.packed.cam(schedule)
        walked: dict[int, list[Moment]] = {}
        row, status = 0, Status()
        if self._last is None:
            to = Instant(float(at[0]), loads[0], schedule, 0)
            self._last, row = self._starter.first(self._problem.start or State.rest(self._system.size), to), 1
            walked[0] = [self._last]
        while row < len(at):
            moving = Moving.of(self._last)
            rows, sides = (row, len(at)), self._sides(self._last)
            ended, reached, iterations = self._march.call(self._whole, moving, rows, loads, cam, found, sides)
            self._iterations += iterations
            if reached > row:
                self._last, row = moving.moment(float(at[reached - 1])), reached
            if ended == DONE:
                break
            to = Instant(float(at[row]), loads[row], schedule, row)
            self._window = Window(self._last.time, to.time, self._prescribed)
            try:
                walked[row] = self._walker.walk(self._last, to)
            except NoConvergenceError as fault:
                status = unsettled(fault.forces, to.time, to.angle)
                break
            self._iterations += sum(moment.iterations for moment in walked[row])
            self._last, row = walked[row][-1], row + 1
        return self._track(at[:row], found, walked), status

    def _track(self, time: FloatArray, found: FloatArray, walked: dict[int, list[Moment]]) -> Track:
        """Return the rows of a march with those that were walked in their places."""
        n, c = self._system.size, self._forces.count
        tracks: list[Track] = []
        begin = 0
        for row, moments in walked.items():
            if len(moments) == 1 and moments[0].impulse is None:
                one = moments[0]
                found[row] = np.concatenate([one.d, one.v, one.a, one.local, one.inner.state])
                del moments[:]
        for row, moments in [*walked.items(), (len(time), [])]:
            if not moments and row < len(time):
                continue
            d, v, a, force, inner = np.split(found[begin:row], [n, 2 * n, 3 * n, 3 * n + c], axis=1)
            tracks.append(Track(time[begin:row], d, v, a, force, inner, np.zeros_like(force), np.arange(row - begin)))
            tracks += [Track.of([moments])] if moments else []
            begin = row + 1
        return Track.joined(tracks) if len(tracks) > 1 else tracks[0]

    def counted(self, stats: Stats) -> Stats:
        """Return figures of the run with those counted here."""
        return replace(stats, iterations=self._iterations, events=self._walker.events)

    def state(self) -> Arrays:
        """Return the last instant and the counts, as `Engine` says."""
        return {**flattened("last", self._last), "counts": np.array([self._iterations, self._walker.events])}

    def restore(self, state: Arrays) -> None:
        """Go on, as `Engine` says."""
        self._last = Moment.restored("last", state)
        self._iterations, self._walker.events = state["counts"].tolist()

    def _sides(self, moment: Moment) -> IntArray:
        """Return the switching scalars, and which of them count as pressed."""
        pressed = self._forces.pressed(moment.gap) if moment.pressed is None else moment.pressed
        return np.array([self._forces.switching, pressed], dtype=np.intp)

    def _at(self, time: float) -> Instant:
        """Return what is prescribed at a time within the step that is walked."""
        if self._window.smooth and self._window.begin <= time <= self._window.end:
            return self._window.at(time)
        loads, schedule = self._prescribed(np.array([time]))
        return Instant(time, loads[0], schedule)

    def _prescribed(self, times: FloatArray) -> tuple[FloatArray, Schedule]:
        motion = self._problem.drive.at(times)
        return self._system.applied(motion), self._forces.schedule(motion)

    def _stepper(self, step: float) -> CompiledStepper:
        return CompiledStepper(self._march, step)
