"""Kinematic engine: evaluate a system whose motion is prescribed, or that has no unknowns."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from flexcam.core import FloatArray, IntArray
from flexcam.dynamics.cam_motion import CamMotion
from flexcam.dynamics.engine import STOPPED, Engine, no_instants
from flexcam.dynamics.force_laws import FIRST
from flexcam.dynamics.local_forces import LocalForces
from flexcam.dynamics.problem import Problem
from flexcam.dynamics.status import Status
from flexcam.dynamics.step_state import Trajectory
from flexcam.dynamics.system import PrescribedMotion, System


class KinematicEngine(Engine):
    """Engine of a problem without equations to integrate; `stop` is called before every block of steps."""

    def __init__(self, problem: Problem, forces: LocalForces, stop: Callable[[], bool]) -> None:
        self._problem, self._forces, self._stop = problem, forces, stop

    def advance(self, steps: IntArray) -> tuple[Trajectory, Status]:
        """Return the instants of some successive steps, see `Engine`."""
        system, forces = self._problem.system, self._forces
        if self._stop():
            return no_instants(system.size, forces), STOPPED
        at, each = self._problem.times(steps), np.arange(len(steps))
        motion = self._problem.drive.at(at)
        if system.prescribed_motion is None:
            d = v = a = np.zeros((len(steps), 0))
            local = d
        else:
            d, v, a = system.prescribed_motion.at(motion)
            local = reactions(system, system.prescribed_motion, forces, motion, (d, v, a))
        state, impulse = np.tile(forces.start_state, (len(steps), 1)), np.zeros_like(local)
        sides = np.zeros((len(steps), len(forces.switching)), dtype=bool)
        return Trajectory(at, d, v, a, local, state, impulse, sides, each, motion.cam), Status()


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
