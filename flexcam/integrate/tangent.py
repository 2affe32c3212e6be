"""A system linearized about a motion: what small disturbances of it obey, instant by instant."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from flexcam.integrate.local import LocalForces
from flexcam.integrate.schedule import Schedule
from flexcam.linalg import FloatArray
from flexcam.system import CamMotion, Reaction, System


@dataclass(frozen=True, eq=False)
class Linear:
    """What small disturbances of displacement d, velocity v and internal states z obey at an instant.

    ``M d'' + C d' + K d = P z`` and ``z' = Z_d d + Z_v v + Z_z z``.

    Parameters
    ----------
    damping, stiffness
        C and K, shape (n, n).
    by_state
        P, shape (n, s).
    state_by_d, state_by_v, state_by_state
        Z_d and Z_v, shape (s, n), and Z_z, shape (s, s).
    """

    damping: FloatArray
    stiffness: FloatArray
    by_state: FloatArray
    state_by_d: FloatArray
    state_by_v: FloatArray
    state_by_state: FloatArray


class Linearization:
    """Linearizes a system whose local forces are given by their laws.

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
        n, s = system.size, len(forces.start_state)
        nothing = np.zeros((s, n))
        self._plain = Linear(self._C, self._K, nothing.T, nothing, nothing, np.zeros((s, s)))
        self._last, self._told = self._plain, b""

    def at(self, schedule: Schedule, i: int, gap: FloatArray, rate: FloatArray, state: FloatArray) -> Linear:
        """Return the linear system at a row of a schedule; the one of the last call where nothing has changed."""
        if not self._forces.count:
            return self._plain
        answer = self._forces.respond(gap, rate, state, schedule, i)
        weights = schedule.sensed[i], schedule.sensed_rates[i], schedule.acted[i]
        told = b"".join(one.tobytes() for one in (*weights, *_derivatives(answer)))
        if told != self._told:
            self._last, self._told = self._with(answer, *directions(self._forces, schedule, i)), told
        return self._last

    def _with(self, answer: Reaction, act: FloatArray, sense: FloatArray, turning: FloatArray) -> Linear:
        by_rate = act.T @ answer.by_rate
        C = self._C - by_rate @ sense
        K = self._K - act.T @ answer.by_gap @ sense - by_rate @ turning
        if not len(answer.state_rate):
            plain = self._plain
            return Linear(C, K, plain.by_state, plain.state_by_d, plain.state_by_v, plain.state_by_state)
        by_d = answer.state_rate_by_gap @ sense + answer.state_rate_by_rate @ turning
        return Linear(
            C, K, act.T @ answer.by_state, by_d, answer.state_rate_by_rate @ sense, answer.state_rate_by_state
        )


def directions(forces: LocalForces, schedule: Schedule, i: int) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return along which rows the forces act and sense, and how fast the latter turn, shape (c, n) each."""
    act, sense, turning = schedule.acting(i), schedule.sensing(i), schedule.turning(i)
    return act @ forces.act.vectors, sense @ forces.sense.vectors, turning @ forces.sense.vectors


def _derivatives(answer: Reaction) -> tuple[FloatArray, ...]:
    own = answer.by_gap, answer.by_rate
    if not len(answer.state_rate):
        return own
    of_state = answer.state_rate_by_gap, answer.state_rate_by_rate, answer.state_rate_by_state
    return (*own, answer.by_state, *of_state)


class Tangents:
    """Damping and stiffness of small disturbances about a motion.

    Local forces give their derivatives, which change with the cam angle, with what is pressed and what is not, and
    with the axial force of a pushrod; their internal states stand still.

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
        self._schedule = self._forces.schedule(motion)
        self._gap, self._rate, _ = self._forces.sensed(displacement, velocity, self._schedule)
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
            by_gap = answer.by_gap[own, own] @ sense[own] + answer.by_rate[own, own] @ turning[own]
            yield self._forces.names[own.start], -act[own].T @ by_gap

    def _state(self, i: int) -> FloatArray:
        return self._forces.start_state if self._inner is None else self._inner[i]
