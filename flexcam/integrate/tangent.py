"""A system linearized about a motion: what small disturbances of it obey, instant by instant."""

from __future__ import annotations

from collections.abc import Iterator

from flexcam.integrate.local import LocalForces
from flexcam.linalg import FloatArray
from flexcam.system import CamMotion, Reaction, System


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
        self.mass, self._C, self._K = (m.dense() for m in (system.mass, system.damping, system.stiffness))
        self._forces = LocalForces(system)
        self._schedule = self._forces.schedule(motion)
        self._d, self._v, self._inner = displacement, velocity, inner

    def at(self, i: int) -> tuple[FloatArray, FloatArray]:
        """Return damping and stiffness at an instant, shape (n, n) each."""
        if not self._forces.count:
            return self._C, self._K
        answer, act, sense, turning = self._answer(i)
        by_rate = act.T @ answer.by_rate
        return self._C - by_rate @ sense, self._K - act.T @ answer.by_gap @ sense - by_rate @ turning

    def parts(self, i: int) -> Iterator[tuple[str, FloatArray]]:
        """Yield the name of each local force and the stiffness it adds at an instant, shape (n, n)."""
        if not self._forces.count:
            return
        answer, act, sense, turning = self._answer(i)
        for _, own, _ in self._forces.parts:
            by_gap = answer.by_gap[own, own] @ sense[own] + answer.by_rate[own, own] @ turning[own]
            yield self._forces.names[own.start], -act[own].T @ by_gap

    def _answer(self, i: int) -> tuple[Reaction, FloatArray, FloatArray, FloatArray]:
        """Return the reaction at an instant, and along which rows it acts and senses, and how fast the latter turn."""
        forces, schedule = self._forces, self._schedule
        gap, rate, _ = (one[0] for one in forces.sensed(self._d[i : i + 1], self._v[i : i + 1], schedule.row(i)))
        state = forces.start_state if self._inner is None else self._inner[i]
        answer = forces.respond(gap, rate, state, schedule, i)
        act = schedule.acting(i) @ forces.act.vectors
        sense = schedule.sensing(i) @ forces.sense.vectors
        return answer, act, sense, schedule.turning(i) @ forces.sense.vectors
