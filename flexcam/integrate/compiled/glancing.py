"""Machine code that keeps the probes alone: of a linear run whose channels nobody asks for."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from flexcam.integrate.compiled.calling import NO_SIDES, March, Moving
from flexcam.integrate.compiled.marching import Marching
from flexcam.integrate.engine import LARGEST, STOPPED
from flexcam.integrate.local import LocalForces
from flexcam.integrate.moment import Glance, Instant
from flexcam.integrate.problem import Problem, State
from flexcam.integrate.scheme import Scheme
from flexcam.linalg import FloatArray, IntArray
from flexcam.response import SaveAt, Series, Status


class Glancing(Marching):
    """Marches through an uncoupled problem with probes and without local forces, and keeps what is saved.

    Parameters
    ----------
    problem
        `uncoupled`.
    scheme
        Of the generalized-alpha family.
    forces
        Its local forces, none.
    save
        What is kept.
    stop
        Asked before every part of a block.
    """

    def __init__(
        self, problem: Problem, scheme: Scheme, forces: LocalForces, save: SaveAt, stop: Callable[[], bool]
    ) -> None:
        super().__init__(problem, scheme, forces, stop)
        self._save = save
        self._rows = np.concatenate([np.zeros((0, problem.system.size)), *(one.rows for one in problem.system.probes)])
        self._watching = March(problem, scheme, forces, self._rows)

    def glance(self, steps: IntArray) -> tuple[Glance, Status]:
        """Return what is kept of some successive steps, up to the last in range, and a status as `Engine` says."""
        if self._stop():
            return Glance.none(len(self._rows), self._system.size), STOPPED
        saved = self._save.fields(steps, self._problem.steps)
        before = self._last
        seen = self._watched(steps, np.flatnonzero(saved))
        if seen is not None:
            return seen, Status()
        self._last = before  # again, instant by instant, to see which motion left the range of numbers
        track, status = self.advance(steps)
        probes = Series(*(one @ self._rows.T for one in (track.d, track.v, track.a)))
        kept = saved[: len(track.time)]
        return Glance(track.time, probes, Series(track.d, track.v, track.a).at(kept)), status

    def _watched(self, steps: IntArray, saved: IntArray) -> Glance | None:
        """Return what is kept of some steps; None where something leaves the range of numbers."""
        at = self._problem.times(steps)
        loads, schedule = self._prescribed(at)
        loads, cam = np.ascontiguousarray(loads), self._watching.packed.cam(schedule)
        found = np.empty((len(at), self._watching.columns))
        fields: list[FloatArray] = []
        row = 0
        if self._last is None:
            start = self._problem.start or State.rest(self._system.size)
            self._last = self._starter.first(start, Instant(float(at[0]), loads[0], schedule, 0))
            motion = np.array([self._last.d, self._last.v, self._last.a])
            found[0], row = (motion @ self._rows.T).ravel(), 1
            fields.append(motion)
        moving = Moving.of(self._last)
        for end in [*(saved[saved >= row] + 1).tolist(), len(at)]:
            if end > row:
                self._watching.call(self._whole, moving, (row, end), loads, cam, found, NO_SIDES)
                row = end
                if end - 1 in saved:
                    fields.append(moving.motion[:3].copy())
        flat = found.ravel()
        last = moving.motion[:3]
        if not (float(flat @ flat) < LARGEST**2 and float(np.abs(last).max(initial=0.0)) < LARGEST):
            return None
        self._last = moving.moment(float(at[-1]))
        d, v, a = np.split(found, 3, axis=1)
        kept = np.array(fields).reshape(-1, 3, self._system.size)
        return Glance(at, Series(d, v, a), Series(kept[:, 0], kept[:, 1], kept[:, 2]))
