"""Linearization of a system about a motion, instant by instant."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from flexcam.core import FloatArray
from flexcam.dynamics.cam_motion import CamMotion
from flexcam.dynamics.local_forces import LocalForces
from flexcam.dynamics.massless import MasslessMotions, find_massless_rates
from flexcam.dynamics.prescribed_inputs import PrescribedInputs
from flexcam.dynamics.system import Reaction, System


@dataclass(frozen=True, eq=False)
class Linear:
    """Linearized equations for displacement d, velocity v and internal states z at an instant.

    ``M d'' + C d' + K d = P z``; every state z follows one sensed scalar G d.

    Parameters
    ----------
    damping, stiffness
        C and K, shape (n, n).
    by_state
        P, shape (n, s).
    followed
        G, shape (s, n).
    """

    damping: FloatArray
    stiffness: FloatArray
    by_state: FloatArray
    followed: FloatArray


class Linearization:
    """Linearization of a system with given force laws.

    Parameters
    ----------
    system
        The system.
    forces
        Its local forces, stacked.

    Attributes
    ----------
    mass
        Shape (n, n), the same at all instants.
    """

    def __init__(self, system: System, forces: LocalForces) -> None:
        self.mass, self._C, self._K = (m.dense() for m in (system.mass, system.damping, system.stiffness))
        self._forces = forces
        nothing = np.zeros((len(forces.start_state), system.size))
        self._plain = Linear(self._C, self._K, nothing.T, nothing)
        self._last, self._told = self._plain, b""

    def at(
        self, schedule: PrescribedInputs, i: int, penetration: FloatArray, rate: FloatArray, state: FloatArray
    ) -> Linear:
        """Return the linear system at a row of the prescribed inputs; cached if nothing has changed."""
        if not self._forces.count:
            return self._plain
        answer = self._forces.respond(penetration, rate, state, schedule, i)
        weights = schedule.sensing_weights[i], schedule.sensing_rates[i], schedule.acting_weights[i]
        derivatives = answer.by_penetration, answer.by_rate, answer.by_state, answer.flow
        told = b"".join(one.tobytes() for one in (*weights, *derivatives))
        if told != self._told:
            self._last, self._told = self._with(answer, *directions(self._forces, schedule, i)), told
        return self._last

    def _with(self, answer: Reaction, act: FloatArray, sense: FloatArray, turning: FloatArray) -> Linear:
        by_rate = act.T @ answer.by_rate
        C = self._C - by_rate @ sense
        K = self._K - act.T @ answer.by_penetration @ sense - by_rate @ turning
        if not len(answer.state_rate):
            return Linear(C, K, self._plain.by_state, self._plain.followed)
        return Linear(C, K, act.T @ answer.by_state, sense[self._forces.table.owners])


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
        self.mass = self._linear.mass
        self._schedule = self._forces.prescribed_inputs(motion)
        self._gap, self._rate, _ = self._forces.sense_motion(displacement, velocity, self._schedule)
        self._inner = inner

    def at(self, i: int) -> tuple[FloatArray, FloatArray]:
        """Return damping and stiffness at an instant, shape (n, n) each."""
        found = self._linear.at(self._schedule, i, self._gap[i], self._rate[i], self._state(i))
        return found.damping, found.stiffness

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
    """A step of small disturbances.

    Parameters
    ----------
    old, new
        Linearized equations at its beginning and at its end.
    length
        s.
    by_travel, by_begin
        Derivatives of ``e1 = x1 - z1``, scalar minus internal state at the end, by ``x1 - x0`` and by e0, shape (s,).
    """

    old: Linear
    new: Linear
    length: float
    by_travel: FloatArray
    by_begin: FloatArray


class LinearStep:
    """A step of the average acceleration, linearized: accelerations balance the forces at both of its ends.

    Massless motions are in equilibrium at the new end; residual forces of the old end are transferred by their springs,
    and undamped ones have the mean velocity of the step.

    Parameters
    ----------
    system
        The system.
    """

    def __init__(self, system: System) -> None:
        self._M, self._C, self._K = (one.dense() for one in (system.mass, system.damping, system.stiffness))
        self._light = MasslessMotions(system)
        found = find_massless_rates(system, average=True) if self._light.any else None
        self._free = None if found is None else found.free @ found.amounts[: found.free.shape[1]]

    def initial_disturbances(self, at: Linear, given: FloatArray) -> FloatArray:
        """Return disturbances of an initial state with massless motions in static equilibrium."""
        if not self._light.any:
            return given
        n = len(self._M)
        d, v, z = split_state(given, n)
        push = at.by_state @ z - (at.damping - self._C) @ v - (at.stiffness - self._K) @ d
        return np.vstack([self._light.place(d, push), v, z])

    def propagate(self, step: SmallStep, before: FloatArray, more: FloatArray | None = None) -> FloatArray:
        """Return disturbances, shape (2n + s, m), after a step.

        With ``d = d_free + A v``, ``z = z_free + F d`` and ``M v + h/2 (C v + K d - P z) = p`` at the new
        end, v is the only unknown. `more` is what comes to d_free, p and z_free from elsewhere.
        """
        n, old, new, h = len(self._M), step.old, step.new, step.length
        d, v, z = split_state(before, n)
        push = self._M @ v - 0.5 * h * self._equilibrate(old.damping @ v + old.stiffness @ d - old.by_state @ z)
        d, whole = d + 0.5 * h * v, 0.5 * h * np.eye(n)
        if self._free is not None:
            d, whole = d - 0.5 * h * (self._free @ v), whole + 0.5 * h * self._free
        own = np.zeros((len(before) - 2 * n, 1))
        if more is not None:
            d, push, own = d + more[:n], push + more[n : 2 * n], more[2 * n :]
        z, by_d = _states(step, before, own)
        C, K = new.damping, new.stiffness - new.by_state @ by_d
        right = push - 0.5 * h * (K @ d - new.by_state @ z)
        v = np.asarray(np.linalg.solve(self._M + 0.5 * h * (C + K @ whole), right), dtype=float)
        d = d + whole @ v
        return np.vstack([d, v, z + by_d @ d])

    def impulse(self, old: FloatArray, new: FloatArray) -> FloatArray:
        """Return the derivatives of d, momentum and z by the step length, from the flows at both ends, (2n + s,)."""
        n, mean = len(self._M), 0.5 * (old + new)
        return np.concatenate([mean[:n], self._M @ mean[n : 2 * n], mean[2 * n :]])

    def old_terms(self, more: FloatArray) -> FloatArray:
        """Return the contribution of the old end, without its residual on massless motions."""
        n = len(self._M)
        return np.concatenate([more[:n], self._equilibrate(more[n : 2 * n]), more[2 * n :]])

    def _equilibrate(self, forces: FloatArray) -> FloatArray:
        return self._light.condense_force(forces) if self._light.any else forces


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
