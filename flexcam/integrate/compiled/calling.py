"""Calls of the machine code: the state that moves along, room to work in, and what comes out."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from flexcam.integrate.compiled.machine import machine_code
from flexcam.integrate.compiled.packed import Operator, PackedForces, PackedSystem
from flexcam.integrate.compiled.window import LOOSE, NOISE, SAME, Windows, points
from flexcam.integrate.crossing import MOST_EVENTS
from flexcam.integrate.local import LocalForces, Schedule
from flexcam.integrate.moment import Instant, Moment
from flexcam.integrate.problem import Problem
from flexcam.integrate.scheme import Scheme
from flexcam.integrate.settle import Inner, NoConvergenceError
from flexcam.linalg import FloatArray, IntArray

DONE, UNSETTLED = 0, 2
NO_SIDES = np.zeros((3, 0), dtype=np.intp)
"""Of a call that looks at no switching scalar."""


@dataclass(frozen=True, eq=False)
class Moving:
    """An instant whose arrays a march moves along.

    Parameters
    ----------
    motion
        q, v, a, the forces on the motions, and six rows to work in, shape (10, n).
    forces
        Local forces, what they sense, its rate, and the forces' last change, shape (4, c).
    inner
        Internal states, their rates, and three rows to work in, shape (5, s).
    """

    motion: FloatArray
    forces: FloatArray
    inner: FloatArray

    @classmethod
    def of(cls, moment: Moment) -> Moving:
        """Return a copy of an instant."""
        motion = np.zeros((10, len(moment.d)))
        motion[:4] = moment.d, moment.v, moment.a, moment.applied
        inner = np.zeros((5, len(moment.inner.state)))
        inner[:2] = moment.inner.state, moment.inner.rate
        nothing = np.zeros(len(moment.gap))
        forces = np.array([moment.local, moment.gap, moment.rate, nothing, nothing])
        return cls(motion, forces, inner)

    def moment(self, time: float, pressed: NDArray[np.bool_] | None = None) -> Moment:
        """Return the instant; its arrays are its own."""
        (d, v, a, applied), (local, gap, rate) = self.motion[:4].copy(), self.forces[:3].copy()
        inner = Inner(*self.inner[:2].copy())
        return Moment(time, d, v, a, applied, local, gap, rate, inner, pressed)


@dataclass(frozen=True, eq=False)
class Ended:
    """How a march ended.

    Parameters
    ----------
    how
        `DONE`, or why not.
    row
        That was reached.
    iterations
        Newton's, of the steps without events.
    events
        How many it walked over.
    between
        Instants of them: what a row of results has, time (s) and the row behind, shape (e, columns + 2).
    """

    how: int
    row: int
    iterations: int
    events: int
    between: FloatArray


class March:
    """The compiled step of one system.

    Parameters
    ----------
    problem
        Uncoupled, its laws all known as formulas.
    scheme
        Of the time integration.
    forces
        The local forces, stacked.
    """

    def __init__(self, problem: Problem, scheme: Scheme, forces: LocalForces) -> None:
        self._run, self._scheme, self.forces = machine_code(), scheme, forces
        self.packed = PackedForces.of(forces)
        c, width = forces.count, int(self.packed.laws[:, 2].max(initial=1))
        self._room = (
            np.zeros((10, c)), np.zeros((2, c, width)), np.zeros(len(forces.sense.vectors)),
            np.zeros((2, c), dtype=np.intp), np.zeros((3, c, c + 1)),
        )  # fmt: skip
        n, s = problem.system.size, len(forces.start_state)
        self.columns = 3 * n + c + s
        self._system = PackedSystem.of(problem.system, forces)
        acts = len(forces.act.vectors)
        solved = np.zeros((n, n + 1 + acts) if len(self._system.coupled) else (0, 0))
        self._part = solved, points(), np.zeros(11)
        self._events = np.empty((4 * MOST_EVENTS, self.columns + 2))
        self._kept = np.zeros((4, n)), np.zeros((5, c)), np.zeros((4, s))
        self._unseen = np.zeros((0, 0, 0)), np.zeros(1, dtype=np.intp)

    def operator(self, step: float) -> Operator:
        """Return what a step of a length does."""
        return self._system.operator(self._scheme, step)

    def given(self, times: FloatArray, loads: FloatArray, schedule: Schedule) -> FloatArray:
        """Return what is prescribed at some times: loads, what follows from the cam, time; a row more to work in."""
        n, columns = loads.shape[1], sum(len(part.still) for part in schedule.parts) + len(self.packed.functions)
        given = np.empty((len(times) + 1, n + columns + 1))
        given[:-1, :n], given[:-1, -1] = loads, times
        self.packed.put(schedule, given[:-1, n:-1])
        return given

    def same(self) -> FloatArray:
        """Return by how much every column of `given` may be missed between instants, as a part of its size."""
        senses, acts, c = len(self.forces.sense.vectors), len(self.forces.act.vectors), self.forces.count
        n, functions = self._system.motions.shape[1], [LOOSE if one else NOISE for one in self.packed.loosely]
        parts = ((n + senses, SAME), (senses, NOISE), (acts + c, SAME), (c, NOISE))
        return np.array([*(same for count, same in parts for _ in range(count)), *functions, SAME])

    def call(
        self, operator: Operator, moving: Moving, rows: tuple[int, int], given: FloatArray, found: FloatArray,
        sides: IntArray = NO_SIDES, windows: Windows | None = None,
    ) -> Ended:  # fmt: skip
        """March over some rows. The state and the sides of the switching scalars (row 1) move along.

        Steps with events are walked where there are windows of them.
        """
        system, packed, count = self._system, self.packed, np.zeros(4, dtype=np.intp)
        tables, steps = self._unseen if windows is None else (windows.tables, windows.rows)
        how = self._run(
            *rows, operator.scheme, operator.motions, operator.give, operator.inverse, system.coupled, system.vectors,
            given, packed.laws, packed.constants, packed.places, moving.motion, moving.forces, moving.inner,
            *self._room, sides, found, count, *self._part, tables, steps, self._events, *self._kept,
        )  # fmt: skip
        row, iterations, walked, between = count.tolist()
        return Ended(int(how), row, iterations, walked, self._events[:between].copy())

    def unsettled(self) -> list[str]:
        """Return the names of the forces that did not settle in the last call, as `settle` tells them."""
        found, answered = self._room[0][0], self._room[0][3]
        missing = np.abs(found - answered)
        return [name for name, one in zip(self.forces.names, missing, strict=True) if one > 0.1 * missing.max()]


class CompiledStepper:
    """A single compiled step of any length, for the `Walker`.

    Parameters
    ----------
    march
        The compiled step.
    step
        s.
    """

    def __init__(self, march: March, step: float) -> None:
        self._march, self._operator = march, march.operator(step)

    def advance(self, now: Moment, to: Instant) -> Moment:
        """Return the next instant, as `Stepper` says."""
        march, moving = self._march, Moving.of(now)
        given = march.given(np.array([to.time]), to.load[None], to.schedule.row(to.row))
        ended = march.call(self._operator, moving, (0, 1), given, np.empty((1, march.columns)))
        if ended.how == UNSETTLED:
            raise NoConvergenceError(march.unsettled())
        return replace(moving.moment(to.time), iterations=ended.iterations)
