"""The kernel engine: a system in modal coordinates with local forces, stepped by compiled code.

Steps without impact run in the kernel. A step in which a contact with restitution touches down, or whose local
forces do not converge, is taken by `EventStepper` with kernel steps of any length.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from functools import partial

import numpy as np
from numpy.typing import NDArray

from flexcam.core import FloatArray, IntArray
from flexcam.dynamics.blocks import Arrays, flatten
from flexcam.dynamics.cam_motion import CamFunctionCache, PrescribedInputs
from flexcam.dynamics.collocation import Collocation
from flexcam.dynamics.contact_events import EventStepper
from flexcam.dynamics.engine import STOPPED, convergence_failure, in_range, inputs_at, no_instants, stack_instant
from flexcam.dynamics.generalized_alpha import Scheme
from flexcam.dynamics.initial_acceleration import InitialAcceleration
from flexcam.dynamics.integrator import At, NoConvergenceError
from flexcam.dynamics.kernel import TOO_LONG, UNSETTLED
from flexcam.dynamics.kernel_step import Kernel
from flexcam.dynamics.local_forces import LocalForces
from flexcam.dynamics.problem import Problem
from flexcam.dynamics.status import Cause, Stats, Status
from flexcam.dynamics.step_state import StepInputs, StepState, Trajectory

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
_MOST_DIVISIONS = 64
"""Parts of a step up to which the collocation divides it."""
_TOO_STIFF = Status(
    Cause.NO_CONVERGENCE,
    f"contacts are too stiff for the collocation, even in 1/{_MOST_DIVISIONS} of a step",
    'use more steps per revolution, a softer contact, or integrator = { method = "newmark" }',
)
"""Status of a run whose steps must be divided."""


class KernelStepper:
    """A single step of the kernel of any length, for `flexcam.dynamics.contact_events`."""

    def __init__(self, kernel: Kernel, at: At, step: float) -> None:
        # Trials before an impact press the contact deeper than it will be: they are not divided for its stiffness.
        self._operator = replace(kernel.operator(step / kernel.stages), hold=np.zeros((0, 0)))
        self._kernel, self._at = kernel, at

    def advance(self, now: StepState, to: StepInputs) -> StepState:
        """Return the next instant."""
        kernel, state = self._kernel, self._kernel.state(now)
        loads, inputs = to.load[None], to.inputs.row(to.row)
        if kernel.stages > 1:
            middle = self._at(0.5 * (now.time + to.time))
            loads, inputs = np.vstack([middle.load, loads]), middle.inputs.row(middle.row).followed_by(inputs)
        input_rows, results = kernel.given(loads, inputs), np.empty((kernel.stages, kernel.columns))
        ending, _, iterations = kernel.advance(self._operator, state, (0, 1), input_rows, results)
        if ending == UNSETTLED:
            raise NoConvergenceError(kernel.unconverged_forces())
        new = replace(kernel.moment(state, to.time), iterations=iterations)
        if kernel.stages > 1 and self._operator.lengths[0] > kernel.shortest and kernel.touches_between(now, new):
            raise NoConvergenceError([])  # the step is halved: its end does not show the contact
        return new


class KernelEngine:
    """Advances a problem in modal coordinates by compiled code; `stop` is called before every block of steps."""

    def __init__(
        self, problem: Problem, scheme: Scheme | Collocation, forces: LocalForces, stop: Callable[[], bool]
    ) -> None:
        self._problem, self._system, self._forces, self._stop = problem, problem.system, forces, stop
        self._kernel = Kernel(problem, scheme, forces)
        self._starter = InitialAcceleration(problem.system, forces)
        self._balances, self._division, self._divisions_done = scheme.is_collocated, 1, 0
        self._single_steps = self._event_stepper()
        self._last: StepState | None = None
        self._inputs: FloatArray | None = None  # prescribed inputs of the last instant, as a row of the kernel
        self._span = math.inf, math.inf
        self._nodes: FloatArray | None = None
        self._iterations, self._at_middle = 0, False

    def advance(self, steps: IntArray) -> tuple[Trajectory, Status]:
        """Return the instants of some successive steps, see `Engine`."""
        if self._stop():
            return no_instants(self._system.size, self._forces), STOPPED
        rows = np.append(steps[0] - 1, steps) if self._at_middle else steps
        remainder = (len(rows) - (self._last is None)) % self._kernel.stages if steps[-1] < self._problem.steps else 0
        remainder = 0 if self._division > 1 else remainder  # a divided step ends with a step of the kernel
        parts, status = list[Trajectory](), Status()
        if len(rows) > remainder:
            track, status = self._advance_rows(rows[: len(rows) - remainder])
            parts.append(track.steps(1) if self._at_middle else track)
            self._at_middle = False
        if remainder and status.ok:
            middle, status = self._advance_to_middle(rows[-1:])
            parts.append(middle)
        return Trajectory.concatenate(parts) if len(parts) > 1 else parts[0], status

    def _advance_to_middle(self, step: IntArray) -> tuple[Trajectory, Status]:
        """Return the first of the two instants of a collocation step; the next call takes the step again.

        The results then do not depend on the number of steps between two calls.
        """
        saved = self._last, self._inputs, self._iterations, self._single_steps.events
        track, status = self._advance_rows(np.append(step, step + 1))
        self._last, self._inputs, self._iterations, self._single_steps.events = saved
        self._at_middle = len(track.ends) > 0
        return track.steps(0, int(self._at_middle)), Status() if self._at_middle else status

    def _advance_rows(self, steps: IntArray) -> tuple[Trajectory, Status]:
        """Advance by some steps, and divide them from the first one on in which contacts are too stiff for it."""
        parts, done = list[Trajectory](), 0
        while True:
            part, status = self._advance_divisions(steps[done:])
            parts.append(part)
            done += len(part.ends)
            if status is not _TOO_STIFF or self._division == _MOST_DIVISIONS:
                track = Trajectory.concatenate(parts) if len(parts) > 1 else part
                return (track if status.ok else track.steps(0, len(track.ends))), status
            self._division, self._divisions_done = 2 * self._division, 2 * self._divisions_done
            self._kernel.shorten(self._problem.step / self._division)
            self._single_steps = self._event_stepper(self._single_steps.events)

    def _advance_divisions(self, steps: IntArray) -> tuple[Trajectory, Status]:
        """Advance by some steps, the first of which has begun already, in divisions of equal length."""
        division = self._division
        if division == 1:
            times, ends = self._problem.times(steps), np.ones(len(steps), dtype=bool)
        else:
            fraction = np.arange(1, division + 1) - division
            times = (self._problem.times(steps)[:, None] + self._problem.step / division * fraction).ravel()
            ends = np.tile(fraction == 0, len(steps))
            skipped = division - 1 if self._last is None else self._divisions_done
            times, ends = times[skipped:], ends[skipped:]
        loads, inputs = self._prescribed(times)
        before = None if self._last is None else stack_instant(self._last)
        track, status = self._advance(times, loads, inputs)
        count = len(track.ends)
        complete = np.flatnonzero(ends[:count])
        self._divisions_done = count - 1 - int(complete[-1]) if len(complete) else self._divisions_done + count
        track = replace(track, ends=track.ends[ends[:count]])
        if not len(track.ends):
            return track, status
        valid, divergence = in_range(track, before, self._system, inputs.angle[ends])
        return valid, status if divergence.ok else divergence

    def _advance(self, times: FloatArray, loads: FloatArray, inputs: PrescribedInputs) -> tuple[Trajectory, Status]:
        """Advance by the kernel, and by single steps where it stops."""
        kernel, rows = self._kernel, np.empty((len(times), self._kernel.columns))
        single_steps: dict[int, list[StepState]] = {}
        pressed = np.empty((len(times), len(self._forces.switching)), dtype=bool)
        row, status = 0, Status()
        if self._last is None:
            to = StepInputs(float(times[0]), loads[0], inputs, 0)
            self._last, row = self._starter.first(self._problem.initial_state, to), 1
            rows[0] = _row(self._last)
            self._inputs = kernel.instant(loads, inputs, 0)
        state, sides = kernel.state(self._last), self._sides(self._last)
        pressed[:] = sides[1]
        first, input_rows = row, kernel.given(loads[row:], inputs.at(slice(row, None)) if row else inputs)
        while row < len(times) and status.ok:
            done = (row - first) // kernel.stages
            ending, step, iterations = kernel.advance(
                kernel.whole, state, (done, len(input_rows)), input_rows, rows[first:], sides, self._inputs
            )
            row, self._iterations = first + kernel.stages * step, self._iterations + iterations
            if ending == TOO_LONG:
                status = _TOO_STIFF
                break
            for _ in range(min(kernel.stages, len(times) - row)):
                to = StepInputs(float(times[row]), loads[row], inputs, row)
                now = kernel.moment(state, float(times[row - 1]) if row else self._last.time, sides[1] > 0)
                try:
                    moments = self._single_steps.walk(now, to)
                except NoConvergenceError as fault:
                    status = convergence_failure(fault.forces, to)
                    break
                self._iterations += sum(moment.iterations for moment in moments)
                single_steps[row] = moments
                rows[row], row = _row(moments[-1]), row + 1
                state, sides = kernel.state(moments[-1]), self._sides(moments[-1])
                pressed[row:] = sides[1]
        if row:
            self._last = kernel.moment(state, float(times[row - 1]), sides[1] > 0)
            self._inputs = kernel.instant(loads, inputs, row - 1)
        return self._track(times[:row], rows[:row], pressed[:row], single_steps, inputs), status

    def _track(
        self, time: FloatArray, rows: FloatArray, pressed: NDArray[np.bool_], single_steps: dict[int, list[StepState]],
        inputs: PrescribedInputs,
    ) -> Trajectory:  # fmt: skip
        """Return the kernel rows merged with the instants within single steps."""
        n, c = self._system.size, self._forces.count
        d, v, a, force, inner = np.split(rows, [n, 2 * n, 3 * n, 3 * n + c], axis=1)
        no_impulse, indices = np.zeros((len(time), c)), np.arange(len(time))
        track = Trajectory(time, d, v, a, force, inner, no_impulse, pressed, indices, inputs.cam)
        if all(len(moments) == 1 and moments[0].impulse is None for moments in single_steps.values()):
            return track if len(time) == len(inputs.angle) else replace(track, cam=None)
        parts, first = list[Trajectory](), 0
        for row, moments in single_steps.items():
            parts += [track.steps(first, row), Trajectory.of([moments], self._forces.contact_sides)]
            first = row + 1
        return Trajectory.concatenate([*parts, track.steps(first)])

    def statistics(self, stats: Stats) -> Stats:
        """Return the statistics with the counts of this engine."""
        method = "collocation" if self._kernel.stages == 2 else ""
        return replace(stats, iterations=self._iterations, events=self._single_steps.events, integrator=method)

    def state(self) -> Arrays:
        """Return the last instant and the counts, see `Engine`."""
        return {
            **flatten("last", self._last),
            **flatten("inputs", self._inputs),
            "counts": np.array([self._iterations, self._single_steps.events, self._at_middle]),
            "division": np.array(self._division),
        }

    def restore(self, state: Arrays) -> None:
        """Restore the state, see `Engine`."""
        self._last, self._inputs = StepState.from_checkpoint("last", state), state.get("inputs")
        self._iterations, events, at_middle = state["counts"].tolist()
        self._at_middle, self._division = bool(at_middle), int(state["division"])
        self._kernel.shorten(self._problem.step / self._division)
        self._single_steps = self._event_stepper(events)

    def _sides(self, moment: StepState) -> IntArray:
        """Return the switching scalars, and which of them count as pressed."""
        return np.array([self._forces.switching, moment.sides(self._forces.contact_sides)], dtype=np.intp)

    def _at(self, time: float) -> StepInputs:
        """Return the prescribed inputs of an instant, by the polynomial through the Chebyshev points of its step.

        The functions of the cam angle are then evaluated once per step with events instead of once per trial of a time.
        In a step with a kink of a function no polynomial fits, and the functions themselves are evaluated.
        """
        begin, end = self._span
        if not begin <= time < end:
            step, start = self._problem.step, self._problem.initial_state.time
            begin = start + step * math.floor((time - start) / step)
            end = max(begin + step, time)
            self._span, self._nodes = (begin, end), self._fit(begin, end)
        if self._nodes is None:
            return inputs_at(self._problem, self._forces, time)
        phase = math.acos(min(max(2.0 * (time - begin) / (end - begin) - 1.0, -1.0), 1.0))
        row, n = np.cos(_ORDERS * phase) @ self._nodes, self._system.size
        angle, sense, act = row[n : n + 1], self._forces.sense.owner, self._forces.act.owner
        inputs = PrescribedInputs(angle, row[None, n + 1 :], sense, act, CamFunctionCache(angle))
        return StepInputs(time, row[:n], inputs)

    def _fit(self, begin: float, end: float) -> FloatArray | None:
        """Return the coefficients of the prescribed inputs within a step; None if no polynomial fits them."""
        loads, inputs = self._prescribed(begin + 0.5 * (end - begin) * (1.0 + np.append(_NODES, _BETWEEN)))
        rows = np.column_stack([loads, inputs.angle, inputs.rows])
        coefficients = _FIT @ rows[: len(_NODES)]
        errors = np.abs(_CHECK @ coefficients - rows[len(_NODES) :]).max(axis=0)
        return coefficients if (errors <= _FITTED * np.abs(rows).max(axis=0)).all() else None

    def _prescribed(self, times: FloatArray) -> tuple[FloatArray, PrescribedInputs]:
        motion = self._problem.drive.at(times)
        return self._system.load_vector(motion), self._forces.prescribed_inputs(motion)

    def _event_stepper(self, events: int = 0) -> EventStepper:
        step = self._problem.step / self._division
        steppers = partial(KernelStepper, self._kernel, self._at)
        stepper = EventStepper(step, self._forces, self._starter, self._at, steppers, balances=self._balances)
        stepper.events = events
        return stepper


def _row(moment: StepState) -> FloatArray:
    return np.concatenate([stack_instant(moment), moment.inner])
