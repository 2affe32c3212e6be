"""Derivatives of the equations of motion by parameters, along a motion.

Central differences of the equations, evaluated at the same motion, give what a parameter changes: loads, matrices,
force laws, sensed scalars, internal states and impacts. No run is needed for them. The sensed scalars of a parameter
act through the tangents of the laws, so that a contact that is about to switch stays on its side.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from flexcam.core import FloatArray, IntArray
from flexcam.dynamics.cam_motion import CamMotion, PrescribedInputs
from flexcam.dynamics.force_laws import NEW_STATE
from flexcam.dynamics.initial_acceleration import InitialAcceleration
from flexcam.dynamics.jit import Functions
from flexcam.dynamics.linearization import Linear
from flexcam.dynamics.local_forces import LocalForces
from flexcam.dynamics.problem import Problem
from flexcam.dynamics.step_state import SensedTrajectory, StepInputs, StepState


@dataclass(frozen=True, eq=False)
class Variation:
    """A problem with a parameter below and above its value, with as many unknowns, local forces and steps as itself."""

    below: Problem  #: with the parameter reduced by half the width
    above: Problem  #: with the parameter increased by half the width
    width: float  #: difference of the parameter, in its unit


class VariedProblem:
    """A problem with another value of a parameter, evaluated along the motion of the original one.

    Instants keep their fraction of a step if the parameter changes the step.
    """

    def __init__(self, problem: Problem, original: Problem, compiled: Functions | None) -> None:
        self.problem, self.forces = problem, LocalForces(problem.system, compiled)
        self._lifts = LocalForces(original.system).lifts if self.forces.lifts else self.forces.lifts
        self._begin = original.start.time if original.start else 0.0
        #: Stiffness, damping and mass.
        self.matrices = [one.dense() for one in (problem.system.stiffness, problem.system.damping, problem.system.mass)]
        self.stretch = problem.step / original.step  #: ratio of the steps

    def times(self, time: FloatArray) -> FloatArray:
        """Return the instants of this problem for those of the original one, s."""
        return self._begin + self.stretch * (time - self._begin)

    def forces_without_inertia(
        self, motion: CamMotion, schedule: PrescribedInputs, d: FloatArray, v: FloatArray, local: FloatArray
    ) -> FloatArray:
        """Return the sum of loads, stiffness, damping and local forces on the unknowns, N, shape (m, n)."""
        K, C, _ = self.matrices
        return self._applied_forces(motion, schedule, local) - d @ K.T - v @ C.T

    def _applied_forces(self, motion: CamMotion, schedule: PrescribedInputs, local: FloatArray) -> FloatArray:
        """Return the sum of loads and local forces on the unknowns, N, shape (m, n)."""
        act = self.forces.act
        return self.problem.system.load_vector(motion) + (local[:, act.scalars] * schedule.acting_weights) @ act.vectors

    def inputs(self, time: FloatArray) -> tuple[CamMotion, PrescribedInputs]:
        """Return motion of the cam and prescribed inputs at instants of the original problem."""
        motion = self.problem.drive.at(self.times(time))
        return motion, self.forces.prescribed_inputs(motion)

    def explicit_terms(
        self, every: SensedTrajectory, lengths: FloatArray, inputs: tuple[CamMotion, PrescribedInputs]
    ) -> list[FloatArray]:
        """Return forces on the unknowns (m, n); scalars, rates, answers of the laws (m, c); internal states (m - 1, s).

        The forces are those of loads and acting vectors with the local forces of the motion; the answers are those to
        its sensed scalars; the internal states are those after the steps of some lengths, s, shape (m - 1,).
        """
        track, forces, (motion, schedule) = every.track, self.forces, inputs
        pushed = self._applied_forces(motion, schedule, track.local)
        if not forces.count:
            return [pushed, every.penetration, every.rate, every.rate, track.state[1:]]
        sensed, rate, _ = forces.sense_motion(track.d, track.v, schedule)
        functions, depth, speed = schedule.rows[:, schedule.functions :], every.penetration, every.rate
        # Of a cam at the angle of its shaft: in the answers the contact stays where it is.
        lifted = forces.lifts.depth(depth) - self._lifts.depth(depth)
        faster = forces.lifts.depth_rate(depth, speed) - self._lifts.depth_rate(depth, speed)
        answer = forces.evaluate(depth - lifted, track.state, functions, rate=speed - faster)[1]
        after = forces.follow_states(self.stretch * lengths, sensed[1:], sensed[:-1], track.state[:-1])[:, NEW_STATE]
        return [pushed, sensed + lifted, rate + faster, answer, after]

    def impact_change(self, old: StepState, contacts: IntArray) -> FloatArray:
        """Return the change of the velocities by an impact at switching scalars, shape (n,)."""
        motion = self.problem.drive.at(self.times(np.array([old.time])))
        inputs = StepInputs(old.time, np.zeros(len(old.d)), self.forces.prescribed_inputs(motion))
        hit = self.accelerations.impact_data(inputs, contacts)
        rate = hit.sense @ old.v + hit.turning @ old.d
        rate = rate + inputs.schedule.offset_rate[0][self.forces.switching[contacts]]
        return hit.velocity_change(rate, hit.reversal(rate))

    @cached_property
    def accelerations(self) -> InitialAcceleration:
        """Solver of this problem for accelerations and impacts."""
        return InitialAcceleration(self.problem.system, self.forces)


@dataclass(frozen=True, eq=False)
class ExplicitDerivatives:
    """Derivatives of the equations by p parameters at m instants of a motion."""

    force: FloatArray  #: on the unknowns, shape (m, n, p)
    penetration: FloatArray  #: of the sensed scalars, shape (m, c, p)
    rate: FloatArray  #: of their rates, shape (m, c, p)
    answer: FloatArray  #: of the force laws at constant scalars, shape (m, c, p)
    states_after: FloatArray  #: of the internal states after a step, at constant ones before it, shape (m - 1, s, p)

    def source(self, linear: Linear, part: slice) -> FloatArray:
        """Return the forces on the unknowns at some instants, shape (m, n, p), with the tangents there."""
        penetration, rate, answer = (one[part, linear.kept] for one in (self.penetration, self.rate, self.answer))
        local = linear.by_penetration @ penetration + linear.by_rate @ rate
        return self.force[part] + np.swapaxes(linear.act, -1, -2) @ (answer + local)


class ParameterForces:
    """Derivatives of the equations of a problem by several parameters, all in the unknowns of its engine."""

    def __init__(self, problem: Problem, variations: Sequence[Variation], compiled: Functions | None = None) -> None:
        self.sides = [
            (VariedProblem(one.below, problem, compiled), VariedProblem(one.above, problem, compiled))
            for one in variations
        ]
        self.widths: FloatArray = np.array([one.width for one in variations])
        #: Derivatives of stiffness, damping and mass by every parameter; most change none.
        self._matrices = [
            [(high - low) / width for low, high in zip(*(side.matrices for side in pair), strict=True)]
            for pair, width in zip(self.sides, self.widths.tolist(), strict=True)
        ]
        #: Relative change of the step, shape (p,).
        self.stretch = self._difference(lambda side: np.array(side.stretch))

    @property
    def count(self) -> int:
        """Number of parameters."""
        return len(self.sides)

    def initial_state(self) -> FloatArray:
        """Return the derivatives of the initial displacements, velocities and internal states, shape (2n + s, p)."""

        def start(side: VariedProblem) -> FloatArray:
            state = side.problem.start
            if state is None:
                return np.zeros(2 * side.problem.system.size + len(side.forces.start_state))
            inner = side.forces.start_state if state.inner is None else state.inner
            return np.concatenate([state.displacement, state.velocity, inner])

        return self._difference(start)

    def along(self, every: SensedTrajectory, lengths: FloatArray) -> ExplicitDerivatives:
        """Return the derivatives at all instants of a motion, with the lengths of the steps between them, s."""
        parts = [
            [(up - low) / width for low, up in zip(*(one.explicit_terms(every, lengths) for one in pair), strict=True)]
            for pair, width in zip(self.sides, self.widths.tolist(), strict=True)
        ]
        track = every.track
        for terms, matrices in zip(parts, self._matrices, strict=True):
            for matrix, moved in zip(matrices, (track.d, track.v, track.a), strict=True):
                if matrix.any():
                    terms[0] -= moved @ matrix.T
        return ExplicitDerivatives(*(np.stack(terms, axis=-1) for terms in zip(*parts, strict=True)))

    def impact_change(self, old: StepState, contacts: IntArray) -> FloatArray:
        """Return the derivatives of the velocity change by an impact at switching scalars, shape (n, p)."""
        return self._difference(lambda side: side.impact_change(old, contacts))

    def _difference(self, function: Callable[[VariedProblem], FloatArray]) -> FloatArray:
        """Return the derivatives of a function of the problem by all parameters, as last axis."""
        return np.stack([function(up) - function(low) for low, up in self.sides], axis=-1) / self.widths
