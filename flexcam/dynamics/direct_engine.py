"""Direct engine: time stepping for all methods and systems."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from flexcam.core import FloatArray, IntArray
from flexcam.dynamics.adaptive import EnergyNorm, StepController, StepFloorError
from flexcam.dynamics.blocks import Arrays, Series, flatten
from flexcam.dynamics.cam_motion import PrescribedInputs
from flexcam.dynamics.contact_events import EventStepper
from flexcam.dynamics.engine import STOPPED, convergence_failure, in_range, instant, no_instants, stack_instant
from flexcam.dynamics.implicit_step import NoConvergenceError
from flexcam.dynamics.initial_acceleration import InitialAcceleration
from flexcam.dynamics.integrator import Method, Stepper
from flexcam.dynamics.local_forces import LocalForces
from flexcam.dynamics.problem import Problem, State
from flexcam.dynamics.status import Cause, Stats, Status
from flexcam.dynamics.step_state import StepInputs, StepState, Trajectory
from flexcam.dynamics.system import System

Pilot = Callable[[Problem, Method], Series]
"""Function that returns the motion of the first revolution with the given steps, as the reference size of errors."""


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

        self._walker = EventStepper(
            problem.step, forces, self._starter, self._at, stepper, balances=scheme.is_collocated
        )
        self._pace = self._create_stepper(problem, scheme, pilot)
        self._last: StepState | None = None
        self._iterations, self._substeps = 0, 0

    def advance(self, steps: IntArray) -> tuple[Trajectory, Status]:
        """Return the instants of some successive steps, see `Engine`."""
        at = self._problem.times(steps)
        motion = self._problem.drive.at(at)
        schedule = self._forces.prescribed_inputs(motion)
        before = None if self._last is None else stack_instant(self._last)
        walked, status = self._advance_steps(at, motion.angle, schedule, self._system.load_vector(motion))
        if not walked:
            return no_instants(self._system.size, self._forces), status
        self._iterations += sum(m.iterations for part in walked for m in part)
        self._substeps += sum(len(part) for part in walked)
        track, left = in_range(Trajectory.of(walked, self._forces.switching), before, self._system, motion.angle)
        return track, status if left.ok else left

    def _advance_steps(
        self, at: FloatArray, angle: FloatArray, schedule: PrescribedInputs, loads: FloatArray
    ) -> tuple[list[list[StepState]], Status]:
        """Return the instants per step: events, and the end of the step last."""
        walked: list[list[StepState]] = []
        walker = self._pace or self._walker
        start = self._problem.start or State.rest(self._system.size)
        for i, load in enumerate(loads):
            if self._stop():
                return walked, STOPPED
            to = StepInputs(float(at[i]), load, schedule, i)
            try:
                part = walker.walk(self._last, to) if self._last else [self._starter.first(start, to)]
            except NoConvergenceError as fault:
                return walked, convergence_failure(fault.forces, float(at[i]), float(angle[i]))
            except StepFloorError as fault:
                return walked, _step_floor_status(fault, self._system, float(at[i]), float(angle[i]))
            walked.append(part)
            self._last = part[-1]
        return walked, Status()

    def statistics(self, stats: Stats) -> Stats:
        """Return the statistics with the counts of this engine."""
        stats = replace(stats, iterations=self._iterations, events=self._walker.events)
        return replace(stats, substeps=self._substeps, rejected=self._pace.rejected) if self._pace else stats

    def state(self) -> Arrays:
        """Return the last instant, the step size state and the counts, see `Engine`."""
        paced = (self._pace.halvings, self._pace.rejected) if self._pace else (0, 0)
        counts = np.array([self._iterations, self._substeps, self._walker.events, *paced])
        return {**flatten("last", self._last), "counts": counts}

    def restore(self, state: Arrays) -> None:
        """Restore the state, see `Engine`."""
        self._last = StepState.from_checkpoint("last", state)
        self._iterations, self._substeps, self._walker.events, *paced = state["counts"].tolist()
        if self._pace:
            self._pace.halvings, self._pace.rejected = paced

    def _at(self, time: float) -> StepInputs:
        motion = self._problem.drive.at(np.array([time]))
        return StepInputs(time, self._system.load_vector(motion)[0], self._forces.prescribed_inputs(motion))

    def _create_stepper(self, problem: Problem, scheme: Method, pilot: Pilot) -> StepController | None:
        if problem.adaptive is None or not problem.system.size:
            return None
        norm = EnergyNorm(problem.system, pilot(problem, scheme), scheme.velocity_error)
        return StepController(self._walker, self._at, problem.step, problem.adaptive, norm)


def _step_floor_status(fault: StepFloorError, system: System, at: float, angle: float) -> Status:
    text = (
        f"the error of {system.names[fault.unknown]} stays at {fault.times:.3g} times the tolerance with steps of "
        f"{fault.step:.3g} s {instant(at, angle)}"
    )
    return Status(Cause.STEP_TOO_SMALL, text, "allow a larger run.adaptive.tolerance or a smaller smallest step")
