"""Calls of the machine code: the state that moves along, room to work in, and what comes out."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from flexcam.integrate.compiled.machine import machine_code
from flexcam.integrate.compiled.packed import Operator, PackedForces, PackedSystem
from flexcam.integrate.local import LocalForces
from flexcam.integrate.moment import Instant, Moment
from flexcam.integrate.problem import Problem
from flexcam.integrate.scheme import Scheme
from flexcam.integrate.settle import Inner, NoConvergenceError
from flexcam.linalg import FloatArray, IntArray

DONE, UNSETTLED = 0, 2
NO_SIDES = np.zeros((2, 0), dtype=np.intp)
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
        forces = np.array([moment.local, moment.gap, moment.rate, np.zeros(len(moment.gap))])
        return cls(motion, forces, inner)

    def moment(self, time: float, iterations: int = 0) -> Moment:
        """Return the instant; its arrays are its own."""
        (d, v, a, applied), (local, gap, rate) = self.motion[:4].copy(), self.forces[:3].copy()
        inner = Inner(*self.inner[:2].copy())
        return Moment(time, d, v, a, applied, local, gap, rate, inner, iterations=iterations)


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
    watched
        Rows that are all that is asked of a step, shape (w, n); none where everything is.
    """

    def __init__(
        self, problem: Problem, scheme: Scheme, forces: LocalForces, watched: FloatArray | None = None
    ) -> None:
        self._run, self._scheme, self.forces = machine_code(), scheme, forces
        self.packed, self._system = PackedForces.of(forces), PackedSystem.of(problem.system, forces)
        c, width = forces.count, int(self.packed.laws[:, 2].max(initial=1))
        self._room = (
            np.zeros((7, c)), np.zeros((2, c, width)), np.zeros(len(forces.sense.vectors)),
            np.zeros((2, c), dtype=np.intp), np.zeros((3, c, c + 1)),
        )  # fmt: skip
        self._watched = np.zeros((0, problem.system.size)) if watched is None else np.ascontiguousarray(watched)
        self.columns = 3 * (len(self._watched) or problem.system.size) + c + len(forces.start_state)

    def operator(self, step: float) -> Operator:
        """Return what a step of a length does."""
        return self._system.operator(self._scheme, step)

    def call(
        self, operator: Operator, moving: Moving, rows: tuple[int, int], loads: FloatArray, cam: FloatArray,
        found: FloatArray, sides: IntArray,
    ) -> tuple[int, int, int]:  # fmt: skip
        """March over some rows; return how it ended, the row reached and the iterations. The state moves along."""
        system, packed, count = self._system, self.packed, np.zeros(2, dtype=np.intp)
        local, tangent, moved, stiff, matrix = self._room
        ended = self._run(
            *rows, operator.scheme, operator.motions, system.coupled, operator.inverse, loads, moving.motion,
            packed.laws, packed.constants, packed.places, sides, system.sensing, system.acting, operator.give,
            operator.answering, self._watched, cam, moving.forces, local, tangent, moving.inner, moved, stiff, matrix,
            found, count,
        )  # fmt: skip
        return int(ended), int(count[0]), int(count[1])

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
        cam = march.packed.cam(to.schedule.row(to.row))
        found = np.empty((1, march.columns))
        loads = np.ascontiguousarray(to.load[None])
        ended, _, iterations = march.call(self._operator, moving, (0, 1), loads, cam, found, NO_SIDES)
        if ended == UNSETTLED:
            raise NoConvergenceError(march.unsettled())
        return replace(moving.moment(to.time), iterations=iterations)
