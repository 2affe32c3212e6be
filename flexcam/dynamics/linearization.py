"""Linearization of a system about a motion, instant by instant."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np

from flexcam.core import FloatArray
from flexcam.dynamics.cam_motion import CamMotion, PrescribedInputs
from flexcam.dynamics.local_forces import LocalForces
from flexcam.dynamics.massless import MasslessMotions, find_massless_rates
from flexcam.dynamics.system import System

_SAME_LENGTH = 1e-9
"""Relative difference of two step lengths that is rounding."""


@dataclass(frozen=True, eq=False)
class Linear:
    """Linearized local forces at m instants: the forces ``by_d d + by_v v + by_state z`` act along the rows `act`."""

    act: FloatArray  #: shape (m, c, n)
    by_d: FloatArray  #: derivatives of the forces by displacement, shape (m, c, n)
    by_v: FloatArray  #: by velocity, shape (m, c, n)
    by_state: FloatArray  #: by the internal states z, shape (m, c, s); every state follows one sensed scalar G d
    followed: FloatArray  #: G, shape (m, s, n)
    by_penetration: FloatArray  #: derivatives by the sensed scalars, shape (m, c, c)
    by_rate: FloatArray  #: by their rates, shape (m, c, c)


def linearize(
    forces: LocalForces, schedule: PrescribedInputs, penetration: FloatArray, rate: FloatArray, state: FloatArray
) -> Linear:
    """Return the linear forces at all m rows of the prescribed inputs.

    Sensed scalars and rates have the shape (m, c), internal states (m, s).
    """
    functions = schedule.rows[:, schedule.functions :]
    by_x, by_rate = forces.tangents(penetration, rate, state, functions)
    act = (schedule.acts * schedule.acting_weights[:, None]) @ forces.act.vectors
    sense = (schedule.senses * schedule.sensing_weights[:, None]) @ forces.sense.vectors
    turning = (schedule.senses * schedule.sensing_rates[:, None]) @ forces.sense.vectors
    by_d, owners = by_x @ sense + by_rate @ turning, forces.table.owners
    return Linear(act, by_d, by_rate @ sense, -by_x[:, :, owners], sense[:, owners], by_x, by_rate)


def directions(forces: LocalForces, schedule: PrescribedInputs, i: int) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return the acting and sensing rows of the forces, and the rates of the latter, shape (c, n) each."""
    act, sense, turning = schedule.acting_matrix(i), schedule.sensing_matrix(i), schedule.sensing_rate_matrix(i)
    return act @ forces.act.vectors, sense @ forces.sense.vectors, turning @ forces.sense.vectors


class Tangents:
    """Tangent damping and stiffness about a motion at m instants of the cam; the `mass` (n, n) is constant.

    The derivatives of the local forces depend on the cam angle, on the contact state and on the axial force of a
    pushrod. Displacements and velocities have the shape (m, n); the internal states `inner`, (m, s), are constant, None
    for those at rest.
    """

    def __init__(
        self, system: System, motion: CamMotion, displacement: FloatArray, velocity: FloatArray,
        inner: FloatArray | None = None,
    ) -> None:  # fmt: skip
        self._forces = LocalForces(system)
        self.mass, self._C, self._K = (one.dense() for one in (system.mass, system.damping, system.stiffness))
        self._schedule = self._forces.prescribed_inputs(motion)
        self._gap, self._rate, _ = self._forces.sense_motion(displacement, velocity, self._schedule)
        self._inner = inner

    def at(self, i: int) -> tuple[FloatArray, FloatArray]:
        """Return damping and stiffness at an instant, shape (n, n) each."""
        row, state = slice(i, i + 1), self._state(i)[None]
        found = linearize(self._forces, self._schedule.at(row), self._gap[row], self._rate[row], state)
        (act,) = found.act
        return self._C - act.T @ found.by_v[0], self._K - act.T @ found.by_d[0]

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


class LinearStep:
    """A step of the average acceleration, linearized: accelerations balance the forces at both of its ends.

    Massless motions are in equilibrium at the new end; residual forces of the old end are transferred by their springs,
    and undamped ones have the mean velocity of the step.
    """

    def __init__(self, system: System) -> None:
        self.mass, self._damping, self._stiffness = (
            one.dense() for one in (system.mass, system.damping, system.stiffness)
        )
        self._light, self._size = MasslessMotions(system), system.size
        found = find_massless_rates(system, average=True) if self._light.any else None
        #: Displacement per new velocity and half a step; that of the old velocity makes the sum 2.
        self.travel = np.eye(self._size)
        if found is not None:
            self.travel += found.free @ found.amounts[: found.free.shape[1]]
        one = np.eye(self._size)
        #: Forces of the old end, shape (n, k), without their part on massless motions.
        self.equilibrate = _operator(self._light.condense_force(one) if self._light.any else one)
        self.operators = tuple(_operator(one) for one in (self.mass, self._damping, self._stiffness, self.travel))
        self._length, self._solve = 0.0, self.equilibrate

    def initial_disturbances(self, at: Linear, given: FloatArray, source: FloatArray) -> FloatArray:
        """Return disturbances of an initial state with massless motions in equilibrium with a source of force."""
        if not self._light.any:
            return given
        d, v, z = split_state(given, self._size)
        push = source + at.act[0].T @ (at.by_state[0] @ z + at.by_v[0] @ v + at.by_d[0] @ d)
        return np.vstack([self._light.place(d, push), v, z])

    def solution(self, length: float) -> Callable[[FloatArray], FloatArray]:
        """Return the new velocities without local forces by the impulse, for a length of the step in s."""
        if abs(length - self._length) > _SAME_LENGTH * length:
            half = 0.5 * length
            matrix = self.mass + half * (self._damping + half * self._stiffness @ self.travel)
            self._solve, self._length = _operator(np.linalg.inv(matrix).astype(np.float64)), length
        return self._solve

    def by_length(self, old: FloatArray, new: FloatArray) -> FloatArray:
        """Return the derivatives of d, momentum and z by the step length, from the flows at both ends, (2n + s,)."""
        n, mean = self._size, 0.5 * (old + new)
        return np.concatenate([mean[:n], self.mass @ mean[n : 2 * n], mean[2 * n :]])

    def old_terms(self, more: FloatArray) -> FloatArray:
        """Return the contribution of the old end, without its residual on massless motions."""
        n = self._size
        return np.concatenate([more[:n], self.equilibrate(more[n : 2 * n, None])[:, 0], more[2 * n :]])


class StepSequence:
    """Equal steps of small disturbances between m successive instants, which share their preparation.

    With ``d = d_free + A v``, ``z = z_free + F d`` and ``M v + h/2 (C v + K d - f) = p`` at the new end, v is the only
    unknown of a step; the local forces f are a correction of low rank (Sherman, Morrison and Woodbury). Internal states
    follow the rule of `flexcam.dynamics.oil_laws.oil_column`: what a state z leaves of its scalar x, ``e = x - z``,
    follows ``e1 = T (x1 - x0) + B e0``, so that ``z1 = (1 - T) x1 + (T - B) x0 + B z0``; T and B have the shape (m - 1,
    s).
    """

    def __init__(self, stepper: LinearStep, length: float, linear: Linear, T: FloatArray, B: FloatArray) -> None:
        m, c, n = linear.act.shape
        self._stepper, self._solve, self._half, self._size = stepper, stepper.solution(length), 0.5 * length, n
        #: Whether all steps are the same.
        self.constant = all((part[1:] == part[:1]).all() for part in (*vars(linear).values(), T, B))
        self._followed, self._by_state = linear.followed, linear.by_state
        self._by_begin, self._rest, self._difference = B[:, :, None], (1.0 - T)[:, :, None], (T - B)[:, :, None]
        self._force = np.concatenate([linear.by_d, linear.by_v, linear.by_state], axis=2)
        self._turned = np.ascontiguousarray(np.swapaxes(linear.act, 1, 2))
        self._by_new = linear.by_d[1:] + linear.by_state[1:] @ (self._rest * linear.followed[1:])
        answer = self._solve(self._turned[1:].transpose(1, 0, 2).reshape(n, (m - 1) * c))
        self._answer = np.ascontiguousarray(answer.reshape(n, m - 1, c).swapaxes(0, 1))
        sense = self._half * (linear.by_v[1:] + self._half * self._by_new @ stepper.travel)
        self._gain = np.linalg.solve(np.eye(c) - sense @ self._answer, sense)

    def propagate(self, i: int, before: FloatArray, more: FloatArray) -> FloatArray:
        """Return disturbances, shape (2n + s, k), after the step that follows instant i.

        `more` is what comes to d_free, p and z_free from elsewhere, of the same shape.
        """
        (mass, damping, stiffness, travel), half, n = self._stepper.operators, self._half, self._size
        d, v, z = split_state(before, n)
        residual = damping(v) + stiffness(d) - self._turned[i] @ (self._force[i] @ before)
        push = mass(v) - half * self._stepper.equilibrate(residual) + more[n : 2 * n]
        moved = d + half * (2.0 * v - travel(v)) + more[:n]
        local = self._by_new[i] @ moved
        if len(z):
            z = self._by_begin[i] * z + self._difference[i] * (self._followed[i] @ d) + more[2 * n :]
            local += self._by_state[i + 1] @ z
        v = self._solve(push - half * (stiffness(moved) - self._turned[i + 1] @ local))
        v = v + self._answer[i] @ (self._gain[i] @ v)
        d = moved + half * travel(v)
        return np.concatenate([d, v, z + self._rest[i] * (self._followed[i + 1] @ d)] if len(z) else [d, v])


def _operator(matrix: FloatArray) -> Callable[[FloatArray], FloatArray]:
    """Return the product of a matrix with columns; that of a diagonal matrix takes one operation per entry."""
    own = np.diag(matrix)[:, None]
    if np.count_nonzero(matrix) <= len(own) and not (matrix - np.diagflat(own)).any():
        return lambda columns: own * columns
    return lambda columns: matrix @ columns


def split_state(state: FloatArray, n: int) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return displacements, velocities and internal states of n unknowns."""
    return state[:n], state[n : 2 * n], state[2 * n :]
