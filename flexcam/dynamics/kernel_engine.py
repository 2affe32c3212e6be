"""The kernel engine: a system in modal coordinates with local forces, stepped by compiled code.

Steps without impact run in the kernel. A step in which a contact with restitution touches down, or whose local
forces do not converge, is taken by `EventStepper` with kernel steps of any length.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from flexcam.core import FloatArray, IntArray
from flexcam.dynamics.blocks import Arrays, flatten
from flexcam.dynamics.cam_motion import CamFunctionCache, PrescribedInputs
from flexcam.dynamics.contact_events import EventStepper
from flexcam.dynamics.engine import STOPPED, convergence_failure, in_range, stack_instant
from flexcam.dynamics.force_laws import OWN, STATE, STATE_ROWS
from flexcam.dynamics.generalized_alpha import Scheme
from flexcam.dynamics.implicit_step import NoConvergenceError, unconverged_forces
from flexcam.dynamics.initial_acceleration import InitialAcceleration
from flexcam.dynamics.jit import Functions, compile_functions
from flexcam.dynamics.kernel import (
    DONE,
    FORCE_SIZE,
    FUNCTIONS_OF_KERNEL,
    INVERSE,
    OPERATOR_SIZE,
    STATE_SIZE,
    UNSETTLED,
)
from flexcam.dynamics.local_forces import LocalForces, Workspace
from flexcam.dynamics.problem import Problem, State
from flexcam.dynamics.status import Stats, Status
from flexcam.dynamics.step_state import StepInputs, StepState, Trajectory
from flexcam.dynamics.system import System

_NONE = np.zeros((0, 0))
_ORDERS = np.arange(10.0)
_NODES = np.cos(np.pi * (_ORDERS + 0.5) / len(_ORDERS))
_FIT: FloatArray = np.linalg.inv(np.cos(np.outer(np.arccos(_NODES), _ORDERS))).astype(np.float64)
_BETWEEN = np.cos(np.pi * np.append(_ORDERS, len(_ORDERS)) / len(_ORDERS))
_CHECK = np.cos(np.outer(np.arccos(_BETWEEN), _ORDERS))
"""Orders and points of the Chebyshev polynomials within a step, their coefficients by the values there, and the points
between.

L. N. Trefethen, Approximation Theory and Approximation Practice (2013), ch. 2 and 3.
"""
_FITTED = 1e-12
"""Largest error of the polynomials at the points between, as a fraction of the largest value."""
_NO_SIDES = np.zeros((2, 0), dtype=np.intp)


def compiled_functions() -> Functions:
    """Return the compiled functions of the kernel."""
    return compile_functions(FUNCTIONS_OF_KERNEL, ("evaluate_laws", "evaluate_rows", "march"))


@dataclass(frozen=True, eq=False)
class StepOperator:
    """A step of one length, as arrays of the kernel: scheme (5,), operator, response of the scalars, and inverse."""

    scheme: FloatArray
    operator: FloatArray
    give: FloatArray
    inverse: FloatArray


@dataclass(frozen=True, eq=False)
class ModalSystem:
    """A system in modal coordinates as arrays of the kernel.

    Parameters
    ----------
    modes
        Mass, damping and stiffness, shape (3, n).
    coupled
        Damping off its diagonal, shape (n, n); empty where there is none.
    vectors
        Sensing vectors and then acting ones, shape (senses + acts, n).
    senses
        Number of sensing vectors.
    """

    modes: FloatArray
    coupled: FloatArray
    vectors: FloatArray
    senses: int

    @classmethod
    def of(cls, system: System, forces: LocalForces) -> ModalSystem:
        """Return those of a system whose mass and stiffness are diagonal."""
        own = system.damping.diagonal()
        beside = system.damping.dense() - np.diag(own)
        modes = np.array([system.mass.diagonal(), own, system.stiffness.diagonal()])
        vectors = np.vstack([forces.sense.vectors, forces.act.vectors])
        return cls(modes, beside if beside.any() else _NONE, vectors, len(forces.sense.vectors))

    def operator(self, scheme: Scheme, step: float) -> StepOperator:
        """Return the step of a scheme."""
        new = 1.0 - scheme.alpha_f
        mass, damping, stiffness = self.modes
        whole = scheme.effective_mass(mass, damping, stiffness, step)
        sensing, acting = self.vectors[: self.senses], self.vectors[self.senses :]
        single, inverse = np.zeros_like(whole), _NONE
        if len(self.coupled):
            inverse = np.linalg.inv(np.diag(whole) + new * scheme.gamma * step * self.coupled).astype(np.float64)
            answering = new * acting @ inverse.T
        else:
            single = 1.0 / whole
            answering = new * acting * single
        weights = np.array([step, scheme.beta, scheme.gamma, scheme.alpha_m, scheme.alpha_f])
        operator = np.empty((OPERATOR_SIZE + len(acting), len(single)))
        operator[:INVERSE], operator[INVERSE], operator[OPERATOR_SIZE:] = self.modes, single, answering
        return StepOperator(weights, operator, answering @ sensing.T, inverse)


@dataclass(frozen=True, eq=False)
class KernelState:
    """An instant as arrays that the kernel advances: modes (10, n), local forces (5, c) and internal states (6, s)."""

    modes: FloatArray
    forces: FloatArray
    states: FloatArray

    @classmethod
    def of(cls, moment: StepState) -> KernelState:
        """Return a copy of an instant."""
        modes, forces = np.zeros((STATE_SIZE, len(moment.d))), np.zeros((FORCE_SIZE, len(moment.penetration)))
        modes[:4] = moment.d, moment.v, moment.a, moment.applied
        forces[:3] = moment.local, moment.penetration, moment.rate
        states = np.zeros((STATE_ROWS, len(moment.inner)))
        states[STATE] = moment.inner
        return cls(modes, forces, states)

    def moment(self, time: float, pressed: NDArray[np.bool_] | None = None) -> StepState:
        """Return the instant; its arrays are its own."""
        (d, v, a, applied), (local, penetration, rate) = self.modes[:4].copy(), self.forces[:3].copy()
        return StepState(time, d, v, a, applied, local, penetration, rate, self.states[STATE].copy(), pressed)


class Kernel:
    """The compiled step of one system.

    Parameters
    ----------
    problem
        Problem in modal coordinates with all laws as data.
    scheme
        Of the time integration.
    forces
        The local forces, stacked.
    """

    def __init__(self, problem: Problem, scheme: Scheme, forces: LocalForces) -> None:
        self._march, self._scheme, self.forces = compiled_functions()["march"], scheme, forces
        self._system = ModalSystem.of(problem.system, forces)
        self.columns = 3 * problem.system.size + forces.count + len(forces.start_state)
        self._work, self._varying = Workspace(forces.table, forces.count, self._system.senses), forces.varying
        self._length = 0.0

    def operator(self, step: float) -> StepOperator:
        """Return a step of a length, s."""
        return self._system.operator(self._scheme, step)

    def given(self, loads: FloatArray, schedule: PrescribedInputs) -> FloatArray:
        """Return the prescribed inputs of some steps side by side: loads and those of the local forces."""
        return np.hstack([loads, schedule.rows])

    def advance(
        self, operator: StepOperator, state: KernelState, rows: tuple[int, int], given: FloatArray, found: FloatArray,
        sides: IntArray = _NO_SIDES,
    ) -> tuple[int, int, int]:  # fmt: skip
        """Step over some rows; return how it ended, the row reached and the iterations. The state advances."""
        system, table, count = self._system, self.forces.table, np.zeros(2, dtype=np.intp)
        work = self._work
        if operator.scheme[0] != self._length:  # the compliance belongs to the length of a step
            work.compliance[:], work.local[OWN], self._length = np.nan, -1.0, float(operator.scheme[0])
        how = self._march(
            *rows, operator.scheme, operator.operator, operator.give, operator.inverse, system.coupled, system.vectors,
            given, table.laws, table.constants, self.forces.places, table.owners, self._varying, state.modes,
            state.forces, state.states, work.local, work.tangent, work.moved, work.active, work.compliance,
            work.matrix, sides, found, count,
        )  # fmt: skip
        row, iterations = count.tolist()
        return int(how), row, iterations

    def unconverged_forces(self) -> list[str]:
        """Return the names of the forces that did not converge in the last call."""
        return unconverged_forces(self.forces.names, self._work.local)


class KernelStepper:
    """A single step of the kernel of any length, for `flexcam.dynamics.contact_events`."""

    def __init__(self, kernel: Kernel, step: float) -> None:
        self._kernel, self._operator = kernel, kernel.operator(step)

    def advance(self, now: StepState, to: StepInputs) -> StepState:
        """Return the next instant."""
        kernel, state = self._kernel, KernelState.of(now)
        given = kernel.given(to.load[None], to.schedule.row(to.row))
        how, _, iterations = kernel.advance(self._operator, state, (0, 1), given, np.empty((1, kernel.columns)))
        if how == UNSETTLED:
            raise NoConvergenceError(kernel.unconverged_forces())
        return replace(state.moment(to.time), iterations=iterations)


class KernelEngine:
    """Advances a problem in modal coordinates by compiled code.

    Parameters
    ----------
    problem
        In modal coordinates.
    scheme
        Of the generalized-alpha family.
    forces
        Its local forces, stacked.
    stop
        Stop callback, called before every block of steps.
    """

    def __init__(self, problem: Problem, scheme: Scheme, forces: LocalForces, stop: Callable[[], bool]) -> None:
        self._problem, self._system, self._forces, self._stop = problem, problem.system, forces, stop
        self._kernel = Kernel(problem, scheme, forces)
        self._whole = self._kernel.operator(problem.step)
        self._starter = InitialAcceleration(problem.system, forces)
        self._walker = EventStepper(
            problem.step, forces, self._starter, self._at, self._stepper, balances=scheme.is_collocated
        )
        self._last: StepState | None = None
        self._span = math.inf, math.inf
        self._nodes: FloatArray | None = None
        self._iterations = 0

    def advance(self, steps: IntArray) -> tuple[Trajectory, Status]:
        """Return the instants of some successive steps, see `Engine`."""
        if self._stop():
            return Trajectory.empty(self._system.size, self._forces), STOPPED
        at = self._problem.times(steps)
        loads, schedule = self._prescribed(at)
        before = None if self._last is None else stack_instant(self._last)
        track, status = self._advance(at, loads, schedule)
        if not len(track.ends):
            return track, status
        kept, left = in_range(track, before, self._system, schedule.angle)
        return kept, status if left.ok else left

    def _advance(self, at: FloatArray, loads: FloatArray, schedule: PrescribedInputs) -> tuple[Trajectory, Status]:
        """Advance by the kernel, and by single steps where it stops."""
        found, given = np.empty((len(at), self._kernel.columns)), self._kernel.given(loads, schedule)
        stepped: dict[int, list[StepState]] = {}
        pressed = np.empty((len(at), len(self._forces.switching)), dtype=bool)
        row, status = 0, Status()
        if self._last is None:
            to = StepInputs(float(at[0]), loads[0], schedule, 0)
            self._last, row = self._starter.first(self._problem.start or State.rest(self._system.size), to), 1
            found[0] = _row(self._last)
        state, sides = KernelState.of(self._last), self._sides(self._last)
        pressed[:] = sides[1]
        while row < len(at):
            how, row, iterations = self._kernel.advance(self._whole, state, (row, len(at)), given, found, sides)
            self._iterations += iterations
            if how == DONE:
                break
            to = StepInputs(float(at[row]), loads[row], schedule, row)
            now = state.moment(float(at[row - 1]) if row else self._last.time, sides[1] > 0)
            try:
                moments = self._walker.walk(now, to)
            except NoConvergenceError as fault:
                status = convergence_failure(fault.forces, to.time, to.angle)
                break
            self._iterations += sum(moment.iterations for moment in moments)
            stepped[row] = moments
            found[row], row = _row(moments[-1]), row + 1
            state, sides = KernelState.of(moments[-1]), self._sides(moments[-1])
            pressed[row:] = sides[1]
        if row:
            self._last = state.moment(float(at[row - 1]), sides[1] > 0)
        return self._track(at[:row], found[:row], pressed[:row], stepped, schedule), status

    def _track(
        self, time: FloatArray, found: FloatArray, pressed: NDArray[np.bool_], stepped: dict[int, list[StepState]],
        schedule: PrescribedInputs,
    ) -> Trajectory:  # fmt: skip
        """Return the kernel rows merged with the instants within single steps."""
        n, c = self._system.size, self._forces.count
        d, v, a, force, inner = np.split(found, [n, 2 * n, 3 * n, 3 * n + c], axis=1)
        none, each = np.zeros((len(time), c)), np.arange(len(time))
        plain = Trajectory(time, d, v, a, force, inner, none, pressed, each, schedule.cam)
        if all(len(moments) == 1 and moments[0].impulse is None for moments in stepped.values()):
            return plain if len(time) == len(schedule.angle) else replace(plain, cam=None)
        parts, first = list[Trajectory](), 0
        for row, moments in stepped.items():
            parts += [plain.between(first, row), Trajectory.of([moments], self._forces)]
            first = row + 1
        return Trajectory.concatenate([*parts, plain.between(first, len(time))])

    def statistics(self, stats: Stats) -> Stats:
        """Return the statistics with the counts of this engine."""
        return replace(stats, iterations=self._iterations, events=self._walker.events)

    def state(self) -> Arrays:
        """Return the last instant and the counts, see `Engine`."""
        return {**flatten("last", self._last), "counts": np.array([self._iterations, self._walker.events])}

    def restore(self, state: Arrays) -> None:
        """Restore the state, see `Engine`."""
        self._last = StepState.from_checkpoint("last", state)
        self._iterations, self._walker.events = state["counts"].tolist()

    def _sides(self, moment: StepState) -> IntArray:
        """Return the switching scalars, and which of them count as pressed."""
        pressed = self._forces.contact_sides(moment.penetration) if moment.pressed is None else moment.pressed
        return np.array([self._forces.switching, pressed], dtype=np.intp)

    def _at(self, time: float) -> StepInputs:
        """Return the prescribed inputs of an instant, by the polynomial through the Chebyshev points of its step.

        The functions of the cam angle are then evaluated once per step with events instead of once per trial of a time.
        In a step with a kink of a function no polynomial fits, and the functions themselves are evaluated.
        """
        begin, end = self._span
        if not begin <= time < end:
            step, start = self._problem.step, float(self._problem.times(np.zeros(1, dtype=np.intp))[0])
            begin = start + step * math.floor((time - start) / step)
            end = max(begin + step, time)
            self._span, self._nodes = (begin, end), self._fit(begin, end)
        if self._nodes is None:
            loads, schedule = self._prescribed(np.array([time]))
            return StepInputs(time, loads[0], schedule)
        phase = math.acos(min(max(2.0 * (time - begin) / (end - begin) - 1.0, -1.0), 1.0))
        row, n = np.cos(_ORDERS * phase) @ self._nodes, self._system.size
        angle, sense, act = row[n : n + 1], self._forces.sense.owner, self._forces.act.owner
        inputs = PrescribedInputs(angle, row[None, n + 1 :], sense, act, CamFunctionCache(angle))
        return StepInputs(time, row[:n], inputs)

    def _fit(self, begin: float, end: float) -> FloatArray | None:
        """Return the coefficients of the prescribed inputs within a step; None if no polynomial fits them."""
        loads, schedule = self._prescribed(begin + 0.5 * (end - begin) * (1.0 + np.append(_NODES, _BETWEEN)))
        rows = np.column_stack([loads, schedule.angle, schedule.rows])
        found = _FIT @ rows[: len(_NODES)]
        missed = np.abs(_CHECK @ found - rows[len(_NODES) :]).max(axis=0)
        return found if (missed <= _FITTED * np.abs(rows).max(axis=0)).all() else None

    def _prescribed(self, times: FloatArray) -> tuple[FloatArray, PrescribedInputs]:
        motion = self._problem.drive.at(times)
        return self._system.load_vector(motion), self._forces.prescribed_inputs(motion)

    def _stepper(self, step: float) -> KernelStepper:
        return KernelStepper(self._kernel, step)


def _row(moment: StepState) -> FloatArray:
    """Return a row of results of an instant."""
    return np.concatenate([stack_instant(moment), moment.inner])
