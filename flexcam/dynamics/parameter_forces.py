"""Derivatives of the equations of motion by parameters, along a motion.

Differences of the equations, evaluated at the same motion, give what a parameter changes: loads, matrices, force laws,
sensed scalars, internal states and impacts. No run is needed for them. The sensed scalars of a parameter
act through the tangents of the laws, so that a contact that is about to switch stays on its side.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from flexcam.core import FloatArray, IntArray
from flexcam.dynamics.cam_motion import CamMotion, PrescribedInputs
from flexcam.dynamics.engine import inputs_at
from flexcam.dynamics.force_laws import NEW_STATE
from flexcam.dynamics.initial_acceleration import InitialAcceleration
from flexcam.dynamics.jit import Functions
from flexcam.dynamics.linearization import Linear
from flexcam.dynamics.local_forces import LocalForces
from flexcam.dynamics.problem import Problem
from flexcam.dynamics.step_state import SensedTrajectory, StepState, Trajectory


@dataclass(frozen=True, eq=False)
class Variation:
    """A problem with another value of a parameter, with as many unknowns, local forces and steps as the original one.

    Derivatives are those along the change, with an error proportional to it; two variations with opposite changes
    give central differences.
    """

    problem: Problem
    width: float  #: change of the parameter, in its unit


class VariedProblem:
    """A problem with another value of a parameter, evaluated along the motion of the original one.

    Instants keep their fraction of a step if the parameter changes the step.
    """

    def __init__(self, problem: Problem, original: Problem, compiled: Functions | None) -> None:
        self.problem, self.forces = problem, LocalForces(problem.system, compiled)
        self._lifts = LocalForces(original.system).lifts if self.forces.lifts else self.forces.lifts
        self._begin = original.initial_state.time
        #: Stiffness, damping and mass.
        self.matrices = [m.dense() for m in (problem.system.stiffness, problem.system.damping, problem.system.mass)]
        self.stretch = problem.step / original.step  #: ratio of the steps
        self._inputs: tuple[Trajectory, tuple[CamMotion, PrescribedInputs]] | None = None

    def times(self, time: FloatArray) -> FloatArray:
        """Return the instants of this problem for those of the original one, s."""
        return self._begin + self.stretch * (time - self._begin)

    def forces_without_inertia(
        self, motion: CamMotion, inputs: PrescribedInputs, d: FloatArray, v: FloatArray, local: FloatArray
    ) -> FloatArray:
        """Return the sum of loads, stiffness, damping and local forces on the unknowns, N, shape (m, n)."""
        K, C, _ = self.matrices
        push = self.push(local, inputs.acting_weights)
        return self.problem.system.load_vector(motion) + push - d @ K.T - v @ C.T

    def push(self, local: FloatArray, weights: FloatArray) -> FloatArray:
        """Return the sum of local forces on the unknowns, N, shape (m, n), for weights of the acting vectors."""
        act = self.forces.act
        zeros = np.zeros((len(local), act.vectors.shape[1]))
        return (local[:, act.scalars] * weights) @ act.vectors if weights.any() else zeros

    def inputs(self, track: Trajectory) -> tuple[CamMotion, PrescribedInputs]:
        """Return motion of the cam and prescribed inputs at instants of the original problem; they are kept.

        Functions of the cam that the parameter does not change are those of the original problem.
        """
        if self._inputs is None or self._inputs[0] is not track:
            motion = self.problem.drive.at(self.times(track.time))
            if track.cam is not None and np.array_equal(motion.angle, track.cam.angle):
                motion = replace(motion, known=track.cam)
            self._inputs = track, (motion, self.forces.prescribed_inputs(motion))
        return self._inputs[1]

    def answers(self, sensed: SensedTrajectory, inputs: PrescribedInputs) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return the answers of the laws to the scalars of a motion, and the lifts beyond the original, with rates.

        With a cam at the angle of its shaft, the contact stays where it is in the answers. The shapes are (m, c).
        """
        forces, depth, rate = self.forces, sensed.penetration, sensed.rate
        lift = forces.lifts.depth(depth) - self._lifts.depth(depth)
        lift_rate = forces.lifts.depth_rate(depth, rate) - self._lifts.depth_rate(depth, rate)
        answer = forces.evaluate(depth - lift, sensed.track.state, inputs.functions, rate=rate - lift_rate)[1]
        return answer, lift, lift_rate

    def states_after(self, sensed: SensedTrajectory, lengths: FloatArray, scalars: FloatArray) -> FloatArray:
        """Return the internal states after the steps of some lengths, s, shape (m - 1, s)."""
        state = sensed.track.state[:-1]
        return self.forces.follow_states(self.stretch * lengths, scalars[1:], scalars[:-1], state)[:, NEW_STATE]

    def impact_change(self, old: StepState, contacts: IntArray) -> FloatArray:
        """Return the change of the velocities by an impact at switching scalars, shape (n,)."""
        to = inputs_at(self.problem, self.forces, float(self.times(np.array(old.time))))
        impact = self.accelerations.impact_data(to, contacts)
        rate = impact.sense @ old.v + impact.turning @ old.d
        rate = rate + to.inputs.offset_rate[0][self.forces.switching[contacts]]
        return impact.velocity_change(rate, impact.reversal(rate))

    @cached_property
    def accelerations(self) -> InitialAcceleration:
        """Solver of this problem for accelerations and impacts."""
        return InitialAcceleration(self.problem.system, self.forces)


class _Evaluation:
    """Terms of the equations of a problem with another value of a parameter, along a motion of the original one."""

    def __init__(self, side: VariedProblem, sensed: SensedTrajectory, lengths: FloatArray) -> None:
        self._side, self._sensed, self._lengths = side, sensed, lengths
        motion, self.inputs = side.inputs(sensed.track)
        self.load = side.problem.system.load_vector(motion)

    @cached_property
    def push(self) -> FloatArray:
        """Effect of the local forces on the unknowns, N, shape (m, n)."""
        return self._side.push(self._sensed.track.local, self.inputs.acting_weights)

    @cached_property
    def sensed(self) -> tuple[FloatArray, FloatArray]:
        """Sensed scalars and their rates, shape (m, c)."""
        track = self._sensed.track
        return self._side.forces.sense_motion(track.d, track.v, self.inputs)[:2]

    @cached_property
    def states_after(self) -> FloatArray:
        """Internal states after the steps, shape (m - 1, s)."""
        return self._side.states_after(self._sensed, self._lengths, self.sensed[0])

    @cached_property
    def answers(self) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Answers of the laws, and the lifts beyond the original with their rates, shape (m, c)."""
        return self._side.answers(self._sensed, self.inputs)


class _ParameterChange:
    """Changes of the equations by a parameter; what the parameter does not change is not evaluated."""

    def __init__(self, original: VariedProblem, side: VariedProblem, width: float) -> None:
        self._side, self._width = side, width
        #: Derivatives of stiffness, damping and mass.
        self._matrices = [(new - old) / width for old, new in zip(original.matrices, side.matrices, strict=True)]

        def is_same(part: Callable[[LocalForces], NDArray[Any]]) -> bool:
            return np.array_equal(part(original.forces), part(side.forces))

        self._same_act, self._same_sense = is_same(lambda f: f.act.vectors), is_same(lambda f: f.sense.vectors)
        same_laws = is_same(lambda f: f.table.laws) and is_same(lambda f: f.table.constants)
        self._same_laws = same_laws and not side.forces.lifts and not side.forces.table.custom

    def explicit_terms(self, original: _Evaluation, along: SensedTrajectory, lengths: FloatArray) -> list[FloatArray]:
        """Return the derivatives of `ExplicitDerivatives` from the evaluation of the original problem."""
        varied, track = _Evaluation(self._side, along, lengths), along.track
        after, before = varied.inputs, original.inputs
        force = varied.load - original.load
        if self._same_act:
            force += self._side.push(track.local, after.acting_weights - before.acting_weights)
        else:
            force += varied.push - original.push
        force /= self._width
        for matrix, motion in zip(self._matrices, (track.d, track.v, track.a), strict=True):
            if matrix.any():
                force -= motion @ matrix.T
        sensed, rate, states = after.offset - before.offset, after.offset_rate - before.offset_rate, track.state[1:]
        weights = slice(0, after.sensing_weights.shape[1] + after.sensing_rates.shape[1])
        if states.size or not (self._same_sense and np.array_equal(after.rows[:, weights], before.rows[:, weights])):
            sensed, rate = varied.sensed[0] - original.sensed[0], varied.sensed[1] - original.sensed[1]
            states = varied.states_after - original.states_after
        else:
            states = np.zeros_like(states)
        response = np.zeros_like(rate)
        if not (self._same_laws and np.array_equal(after.functions, before.functions)):
            old, new = original.answers, varied.answers
            response, sensed, rate = new[0] - old[0], sensed + new[1] - old[1], rate + new[2] - old[2]
        return [force, *(change / self._width for change in (sensed, rate, response, states))]


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
        penetration, rate, answer = (values[part, linear.kept] for values in (self.penetration, self.rate, self.answer))
        local = linear.by_penetration @ penetration + linear.by_rate @ rate
        return self.force[part] + np.swapaxes(linear.act, -1, -2) @ (answer + local)


class ParameterForces:
    """Derivatives of the equations of a problem by several parameters, all in the unknowns of its engine."""

    def __init__(self, problem: Problem, variations: Sequence[Variation], compiled: Functions | None = None) -> None:
        self.original = VariedProblem(problem, problem, compiled)
        self.sides = [VariedProblem(variation.problem, problem, compiled) for variation in variations]
        self.widths: FloatArray = np.array([variation.width for variation in variations])
        self._changes = [
            _ParameterChange(self.original, *pair) for pair in zip(self.sides, self.widths.tolist(), strict=True)
        ]
        #: Relative change of the step, shape (p,).
        self.stretch = self._difference(lambda side: np.array(side.stretch))

    @property
    def count(self) -> int:
        """Number of parameters."""
        return len(self.sides)

    def initial_state(self) -> FloatArray:
        """Return the derivatives of the initial displacements, velocities and internal states, shape (2n + s, p)."""
        return self._difference(lambda side: side.problem.initial_state.stack(side.forces.start_state))

    def along(self, sensed: SensedTrajectory, lengths: FloatArray) -> ExplicitDerivatives:
        """Return the derivatives at all instants of a motion, with the lengths of the steps between them, s."""
        original = _Evaluation(self.original, sensed, lengths)
        parts = [change.explicit_terms(original, sensed, lengths) for change in self._changes]
        return ExplicitDerivatives(*(np.stack(terms, axis=-1) for terms in zip(*parts, strict=True)))

    def impact_change(self, old: StepState, contacts: IntArray) -> FloatArray:
        """Return the derivatives of the velocity change by an impact at switching scalars, shape (n, p)."""
        return self._difference(lambda side: side.impact_change(old, contacts))

    def _difference(self, function: Callable[[VariedProblem], FloatArray]) -> FloatArray:
        """Return the derivatives of a function of the problem by all parameters, as last axis."""
        original = function(self.original)
        return np.stack([function(side) - original for side in self.sides], axis=-1) / self.widths
