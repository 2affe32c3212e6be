"""Static balance of a system whose local forces may be all that holds it: a train resting on its cam and its seat."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from flexcam.integrate.local import LocalForces, Schedule
from flexcam.linalg import Factor, FloatArray, IntArray, Triplets, factorize, null_space, pins
from flexcam.response import Cause, RunFailedError, Status
from flexcam.system import CamMotion, System

_MOST_ITERATIONS = 200
_TOLERANCE = 1e-11
"""Of the forces, by which they may miss what the motion asks for."""

_HALVINGS = 12


@dataclass(frozen=True, eq=False)
class _Flexibility:
    """Displacement of a structure as its strain plus motions that cost none.

    Held at one unknown per free motion it answers to any load; what those supports would take is the load on the free
    motions, which the local forces must carry.
    """

    factor: Factor
    kept: IntArray
    free: FloatArray

    @classmethod
    def of(cls, stiffness: Triplets, free: FloatArray | None) -> _Flexibility:
        motions = null_space(stiffness) if free is None else free
        if not motions.shape[1]:
            return cls(factorize(stiffness), np.arange(stiffness.size), motions)
        kept = np.setdiff1d(np.arange(stiffness.size), pins(np.linalg.qr(motions)[0]))
        return cls(factorize(stiffness.part(kept)), kept, motions)

    def solve(self, load: FloatArray) -> FloatArray:
        """Return the displacement, shape as `load`: (n,) or (n, k)."""
        x = np.zeros(load.shape)
        x[self.kept] = self.factor.solve(load[self.kept])
        return x


def balanced(system: System, forces: LocalForces, load: FloatArray, motion: CamMotion) -> FloatArray:
    """Return the displacement at which loads, stiffness and local forces balance, at rest.

    Newton's iteration on the local forces and on the motions that cost no strain, with a step that is halved where it
    does not help: contacts open and close on the way.

    Parameters
    ----------
    system
        The system.
    forces
        Its local forces, stacked.
    load
        Shape (n,).
    motion
        The cam at the instant, one row.

    Returns
    -------
    ndarray
        Shape (n,).

    Raises
    ------
    RunFailedError
        If nothing resists the load along some motion, or no balance is found.
    """
    schedule = forces.schedule(motion)
    flexibility = _Flexibility.of(system.stiffness, system.free)
    act = (schedule.act[0] @ forces.act.vectors).T  # one column per local force
    sense = schedule.sense[0] @ forces.sense.vectors
    equations = _Equations(forces, schedule, flexibility, sense, act, load)
    unknowns = equations.solve(system)
    return equations.displacement(unknowns)


@dataclass(frozen=True, eq=False)
class _Equations:
    """Unknowns are the local forces f and the amplitudes q of the free motions Z.

    ``u = K^-1 (load + A f) + Z q``; ``f = law(G u + g)``; ``Z^T (load + A f) = 0``.
    """

    forces: LocalForces
    schedule: Schedule
    flexibility: _Flexibility
    sense: FloatArray
    act: FloatArray
    load: FloatArray

    def displacement(self, unknowns: FloatArray) -> FloatArray:
        f, q = unknowns[: self.forces.count], unknowns[self.forces.count :]
        return self.flexibility.solve(self.load + self.act @ f) + self.flexibility.free @ q

    def solve(self, system: System) -> FloatArray:
        count, free = self.forces.count, self.flexibility.free
        by_force = self.sense @ self.flexibility.solve(self.act)
        by_free, carried = self.sense @ free, free.T @ self.act
        start = self.sense @ self.flexibility.solve(self.load) + self.schedule.offset[0]
        states, angle = list(self.forces.start_states), float(self.schedule.angle[0])
        still = np.zeros(count)

        def residual(unknowns: FloatArray) -> tuple[FloatArray, FloatArray]:
            f, q = unknowns[:count], unknowns[count:]
            reaction, _ = self.forces.respond(start + by_force @ f + by_free @ q, still, states, angle)
            tangent = np.block([
                [np.eye(count) - reaction.by_gap @ by_force, -reaction.by_gap @ by_free],
                [carried, np.zeros((len(q), len(q)))],
            ])  # fmt: skip
            return np.concatenate([f - reaction.force, carried @ f + free.T @ self.load]), tangent

        unknowns = np.zeros(count + free.shape[1])
        missing, tangent = residual(unknowns)
        size = max(float(np.abs(self.load).max(initial=0.0)), 1e-300)
        for _ in range(_MOST_ITERATIONS):
            if float(np.abs(missing).max(initial=0.0)) <= _TOLERANCE * max(size, float(np.abs(unknowns[:count]).max())):
                return unknowns
            # Where every contact along a free motion is open the tangent is singular; least squares then leaves it.
            step = np.asarray(np.linalg.lstsq(tangent, -missing, rcond=1e-13)[0], dtype=float)
            unknowns, missing, tangent = self._shortened(residual, unknowns, step, missing)
        raise _unbalanced(system, self.load + self.act @ unknowns[:count], free)

    def _shortened(
        self, residual: Residual, unknowns: FloatArray, step: FloatArray, missing: FloatArray
    ) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return the unknowns after a step, halved until what is missing falls; the last half is taken in any case."""
        part, before = 1.0, float(np.linalg.norm(missing))
        tried, left, tangent = unknowns, missing, np.zeros(0)
        for _ in range(_HALVINGS):
            tried = unknowns + part * step
            left, tangent = residual(tried)
            if float(np.linalg.norm(left)) < before:
                break
            part *= 0.5
        return tried, left, tangent


Residual = Callable[[FloatArray], tuple[FloatArray, FloatArray]]


def _unbalanced(system: System, load: FloatArray, free: FloatArray) -> RunFailedError:
    push = np.abs(free @ (free.T @ load)) if free.shape[1] else np.zeros(1)
    if float(push.max()) > 1e-6 * float(np.abs(load).max(initial=0.0)):
        furthest: list[int] = np.argsort(-push)[:4].tolist()
        moving = ", ".join(system.names[i] for i in furthest)
        text = f"no contact holds the mechanism against its loads; it moves off with {moving}"
        return RunFailedError(Status(Cause.SINGULAR, text, "install the springs with a force that closes the contacts"))
    text = "the contacts found no static balance"
    return RunFailedError(Status(Cause.NO_CONVERGENCE, text, "raise the installed forces, or soften a contact"))
