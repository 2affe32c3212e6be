"""Direct engine: time stepping for all methods and systems, with constant or adaptive steps.

An adaptive step is the given one, halved as often as the error requires. The error of a step is the difference of the
displacement from the Taylor series with a linear acceleration, ``d0 + h v0 + h^2 (a0/3 + a1/6)``: O. C. Zienkiewicz and
Y. M. Xie, Earthq. Eng. Struct. Dyn. 20 (1991). Halving preserves the output instants and needs one operator per step
length.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from itertools import pairwise

import numpy as np

from flexcam.core import FloatArray, IntArray
from flexcam.dynamics.blocks import Arrays, Series, flatten
from flexcam.dynamics.cam_motion import PrescribedInputs
from flexcam.dynamics.contact_events import EventStepper
from flexcam.dynamics.engine import (
    STOPPED,
    convergence_failure,
    in_range,
    inputs_at,
    instant,
    no_instants,
    stack_instant,
)
from flexcam.dynamics.initial_acceleration import InitialAcceleration
from flexcam.dynamics.integrator import At, Method, NoConvergenceError, Stepper
from flexcam.dynamics.local_forces import LocalForces
from flexcam.dynamics.problem import Adaptive, Problem
from flexcam.dynamics.status import Cause, RunFailedError, Stats, Status
from flexcam.dynamics.step_state import StepInputs, StepState, Trajectory
from flexcam.dynamics.system import System

Pilot = Callable[[Problem, Method], Series]
"""Function that returns the motion of the first revolution with the given steps, as the reference size of errors."""


_MAX_HALVINGS = 16
_DOUBLING_LIMIT = 1.0 / 16.0
"""Fraction of the tolerance below which the step is doubled: the error grows by 8, with a safety factor of 2."""


class EnergyNorm:
    """Energy norm of displacements, relative to the largest of a representative motion.

    The weights are the diagonals of the stiffness and, for unknowns without stiffness, of the mass at the frequency of
    the motion, so that the norm does not depend on units. `unseen` is the error not visible in displacements, see
    `Method`.
    """

    def __init__(self, system: System, motion: Series, unseen: float = 0.0) -> None:
        self._unseen = unseen
        stiff, mass = (np.abs(matrix.diagonal()) for matrix in (system.stiffness, system.mass))
        travel = motion.displacement - motion.displacement[:1]
        heavy, fast = (float((series**2 @ mass).max(initial=0.0)) for series in (travel, motion.velocity))
        self._weights = np.sqrt(stiff + mass * (fast / heavy if heavy > 0.0 else 0.0))
        self._size = float(np.linalg.norm(travel * self._weights, axis=1).max(initial=0.0))

    def error(self, moments: Sequence[StepState]) -> tuple[float, int]:
        """Return the largest relative error of successive steps, and the unknown with it."""
        defects = np.array([_taylor_defect(*pair, self._unseen) for pair in pairwise(moments)]) * self._weights
        sizes = np.linalg.norm(defects, axis=1)
        largest = int(np.argmax(sizes))
        return float(sizes[largest]) / self._size if self._size > 0.0 else 0.0, int(np.argmax(np.abs(defects[largest])))


def _taylor_defect(old: StepState, new: StepState, unseen: float) -> FloatArray:
    h = new.time - old.time  # zero across an impact
    defect = new.d - old.d - h * old.v - h**2 * (old.a / 3.0 + new.a / 6.0)
    return np.maximum(np.abs(defect), unseen * h**2 * np.abs(new.a - old.a)) if unseen else defect


class StepController:
    """Step size control on top of an `EventStepper`: the step of the problem is halved as the error requires."""

    def __init__(self, walker: EventStepper, at: At, problem: Problem, adaptive: Adaptive, norm: EnergyNorm) -> None:
        self._event_stepper, self._at, self._norm = walker, at, norm
        self._step, self._names, self._tolerance = problem.step, problem.system.names, adaptive.tolerance
        smallest = adaptive.smallest or problem.step / 2.0**_MAX_HALVINGS
        self._max_halvings = min(max(math.floor(math.log2(problem.step / smallest)), 0), _MAX_HALVINGS)
        self.halvings = 0  #: of the given step
        self.rejected = 0  #: steps repeated with half their length

    def walk(self, now: StepState, to: StepInputs) -> list[StepState]:
        """Return the instants after `now` up to `to`, one full step later.

        `RunFailedError` if the error is too large at the smallest step.
        """
        begin, total, done = now.time, 2**self._max_halvings, 0
        instants: list[StepState] = []
        while done < total:
            length = total >> self.halvings
            last = done + length == total
            inputs = to if last else self._at(begin + (done + length) / total * self._step)
            part, ratio = self._try_step(now, inputs, to)
            if not part:
                self.halvings += 1
                continue
            instants += part
            now, done = part[-1], done + length
            if ratio < _DOUBLING_LIMIT and self.halvings and done % (2 * length) == 0:
                self.halvings -= 1
        return instants

    def _try_step(self, now: StepState, inputs: StepInputs, to: StepInputs) -> tuple[list[StepState], float]:
        """Return a step and its error relative to the tolerance; no step if the error is too large."""
        events = self._event_stepper.events
        part = self._event_stepper.walk(now, inputs)
        error, unknown = self._norm.error([now, *part])
        ratio = error / self._tolerance
        if ratio <= 1.0:
            return part, ratio
        if self.halvings == self._max_halvings:
            text = (
                f"the error of {self._names[unknown]} stays at {ratio:.3g} times the tolerance with steps of "
                f"{self._step / 2.0**self._max_halvings:.3g} s {instant(to.time, to.angle)}"
            )
            remedy = "allow a larger run.adaptive.tolerance or a smaller smallest step"
            raise RunFailedError(Status(Cause.STEP_TOO_SMALL, text, remedy))
        self._event_stepper.events = events
        self.rejected += 1
        return [], ratio


class DirectEngine:
    """Time stepping with stops at events and adaptive steps.

    `stop` is called before every step; `pilot` runs the problem in advance for adaptive steps.
    """

    def __init__(
        self, problem: Problem, scheme: Method, forces: LocalForces, stop: Callable[[], bool], pilot: Pilot
    ) -> None:
        self._problem, self._system, self._forces, self._stop = problem, problem.system, forces, stop
        self._starter = InitialAcceleration(problem.system, forces)

        def stepper(length: float) -> Stepper:
            return scheme.stepper(problem.system, forces, length, self._at)

        self._event_stepper = EventStepper(
            problem.step, forces, self._starter, self._at, stepper, balances=scheme.is_collocated
        )
        self._control: StepController | None = None
        if problem.adaptive is not None and problem.system.size:
            norm = EnergyNorm(problem.system, pilot(problem, scheme), scheme.velocity_error)
            self._control = StepController(self._event_stepper, self._at, problem, problem.adaptive, norm)
        self._last: StepState | None = None
        self._iterations, self._substeps = 0, 0

    def advance(self, steps: IntArray) -> tuple[Trajectory, Status]:
        """Return the instants of some successive steps, see `Engine`."""
        times = self._problem.times(steps)
        motion = self._problem.drive.at(times)
        inputs = self._forces.prescribed_inputs(motion)
        before = None if self._last is None else stack_instant(self._last)
        instants, status = self._advance_steps(times, inputs, self._system.load_vector(motion))
        if not instants:
            return no_instants(self._system.size, self._forces), status
        self._iterations += sum(m.iterations for part in instants for m in part)
        self._substeps += sum(len(part) for part in instants)
        track, fault = in_range(Trajectory.of(instants, self._forces.contact_sides), before, self._system, motion.angle)
        return track, status if fault.ok else fault

    def _advance_steps(
        self, times: FloatArray, inputs: PrescribedInputs, loads: FloatArray
    ) -> tuple[list[list[StepState]], Status]:
        instants: list[list[StepState]] = []
        stepper, start = self._control or self._event_stepper, self._problem.initial_state
        for i, load in enumerate(loads):
            if self._stop():
                return instants, STOPPED
            to = StepInputs(float(times[i]), load, inputs, i)
            try:
                part = stepper.walk(self._last, to) if self._last else [self._starter.first(start, to)]
            except NoConvergenceError as fault:
                return instants, convergence_failure(fault.forces, to)
            except RunFailedError as fault:
                return instants, fault.status
            instants.append(part)
            self._last = part[-1]
        return instants, Status()

    def statistics(self, stats: Stats) -> Stats:
        """Return the statistics with the counts of this engine."""
        stats = replace(stats, iterations=self._iterations, events=self._event_stepper.events)
        return replace(stats, substeps=self._substeps, rejected=self._control.rejected) if self._control else stats

    def state(self) -> Arrays:
        """Return the last instant, the step size state and the counts, see `Engine`."""
        control = (self._control.halvings, self._control.rejected) if self._control else (0, 0)
        counts = np.array([self._iterations, self._substeps, self._event_stepper.events, *control])
        return {**flatten("last", self._last), "counts": counts}

    def restore(self, state: Arrays) -> None:
        """Restore the state, see `Engine`."""
        self._last = StepState.from_checkpoint("last", state)
        self._iterations, self._substeps, self._event_stepper.events, *control = state["counts"].tolist()
        if self._control:
            self._control.halvings, self._control.rejected = control

    def _at(self, time: float) -> StepInputs:
        return inputs_at(self._problem, self._forces, time)
