"""One time step of the generalized-alpha family on a `System`.

The unknown is the new acceleration. One operator ``S = (1-am) M + (1-af) (gamma dt C + beta dt^2 K)`` is factorized
once for the whole run, because neither the step nor the tangent outside the local forces changes.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from flexcam.integrate.local import Compliance, LocalForces, Schedule, settle
from flexcam.integrate.scheme import Scheme
from flexcam.linalg import DENSE_LIMIT, FloatArray, Triplets, factorize, null_space, operator, pins
from flexcam.system import System


@dataclass(frozen=True, eq=False)
class Moment:
    """Everything the next step needs to know of an instant.

    Parameters
    ----------
    d, v, a
        Displacement, velocity, acceleration, shape (n,).
    applied
        Loads and local forces in the unknowns, shape (n,).
    local
        Local forces, shape (c,).
    states, state_rates
        Internal states of the local laws and their rates.
    iterations
        Newton iterations that led here.
    """

    d: FloatArray
    v: FloatArray
    a: FloatArray
    applied: FloatArray
    local: FloatArray
    states: list[FloatArray]
    state_rates: list[FloatArray]
    iterations: int = 0


class Stepper:
    """The step operator of a system, a scheme and a step size.

    Parameters
    ----------
    system
        The system.
    scheme
        The scheme.
    step
        s.
    forces
        The system's local forces, stacked.

    Raises
    ------
    SingularMatrixError
        If some motion has neither mass, damping nor stiffness.
    """

    def __init__(self, system: System, scheme: Scheme, step: float, forces: LocalForces) -> None:
        self._scheme, self._dt, self._forces = scheme, step, forces
        self._M, self._C, self._K = operator(system.mass), operator(system.damping), operator(system.stiffness)
        self._damped = bool(system.damping.values.any())
        self._to_v, self._to_d = scheme.gamma * step, scheme.beta * step**2
        new = 1.0 - scheme.alpha_f
        S = system.mass.scaled(1.0 - scheme.alpha_m) + system.damping.scaled(new * self._to_v)
        self._S = factorize(S + system.stiffness.scaled(new * self._to_d))
        # Response of all unknowns to each acting vector, and of each sensing vector to it: the low-rank update.
        self._by_act = self._S.solve(forces.act.vectors.T) * new
        self._sensed = forces.sense.vectors @ self._by_act

    def advance(self, now: Moment, load: FloatArray, schedule: Schedule, i: int) -> Moment:
        """Return the next instant.

        Parameters
        ----------
        now
            The instant before.
        load
            Loads at the new instant, shape (n,).
        schedule
            What follows from the cam motion for the local forces.
        i
            Row of the new instant in the schedule.

        Returns
        -------
        Moment
            The new instant.
        """
        s, dt = self._scheme, self._dt
        d = now.d + dt * now.v + (0.5 - s.beta) * dt**2 * now.a
        v = now.v + (1.0 - s.gamma) * dt * now.a
        a = self._S.solve(self._right_side(now, d, v, load))
        if self._forces.count == 0:
            return Moment(d + self._to_d * a, v + self._to_v * a, a, load, now.local, [], [])
        local, states, rates, iterations = settle(
            self._forces, self._within(d + self._to_d * a, v + self._to_v * a, schedule, i), now.local,
            now.states, now.state_rates, dt, float(schedule.angle[i]),
        )  # fmt: skip
        weights = local @ schedule.act[i]
        a = a + self._by_act @ weights
        applied = load + weights @ self._forces.act.vectors
        return Moment(d + self._to_d * a, v + self._to_v * a, a, applied, local, states, rates, iterations)

    def _right_side(self, now: Moment, d: FloatArray, v: FloatArray, load: FloatArray) -> FloatArray:
        s = self._scheme
        new, old = 1.0 - s.alpha_f, s.alpha_f
        # The predictor's forces and, where the scheme weighs the old instant, those of the old one.
        at_d = new * d + old * now.d if old else d
        right = new * load - self._K @ at_d + (old * now.applied if old else 0.0)
        if self._damped:
            right = right - self._C @ (new * v + old * now.v)
        if s.alpha_m:
            right = right - s.alpha_m * (self._M @ now.a)
        return right

    def _within(self, d: FloatArray, v: FloatArray, schedule: Schedule, i: int) -> Compliance:
        sense, sense_rate, act = schedule.sense[i], schedule.sense_rate[i], schedule.act[i]
        vectors = self._forces.sense.vectors
        on_d, on_v = vectors @ d, vectors @ v
        per_force = self._sensed @ act.T
        return Compliance(
            gap=sense @ on_d + schedule.offset[i],
            rate=sense @ on_v + sense_rate @ on_d + schedule.offset_rate[i],
            gap_by_force=self._to_d * (sense @ per_force),
            rate_by_force=self._to_v * (sense @ per_force) + self._to_d * (sense_rate @ per_force),
        )


def instant_forces(
    forces: LocalForces, d: FloatArray, v: FloatArray, schedule: Schedule, states: list[FloatArray]
) -> tuple[FloatArray, list[FloatArray]]:
    """Return the local forces of an instant.

    Parameters
    ----------
    forces
        The local forces, stacked.
    d, v
        Displacement and velocity, shape (n,).
    schedule
        The cam motion at the instant (row 0).
    states
        Internal states, one array per law.

    Returns
    -------
    tuple
        Forces, shape (c,), and the rates of the states.
    """
    vectors = forces.sense.vectors
    gap = schedule.sense[0] @ (vectors @ d) + schedule.offset[0]
    rate = schedule.sense[0] @ (vectors @ v) + schedule.sense_rate[0] @ (vectors @ d) + schedule.offset_rate[0]
    reaction, rates = forces.respond(gap, rate, states, float(schedule.angle[0]))
    return reaction.force, rates


def first_moment(
    system: System, forces: LocalForces, d: FloatArray, v: FloatArray, load: FloatArray, schedule: Schedule
) -> Moment:
    """Return the first instant with the acceleration that balances it, ``M a = f - C v - K d``.

    Unknowns without mass have no acceleration to start from: their displacement is moved to the balance of the
    forces on them (of the stiffness and loads; the local forces are those at the given displacement).

    Parameters
    ----------
    system
        The system.
    forces
        Its local forces, stacked.
    d, v
        Start, shape (n,).
    load
        Loads at the start, shape (n,).
    schedule
        The cam motion at the start (one row).

    Returns
    -------
    Moment
        The first instant.

    Raises
    ------
    SingularMatrixError
        If the massless unknowns have no stiffness among them.
    """
    states = list(forces.start_states)
    light = _massless(system)
    if light.shape[1]:
        local, _ = instant_forces(forces, d, v, schedule, states)
        out_of_balance = load + (local @ schedule.act[0]) @ forces.act.vectors - system.stiffness.times(d)
        K = Triplets.from_dense(light.T @ system.stiffness.times_all(light))
        d = d + light @ factorize(K).solve(light.T @ out_of_balance)
    local, rates = instant_forces(forces, d, v, schedule, states)
    applied = load + (local @ schedule.act[0]) @ forces.act.vectors
    right = applied - system.damping.times(v) - system.stiffness.times(d)
    a = static_acceleration(system.mass, light, right)
    return Moment(d, v, a, applied, local, states, rates)


def static_acceleration(mass: Triplets, light: FloatArray, right: FloatArray) -> FloatArray:
    """Return the acceleration ``M a = f`` with no part along the motions without mass.

    Parameters
    ----------
    mass
        n x n.
    light
        Motions without mass, shape (n, k).
    right
        f, shape (n,).

    Returns
    -------
    ndarray
        Shape (n,).
    """
    if not light.shape[1]:
        return factorize(mass).solve(right)
    kept = np.setdiff1d(np.arange(mass.size), pins(light))
    a = np.zeros(mass.size)
    a[kept] = factorize(mass.part(kept)).solve(right[kept])
    return a


def _massless(system: System) -> FloatArray:
    """Return the motions without mass as columns.

    Above the dense limit they are sought within the unknowns that mass couples: a massive member is one such group,
    and regular; a body on an arm at a node is a small one.
    """
    if system.size <= 2 * DENSE_LIMIT:
        return null_space(system.mass)
    from scipy.sparse.csgraph import connected_components

    light = [np.eye(system.size)[:, system.mass.diagonal() <= 0.0]]
    labels = connected_components(system.mass.csr(), directed=False)[1]
    sizes = np.bincount(labels)
    for label in np.flatnonzero((sizes > 1) & (sizes <= DENSE_LIMIT)).tolist():
        group = np.flatnonzero(labels == label)
        within = null_space(system.mass.part(group))
        spread = np.zeros((system.size, within.shape[1]))
        spread[group] = within
        light.append(spread)
    return np.hstack(light)
