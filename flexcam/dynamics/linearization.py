"""Linearization of a system about a motion, instant by instant."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np

from flexcam.core import FloatArray
from flexcam.dynamics.cam_motion import CamMotion, PrescribedInputs
from flexcam.dynamics.local_forces import LocalForces
from flexcam.dynamics.massless import MasslessMotions, find_massless_rates
from flexcam.dynamics.system import Reaction, System

SAME_LENGTH = 1e-9
"""Relative difference of two step lengths that is rounding."""


@dataclass(frozen=True, eq=False)
class Linear:
    """Linearized local forces at an instant: the forces ``by_d d + by_v v + by_state z`` act along the rows `act`.

    For several instants all arrays have a first axis of instants.
    """

    act: FloatArray  #: shape (c, n)
    by_d: FloatArray  #: derivatives of the forces by displacement, shape (c, n)
    by_v: FloatArray  #: by velocity, shape (c, n)
    by_state: FloatArray  #: by the internal states z, shape (c, s); every state follows one sensed scalar G d
    followed: FloatArray  #: G, shape (s, n)
    by_penetration: FloatArray  #: derivatives by the sensed scalars, shape (c, c)
    by_rate: FloatArray  #: by their rates, shape (c, c)


class Linearization:
    """Linearization of the force laws of a system."""

    def __init__(self, system: System, forces: LocalForces) -> None:
        self._forces = forces
        rows, states = np.zeros((forces.count, system.size)), np.zeros((len(forces.start_state), system.size))
        none = np.zeros((forces.count, forces.count))
        self._last = Linear(rows, rows, rows, np.zeros((forces.count, len(states))), states, none, none)
        self._told: bytes = b""

    def at(
        self, schedule: PrescribedInputs, i: int, penetration: FloatArray, rate: FloatArray, state: FloatArray
    ) -> Linear:
        """Return the linear forces at a row of the prescribed inputs; the last ones if nothing has changed."""
        if not self._forces.count:
            return self._last
        answer = self._forces.respond(penetration, rate, state, schedule, i)
        weights = schedule.sensing_weights[i], schedule.sensing_rates[i], schedule.acting_weights[i]
        derivatives = answer.by_penetration, answer.by_rate, answer.by_state, answer.flow
        told = b"".join(one.tobytes() for one in (*weights, *derivatives))
        if told != self._told:
            self._last, self._told = self._with(answer, *directions(self._forces, schedule, i)), told
        return self._last

    def along(self, schedule: PrescribedInputs, penetration: FloatArray, rate: FloatArray, state: FloatArray) -> Linear:
        """Return the linear forces at all rows of the prescribed inputs."""
        forces, functions = self._forces, schedule.rows[:, schedule.functions :]
        by_x, by_rate = forces.tangents(penetration, rate, state, functions)
        act = (schedule.acts * schedule.acting_weights[:, None]) @ forces.act.vectors
        sense = (schedule.senses * schedule.sensing_weights[:, None]) @ forces.sense.vectors
        turning = (schedule.senses * schedule.sensing_rates[:, None]) @ forces.sense.vectors
        by_d, owners = by_x @ sense + by_rate @ turning, forces.table.owners
        return Linear(act, by_d, by_rate @ sense, -by_x[:, :, owners], sense[:, owners], by_x, by_rate)

    def _with(self, answer: Reaction, act: FloatArray, sense: FloatArray, turning: FloatArray) -> Linear:
        by_d, by_v = answer.by_penetration @ sense + answer.by_rate @ turning, answer.by_rate @ sense
        by_state, followed = self._last.by_state, self._last.followed
        if len(answer.state_rate):
            by_state, followed = answer.by_state, sense[self._forces.table.owners]
        return Linear(act, by_d, by_v, by_state, followed, answer.by_penetration, answer.by_rate)


def directions(forces: LocalForces, schedule: PrescribedInputs, i: int) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return the acting and sensing rows of the forces, and the rates of the latter, shape (c, n) each."""
    act, sense, turning = schedule.acting_matrix(i), schedule.sensing_matrix(i), schedule.sensing_rate_matrix(i)
    return act @ forces.act.vectors, sense @ forces.sense.vectors, turning @ forces.sense.vectors


class Tangents:
    """Tangent damping and stiffness about a motion.

    The derivatives of the local forces depend on the cam angle, on the contact state and on the axial force of a
    pushrod; internal states are constant.

    Parameters
    ----------
    system
        The system.
    motion
        Cam angle and speed at m instants.
    displacement, velocity
        The motion at these instants, shape (m, n).
    inner
        Internal states at these instants, shape (m, s); None for those at rest.

    Attributes
    ----------
    mass
        Shape (n, n), the same at all instants.
    """

    def __init__(
        self, system: System, motion: CamMotion, displacement: FloatArray, velocity: FloatArray,
        inner: FloatArray | None = None,
    ) -> None:  # fmt: skip
        self._forces = LocalForces(system)
        self._linear = Linearization(system, self._forces)
        self.mass, self._C, self._K = (one.dense() for one in (system.mass, system.damping, system.stiffness))
        self._schedule = self._forces.prescribed_inputs(motion)
        self._gap, self._rate, _ = self._forces.sense_motion(displacement, velocity, self._schedule)
        self._inner = inner

    def at(self, i: int) -> tuple[FloatArray, FloatArray]:
        """Return damping and stiffness at an instant, shape (n, n) each."""
        found = self._linear.at(self._schedule, i, self._gap[i], self._rate[i], self._state(i))
        return self._C - found.act.T @ found.by_v, self._K - found.act.T @ found.by_d

    def parts(self, i: int) -> Iterator[tuple[str, FloatArray]]:
        """Yield the name of each local force and the stiffness it adds at an instant, shape (n, n)."""
        if not self._forces.count:
            return
        answer = self._forces.respond(self._gap[i], self._rate[i], self._state(i), self._schedule, i)
        act, sense, turning = directions(self._forces, self._schedule, i)
        for _, own, _ in self._forces.parts:
            by_penetration = answer.by_penetration[own, own] @ sense[own] + answer.by_rate[own, own] @ turning[own]
            yield self._forces.names[own.start], -act[own].T @ by_penetration

    def _state(self, i: int) -> FloatArray:
        return self._forces.start_state if self._inner is None else self._inner[i]


@dataclass(frozen=True, eq=False)
class SmallStep:
    """A step of small disturbances."""

    old: Linear  #: linearized equations at its beginning
    new: Linear  #: at its end
    length: float  #: s
    by_travel: FloatArray  #: derivative of e1 by ``x1 - x0``, shape (s,); e = x - z: scalar minus internal state
    by_begin: FloatArray  #: derivative of e1 by e0, shape (s,)


class LinearStep:
    """A step of the average acceleration, linearized: accelerations balance the forces at both of its ends.

    Massless motions are in equilibrium at the new end; residual forces of the old end are transferred by their springs,
    and undamped ones have the mean velocity of the step.
    """

    def __init__(self, system: System) -> None:
        self._matrices = tuple(one.dense() for one in (system.mass, system.damping, system.stiffness))
        self._mass, self._damping, self._stiffness = (_operator(one) for one in self._matrices)
        self._light, self._size = MasslessMotions(system), system.size
        found = find_massless_rates(system, average=True) if self._light.any else None
        # Displacement per new velocity and half a step; that of the old velocity makes the sum 2.
        self._travel = np.eye(self._size)
        if found is not None:
            self._travel += found.free @ found.amounts[: found.free.shape[1]]
        self._moves, self._solve = _operator(self._travel), self._mass
        one = np.eye(self._size)
        #: Forces of the old end, shape (n, k), without their part on massless motions.
        self.equilibrate = _operator(self._light.condense_force(one) if self._light.any else one)
        self._length: float = 0.0

    def initial_disturbances(self, at: Linear, given: FloatArray, source: FloatArray) -> FloatArray:
        """Return disturbances of an initial state with massless motions in equilibrium with a source of force."""
        if not self._light.any:
            return given
        d, v, z = split_state(given, self._size)
        push = source + at.act.T @ (at.by_state @ z + at.by_v @ v + at.by_d @ d)
        return np.vstack([self._light.place(d, push), v, z])

    def propagate(self, step: SmallStep, before: FloatArray, more: FloatArray | None = None) -> FloatArray:
        """Return disturbances, shape (2n + s, m), after a step.

        With ``d = d_free + A v``, ``z = z_free + F d`` and ``M v + h/2 (C v + K d - f) = p`` at the new end, v is the
        only unknown; the local forces f are a correction of low rank (Sherman, Morrison and Woodbury). `more` is what
        comes to d_free, p and z_free from elsewhere.
        """
        n, old, new, half = self._size, step.old, step.new, 0.5 * step.length
        d, v, z = split_state(before, n)
        push = self.momentum(d, v, old.act.T @ (old.by_d @ d + old.by_v @ v + old.by_state @ z), half)
        d = self.displacement_by_old_velocity(d, v, half)
        own = np.zeros((len(before) - 2 * n, 1))
        if more is not None:
            d, push, own = d + more[:n], push + more[n : 2 * n], more[2 * n :]
        z, by_d = _states(step, before, own)
        by_new = new.by_d + new.by_state @ by_d
        self._set_length(step.length)
        v = self._solve(self.impulse_at_end(push, d, new.act.T @ (by_new @ d + new.by_state @ z), half))
        if len(new.act):
            answer, sense = self._solve(new.act.T), half * (new.by_v + half * self.rows_over_velocity(by_new))
            v = v + answer @ np.linalg.solve(np.eye(len(sense)) - sense @ answer, sense @ v)
        d = self.displacement_at_end(d, v, half)
        return np.vstack([d, v, z + by_d @ d])

    def momentum(self, d: FloatArray, v: FloatArray, force: FloatArray, half: float) -> FloatArray:
        """Return the momentum with the impulse of the old end in half a step, under a disturbance of force."""
        return self._mass(v) - half * self.equilibrate(self._damping(v) + self._stiffness(d) - force)

    def displacement_by_old_velocity(self, d: FloatArray, v: FloatArray, half: float) -> FloatArray:
        """Return the displacement by the old velocity alone."""
        return d + half * (2.0 * v - self._moves(v))

    def displacement_at_end(self, moved: FloatArray, v: FloatArray, half: float) -> FloatArray:
        """Return the displacement at the new end."""
        return moved + half * self._moves(v)

    def impulse_at_end(self, push: FloatArray, moved: FloatArray, force: FloatArray, half: float) -> FloatArray:
        """Return the impulse that the new velocity follows, without the effect of the local forces there."""
        return push - half * (self._stiffness(moved) - force)

    def rows_over_velocity(self, rows: FloatArray) -> FloatArray:
        """Return rows over displacements, shape (..., n), as rows over new velocities per half step."""
        return rows @ self._travel

    def _set_length(self, length: float) -> None:
        """Prepare the solution without local forces for a length of the step."""
        if abs(length - self._length) > SAME_LENGTH * length:
            (M, C, K), half = self._matrices, 0.5 * length
            self._solve = _operator(np.linalg.inv(M + half * (C + half * K @ self._travel)).astype(np.float64))
            self._length = length

    def impulse(self, old: FloatArray, new: FloatArray) -> FloatArray:
        """Return the derivatives of d, momentum and z by the step length, from the flows at both ends, (2n + s,)."""
        n, mean = self._size, 0.5 * (old + new)
        return np.concatenate([mean[:n], self._matrices[0] @ mean[n : 2 * n], mean[2 * n :]])

    def old_terms(self, more: FloatArray) -> FloatArray:
        """Return the contribution of the old end, without its residual on massless motions."""
        n = self._size
        return np.concatenate([more[:n], self.equilibrate(more[n : 2 * n, None])[:, 0], more[2 * n :]])

    def sequence(self, length: float, linear: Linear, by_travel: FloatArray, by_begin: FloatArray) -> StepSequence:
        """Return equal steps between successive instants, prepared together.

        The arguments are those of `SmallStep`, with a first axis of instants or of steps.
        """
        self._set_length(length)
        return StepSequence(self, self._solve, 0.5 * length, linear, by_travel, by_begin)


class StepSequence:
    """Equal steps of small disturbances between m successive instants, see `LinearStep.propagate`.

    What a step needs is computed for all of them at once, so that a step takes few products.
    """

    def __init__(
        self, stepper: LinearStep, solve: Callable[[FloatArray], FloatArray], half: float, linear: Linear,
        by_travel: FloatArray, by_begin: FloatArray,
    ) -> None:  # fmt: skip
        m, c, n = linear.act.shape
        self._stepper, self._solve, self._half, self._size = stepper, solve, half, n
        self._followed, self._by_state = linear.followed, linear.by_state
        self._by_begin, self._rest = by_begin[:, :, None], (1.0 - by_travel)[:, :, None]
        self._difference = (by_travel - by_begin)[:, :, None]
        self._force = np.concatenate([linear.by_d, linear.by_v, linear.by_state], axis=2)
        self._turned = np.ascontiguousarray(np.swapaxes(linear.act, 1, 2))
        self._by_new = linear.by_d[1:] + linear.by_state[1:] @ (self._rest * linear.followed[1:])
        answer = solve(self._turned[1:].transpose(1, 0, 2).reshape(n, (m - 1) * c))
        self._answer = np.ascontiguousarray(answer.reshape(n, m - 1, c).swapaxes(0, 1))
        sense = half * (linear.by_v[1:] + half * stepper.rows_over_velocity(self._by_new))
        self._gain = np.linalg.solve(np.eye(c) - sense @ self._answer, sense)

    def propagate(self, i: int, before: FloatArray, more: FloatArray) -> FloatArray:
        """Return disturbances, shape (2n + s, k), after the step that follows instant i."""
        stepper, half, n = self._stepper, self._half, self._size
        d, v, z = split_state(before, n)
        push = stepper.momentum(d, v, self._turned[i] @ (self._force[i] @ before), half) + more[n : 2 * n]
        moved = stepper.displacement_by_old_velocity(d, v, half) + more[:n]
        local = self._by_new[i] @ moved
        if len(z):
            z = self._by_begin[i] * z + self._difference[i] * (self._followed[i] @ d) + more[2 * n :]
            local += self._by_state[i + 1] @ z
        v = self._solve(stepper.impulse_at_end(push, moved, self._turned[i + 1] @ local, half))
        v = v + self._answer[i] @ (self._gain[i] @ v)
        d = stepper.displacement_at_end(moved, v, half)
        return np.concatenate([d, v, z + self._rest[i] * (self._followed[i + 1] @ d)] if len(z) else [d, v])


def _operator(matrix: FloatArray) -> Callable[[FloatArray], FloatArray]:
    """Return the product of a matrix with columns; that of a diagonal matrix takes one operation per entry."""
    own = np.diag(matrix)[:, None]
    if np.count_nonzero(matrix) <= len(own) and not (matrix - np.diagflat(own)).any():
        return lambda columns: own * columns
    return lambda columns: matrix @ columns


def _states(step: SmallStep, before: FloatArray, more: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return internal states after a step without the new motion, and their derivatives by its displacements.

    By the rule of `flexcam.dynamics.force_laws.oil_column`: what a state z leaves of its scalar x, ``e = x - z``,
    follows ``e1 = T (x1 - x0) + B e0``, so that ``z1 = (1 - T) x1 + (T - B) x0 + B z0``.
    """
    d, _, z = split_state(before, step.new.followed.shape[1])
    T, B = step.by_travel[:, None], step.by_begin[:, None]
    return B * z + (T - B) * (step.old.followed @ d) + more, (1.0 - T) * step.new.followed


def split_state(state: FloatArray, n: int) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return displacements, velocities and internal states of n unknowns."""
    return state[:n], state[n : 2 * n], state[2 * n :]
