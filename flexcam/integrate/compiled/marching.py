"""The engine of the compiled way: marches in machine code, and walks where a contact opens or closes."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from flexcam.checkpoint import Arrays, flattened
from flexcam.integrate.compiled.calling import DONE, UNSETTLED, CompiledStepper, March, Moving
from flexcam.integrate.compiled.window import AT_ONCE, Windows
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


@dataclass(frozen=True, eq=False)
class Between:
    """Instants that end no step, and impacts.

    Parameters
    ----------
    rows
        What a row of results has, time (s) and the row behind, shape (m, columns + 2).
    impulse
        At them, N s, shape (m, c).
    struck
        At ends of steps, by row.
    """

    rows: FloatArray
    impulse: FloatArray
    struck: dict[int, FloatArray]

    @classmethod
    def marched(cls, rows: FloatArray, count: int) -> Between:
        """Return those of a march: it knows no impacts."""
        return cls(rows, np.zeros((len(rows), count)), {})

    @classmethod
    def walked(cls, moments: Sequence[Moment], row: int) -> Between:
        """Return those of a step that was walked."""
        *within, last = moments
        nothing = np.zeros(len(last.local))
        impulse = [nothing if one.impulse is None else one.impulse for one in within]
        rows = [np.concatenate([_row(one), [one.time, row]]) for one in within]
        columns = len(_row(last)) + 2
        return cls(
            np.array(rows).reshape(-1, columns), np.array(impulse).reshape(-1, len(nothing)),
            {} if last.impulse is None else {row: last.impulse},
        )  # fmt: skip


def _placed(ends: IntArray, at_ends: FloatArray, places: IntArray, between: FloatArray) -> FloatArray:
    """Return rows of two kinds at their places."""
    found = np.empty((len(ends) + len(places), *at_ends.shape[1:]))
    found[ends], found[places] = at_ends, between
    return found


def _row(one: Moment) -> FloatArray:
    """Return what a row of results has of an instant."""
    return np.concatenate([one.d, one.v, one.a, one.local, one.inner.state])


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
        self._walks = scheme.balances and bool(np.isnan(forces.restitution).all())
        self._windows: Windows | None = None
        self._same = self._march.same()
        self._row, self._end = 0, 0.0
        self._last: Moment | None = None
        self._iterations, self._events = 0, 0

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
        """March, and walk the steps that no march can take."""
        found, given = np.empty((len(at), self._march.columns)), self._march.given(at, loads, schedule)
        between: list[Between] = []
        row, status, self._windows = 0, Status(), None
        if self._last is None:
            to = Instant(float(at[0]), loads[0], schedule, 0)
            self._last, row = self._starter.first(self._problem.start or State.rest(self._system.size), to), 1
            found[0] = _row(self._last)
        moving, sides = Moving.of(self._last), self._sides(self._last)
        while row < len(at):
            seen = self._windows if self._walks else None
            ended = self._march.call(self._whole, moving, (row, len(at)), given, found, sides, seen)
            self._iterations += ended.iterations
            self._events += ended.events
            between.append(Between.marched(ended.between, self._forces.count))
            row = ended.row
            if ended.how == DONE:
                break
            if self._windows is None or not self._windows.cover(row):
                few = slice(row, row + AT_ONCE)
                self._windows = Windows(row, at[few], self._problem.step, self._looked_at, self._same)
                if self._walks and ended.how != UNSETTLED:
                    continue
            to = Instant(float(at[row]), loads[row], schedule, row)
            self._row, self._end = row, to.time
            now = moving.moment(float(at[row - 1]) if row else self._last.time, sides[1] > 0)
            try:
                walked = self._walker.walk(now, to)
            except NoConvergenceError as fault:
                status = unsettled(fault.forces, to.time, to.angle)
                break
            self._iterations += sum(moment.iterations for moment in walked)
            between.append(Between.walked(walked, row))
            found[row], row = _row(walked[-1]), row + 1
            moving, sides = Moving.of(walked[-1]), self._sides(walked[-1])
        if row:
            self._last = moving.moment(float(at[row - 1]), sides[1] > 0)
        return self._track(at[:row], found[:row], between), status

    def _track(self, time: FloatArray, found: FloatArray, between: Sequence[Between]) -> Track:
        """Return the rows of a march with those between them in their places."""
        n, c, ends = self._system.size, self._forces.count, np.arange(len(time))
        impulse = np.zeros((len(time), c))
        for row, struck in (pair for one in between for pair in one.struck.items()):
            impulse[row] = struck
        if any(len(one.rows) for one in between):
            instants = np.concatenate([one.rows for one in between])
            before = instants[:, -1].astype(np.intp)  # ascending: steps are marched in order
            ends = ends + np.searchsorted(before, ends, side="right")
            places = before + np.arange(len(before))
            time = _placed(ends, time, places, instants[:, -2])
            found = _placed(ends, found, places, instants[:, :-2])
            impulse = _placed(ends, impulse, places, np.concatenate([one.impulse for one in between]))
        d, v, a, force, inner = np.split(found, [n, 2 * n, 3 * n, 3 * n + c], axis=1)
        return Track(time, d, v, a, force, inner, impulse, ends)

    def counted(self, stats: Stats) -> Stats:
        """Return figures of the run with those counted here."""
        return replace(stats, iterations=self._iterations, events=self._events + self._walker.events)

    def state(self) -> Arrays:
        """Return the last instant and the counts, as `Engine` says."""
        return {
            **flattened("last", self._last),
            "counts": np.array([self._iterations, self._events, self._walker.events]),
        }

    def restore(self, state: Arrays) -> None:
        """Go on, as `Engine` says."""
        self._last = Moment.restored("last", state)
        self._iterations, self._events, self._walker.events = state["counts"].tolist()

    def _sides(self, moment: Moment) -> IntArray:
        """Return the switching scalars, and which of them count as pressed."""
        pressed = self._forces.pressed(moment.gap) if moment.pressed is None else moment.pressed
        return np.array([self._forces.switching, pressed, pressed], dtype=np.intp)

    def _at(self, time: float) -> Instant:
        """Return what is prescribed at a time within the step that is walked."""
        times = np.array([time])
        if self._windows is not None and self._windows.cover(self._row):
            seen = self._windows.at(self._row, 1.0 + (time - self._end) / self._problem.step)
            if seen is not None:
                angle = self._problem.drive.at(times).angle
                load, cam = seen[: self._system.size], seen[None, self._system.size : -1]
                return Instant(time, load, self._march.packed.schedule(cam, angle, self._forces))
        loads, schedule = self._prescribed(times)
        return Instant(time, loads[0], schedule)

    def _prescribed(self, times: FloatArray) -> tuple[FloatArray, Schedule]:
        motion = self._problem.drive.at(times)
        return self._system.applied(motion), self._forces.schedule(motion)

    def _looked_at(self, times: FloatArray) -> FloatArray:
        loads, schedule = self._prescribed(times)
        return self._march.given(times, loads, schedule)[:-1]

    def _stepper(self, step: float) -> CompiledStepper:
        return CompiledStepper(self._march, step)
