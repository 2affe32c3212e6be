"""Machine code that keeps the probes alone: of a linear run whose channels nobody asks for."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from flexcam.integrate.compiled.gliding import Gliding
from flexcam.integrate.engine import LARGEST, STOPPED
from flexcam.integrate.local import LocalForces
from flexcam.integrate.moment import Glance
from flexcam.integrate.problem import Problem
from flexcam.integrate.scheme import Scheme
from flexcam.linalg import FloatArray, IntArray
from flexcam.response import SaveAt, Series, Status


class Glancing(Gliding):
    """Glides through an uncoupled linear problem with probes, and keeps what is saved.

    Parameters
    ----------
    problem
        `uncoupled`, without local forces.
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
        motion, found = self._problem.drive.at(at), np.empty((len(at), 3 * len(self._rows)))
        histories = self._system.load_histories(motion)
        fields: list[tuple[FloatArray, ...]] = []
        row = self._begun(at, motion, found, self._rows)
        if row:  # the start is always kept
            fields.append(self._motion())
        for end in [*(saved[saved >= row] + 1).tolist(), len(at)]:
            if end > row:
                self._glided(float(at[end - 1]), (row, end), histories, self._rows, found)
                row = end
                if end - 1 in saved:
                    fields.append(self._motion())
        flat = found.ravel()
        largest = max(float(np.abs(one).max(initial=0.0)) for one in self._motion())
        if not (float(flat @ flat) < LARGEST**2 and largest < LARGEST):
            return None
        d, v, a = np.split(found, 3, axis=1)
        kept = np.array(fields).reshape(-1, 3, self._system.size)
        return Glance(at, Series(d, v, a), Series(kept[:, 0], kept[:, 1], kept[:, 2]))

    def _motion(self) -> tuple[FloatArray, ...]:
        """Return displacement, velocity and acceleration of the last instant."""
        return () if self._last is None else (self._last.d, self._last.v, self._last.a)
