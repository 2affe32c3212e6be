"""Interface of a time-integration engine, and the engine of a system without equations to integrate."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Protocol

import numpy as np

from flexcam.core import FloatArray, IntArray
from flexcam.dynamics.blocks import Arrays
from flexcam.dynamics.cam_motion import CamMotion
from flexcam.dynamics.force_laws import FIRST
from flexcam.dynamics.initial_acceleration import InitialAcceleration
from flexcam.dynamics.local_forces import LocalForces
from flexcam.dynamics.problem import Problem
from flexcam.dynamics.status import Cause, RunFailedError, Stats, Status
from flexcam.dynamics.step_state import StepInputs, StepState, Trajectory
from flexcam.dynamics.system import PrescribedMotion, System


class Engine(Protocol):
    """Engine that advances a problem from its start; by default without counts and state."""

    def advance(self, steps: IntArray) -> tuple[Trajectory, Status]:
        """Return the instants of successive steps, and the status."""
        ...

    def statistics(self, stats: Stats) -> Stats:
        """Return the statistics with the counts of the engine."""
        return stats

    def state(self) -> Arrays:
        """Return the state for resuming that is not part of the problem, and the counts."""
        return {}

    def restore(self, state: Arrays) -> None:
        """Restore a state, in this process or another one."""


_BLOCK, _VALUES = 500, 1_000_000
"""Largest number of steps whose instants are in memory together, and of these times unknowns."""


def inputs_at(problem: Problem, forces: LocalForces, time: float) -> StepInputs:
    """Return the prescribed inputs of a problem at a time, s."""
    motion = problem.drive.at(np.array([time]))
    return StepInputs(time, problem.system.load_vector(motion)[0], forces.prescribed_inputs(motion))


def iterate_tracks(engine: Engine, steps: int, size: int = 0) -> Iterator[Trajectory]:
    """Yield the instants of all steps of an engine in blocks, shorter for systems of many unknowns, `size`.

    A failed run raises `RunFailedError`.
    """
    block = min(max(_VALUES // max(size, 1), 2), _BLOCK) // 2 * 2  # a step of the collocation covers two
    for begin in range(0, steps, block):
        with np.errstate(over="ignore", invalid="ignore"):
            track, status = engine.advance(np.arange(begin + (begin > 0), min(begin + block, steps) + 1))
        if not status.ok:
            raise RunFailedError(status)
        yield track


def no_instants(size: int, forces: LocalForces) -> Trajectory:
    """Return the empty trajectory of a system of some unknowns."""
    motion, local = np.zeros((0, size)), np.zeros((0, forces.count))
    state, sides = np.zeros((0, len(forces.start_state))), np.zeros((0, len(forces.switching)), dtype=bool)
    return Trajectory(np.zeros(0), motion, motion, motion, local, state, local, sides, np.zeros(0, dtype=np.intp))


LARGEST = 1e100
"""Magnitude (SI) above which a motion has diverged; its square, needed for stresses, is still finite."""

CONTINUE = "the finished part is saved; --resume continues it (with --overwrite if a complete result has the same name)"
"""Remedy for a run that ends before its last step."""

STOPPED = Status(Cause.INTERRUPTED, "stopped by a signal", CONTINUE)


def in_range(
    track: Trajectory, before: FloatArray | None, system: System, angle: FloatArray
) -> tuple[Trajectory, Status]:
    """Return the steps before the first divergence, and a status that names the diverging quantity."""
    if all(all_within(values) for values in (track.d, track.v, track.a, track.local)):
        return track, Status()
    rows = stack_motion(track)
    valid = (np.abs(rows[track.ends]) < LARGEST).all(axis=1)  # False for NaN as well
    if valid.all():  # large in sum, or out of range only between the ends of steps
        return track, Status()
    count = int(np.argmin(valid))
    index = int(track.ends[count])
    # An overflow affects every unknown within its step: report the unknown that was largest just before.
    sizes = np.where(np.isfinite(rows[index]), np.abs(rows[index]), np.inf)
    previous = rows[track.ends[count - 1]] if count else before
    if previous is not None and np.count_nonzero(sizes == sizes.max()) > 1:
        sizes = np.abs(previous)
    names = [*(3 * system.names), *(name for force in system.local_forces for name in [force.name] * len(force.sense))]
    place = instant(float(track.time[index]), float(angle[count]))
    text = f"{names[int(np.argmax(sizes))]} is not finite {place}"
    return track.steps(0, count), Status(Cause.NOT_FINITE, text, "use a smaller step, more damping or a lower speed")


def all_within(values: FloatArray) -> bool:
    """Return whether all values are finite and in range."""
    flat = values.ravel(order="K")
    return float(flat @ flat) < LARGEST**2


def stack_motion(track: Trajectory) -> FloatArray:
    """Return motion and forces as columns."""
    return np.hstack([track.d, track.v, track.a, track.local])


def stack_instant(moment: StepState) -> FloatArray:
    """Return motion and forces of an instant in a row."""
    return np.concatenate([moment.d, moment.v, moment.a, moment.local])


def instant(at: float, angle: float) -> str:
    """Format an instant for messages."""
    return f"at t = {at:.6g} s, cam angle {np.degrees(angle):.2f} deg"


def convergence_failure(forces: list[str], to: StepInputs) -> Status:
    """Return the status of a local Newton iteration that did not converge."""
    text = f"{', '.join(dict.fromkeys(forces))} did not converge within the step {instant(to.time, to.angle)}"
    return Status(Cause.NO_CONVERGENCE, text, "use a smaller step or a softer contact")


def first_track(problem: Problem, forces: LocalForces) -> Trajectory:
    """Return the first instant of a problem."""
    start = problem.initial_state
    to = inputs_at(problem, forces, start.time)
    return Trajectory.of([[InitialAcceleration(problem.system, forces).first(start, to)]], forces.contact_sides)


class KinematicEngine(Engine):
    """Engine of a problem without equations to integrate; `stop` is called before every block of steps."""

    def __init__(self, problem: Problem, forces: LocalForces, stop: Callable[[], bool]) -> None:
        self._problem, self._forces, self._stop = problem, forces, stop

    def advance(self, steps: IntArray) -> tuple[Trajectory, Status]:
        """Return the instants of some successive steps, see `Engine`."""
        system, forces = self._problem.system, self._forces
        if self._stop():
            return no_instants(system.size, forces), STOPPED
        times, indices = self._problem.times(steps), np.arange(len(steps))
        motion = self._problem.drive.at(times)
        if system.prescribed_motion is None:
            d = v = a = np.zeros((len(steps), 0))
            local = d
        else:
            d, v, a = system.prescribed_motion.at(motion)
            local = reactions(system, system.prescribed_motion, forces, motion, (d, v, a))
        state, impulse = np.tile(forces.start_state, (len(steps), 1)), np.zeros_like(local)
        sides = np.zeros((len(steps), len(forces.switching)), dtype=bool)
        return Trajectory(times, d, v, a, local, state, impulse, sides, indices, motion.cam), Status()


def reactions(
    system: System, prescribed: PrescribedMotion, forces: LocalForces, motion: CamMotion,
    moved: tuple[FloatArray, FloatArray, FloatArray],
) -> FloatArray:  # fmt: skip
    """Return the local forces of a system in prescribed motion `moved`, N, shape (m, c).

    The laws give the forces of springs and friction. The forces of the constraints balance the rest of the equation of
    motion: inverse dynamics.
    """
    d, v, a = moved
    inputs = forces.prescribed_inputs(motion)
    penetration, rate, _ = forces.sense_motion(d, v, inputs)
    state = np.tile(forces.start_state, (len(d), 1))
    laws = forces.acting_laws(penetration)
    laws = laws[~np.isin(laws[:, FIRST], prescribed.constraints)]
    local = forces.evaluate(penetration, state, forces.function_values(motion.cam), laws, rate)[1]
    residual = (
        system.mass.multiply(a.T) + system.damping.multiply(v.T) + system.stiffness.multiply(d.T)
    ).T - system.load_vector(motion)
    residual -= ((local @ inputs.acts) * inputs.acting_weights) @ forces.act.vectors
    return prescribed.complete_forces(motion, residual, forces.virtual_work(inputs), rate, local)
