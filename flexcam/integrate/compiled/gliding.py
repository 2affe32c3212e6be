"""The engine of the compiled way where no local forces act: damping may couple all motions."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from flexcam.checkpoint import Arrays, flattened
from flexcam.integrate.compiled.machine import gliding_code
from flexcam.integrate.compiled.packed import PackedSystem
from flexcam.integrate.engine import STOPPED, everything, in_range
from flexcam.integrate.first import Starter
from flexcam.integrate.local import LocalForces
from flexcam.integrate.moment import Instant, Moment, Track
from flexcam.integrate.problem import Problem, State
from flexcam.integrate.scheme import Scheme
from flexcam.integrate.settle import Inner
from flexcam.linalg import FloatArray, IntArray
from flexcam.response import Stats, Status
from flexcam.system import CamMotion

_NOTHING = np.zeros(0)


class Gliding:
    """Walks through an uncoupled linear problem in machine code.

    Parameters
    ----------
    problem
        `uncoupled`, without local forces.
    scheme
        Of the generalized-alpha family.
    forces
        Its local forces, none.
    stop
        Asked before every block of steps.
    """

    def __init__(self, problem: Problem, scheme: Scheme, forces: LocalForces, stop: Callable[[], bool]) -> None:
        self._problem, self._system, self._forces, self._stop = problem, problem.system, forces, stop
        self._packed = PackedSystem.of(problem.system, forces)
        self._operator = self._packed.operator(scheme, problem.step)
        self._vectors = problem.system.load_vectors()
        self._run, self._starter = gliding_code(), Starter(problem.system, forces)
        self._last: Moment | None = None

    def advance(self, steps: IntArray) -> tuple[Track, Status]:
        """Return the instants of some successive steps, as `Engine` says."""
        n = self._system.size
        if self._stop():
            return Track.none(n, self._forces), STOPPED
        at = self._problem.times(steps)
        motion, found = self._problem.drive.at(at), np.empty((len(at), 3 * n))
        before = None if self._last is None else everything(Track.of([[self._last]]))[0]
        row, histories = self._begun(at, motion, found), self._system.load_histories(motion)
        self._glided(float(at[-1]), (row, len(at)), histories, found)
        d, v, a = np.split(found, 3, axis=1)
        nothing = np.zeros((len(at), 0))
        track = Track(at, d, v, a, nothing, nothing, nothing, np.arange(len(at)))
        return in_range(track, before, self._system, motion.angle)

    def _begun(self, at: FloatArray, motion: CamMotion, found: FloatArray) -> int:
        """Return the first row to be walked; behind the first instant, which is put, at the start."""
        if self._last is not None:
            return 0
        first = CamMotion(motion.angle[:1], motion.speed[:1], motion.rate[:1])
        to = Instant(float(at[0]), self._system.applied(first)[0], self._forces.schedule(first))
        self._last = self._starter.first(self._problem.start or State.rest(self._system.size), to)
        found[0] = np.concatenate([self._last.d, self._last.v, self._last.a])
        return 1

    def _glided(self, time: float, rows: tuple[int, int], histories: FloatArray, found: FloatArray) -> None:
        """Walk over some rows, up to a time."""
        if self._last is None:
            return
        operator, last = self._operator, self._last
        state, loads = np.zeros((8, self._system.size)), np.empty(self._system.size)
        state[:4] = last.d, last.v, last.a, last.applied
        self._run(
            *rows, operator.scheme[0], operator.motions[0], operator.inverse, self._packed.coupled, histories,
            self._vectors, loads, state, found,
        )  # fmt: skip
        d, v, a, applied = state[:4].copy()
        inner = Inner(_NOTHING, _NOTHING)
        self._last = Moment(time, d, v, a, applied, _NOTHING, _NOTHING, _NOTHING, inner)

    def counted(self, stats: Stats) -> Stats:
        """Return figures of the run as they are: there is nothing to iterate on."""
        return stats

    def state(self) -> Arrays:
        """Return the last instant, as `Engine` says."""
        return flattened("last", self._last)

    def restore(self, state: Arrays) -> None:
        """Go on, as `Engine` says."""
        self._last = Moment.restored("last", state)
