"""Static balance of a system whose local forces may be all that holds it: a train resting on its cam and its seat.

The balance is the least of the potential energy: strain, contacts, less the work of the loads. With contacts that only
push it is convex, so that Newton's method with a line search on it arrives from anywhere, whichever contacts open and
close on the way.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from flexcam.integrate.local import LocalForces
from flexcam.integrate.schedule import Schedule
from flexcam.linalg import (
    DENSE_LIMIT,
    TOO_MUCH,
    FloatArray,
    IntArray,
    SingularMatrixError,
    Triplets,
    diagonal_scale,
    factorize_held,
    null_space,
    share_lost,
)
from flexcam.response import TOO_FINE, Cause, RunFailedError, Status, gives_way
from flexcam.system import CamMotion, Reaction, System

_MOST_ITERATIONS = 300
_TOLERANCE = 1e-9
"""Of the largest force, by which forces may miss their balance."""

_SHARP = 1e-12
"""The same of a balance that is compared with one nearby: their difference has few of the digits."""

_SUMS = 4.0
"""Roundings of a sum of a dozen parts, a few of which are large."""

_NEGATIVE = 1e-9
"""Eigenvalue of the scaled stiffness, of size 1, that is negative beyond rounding."""

_DECREASE, _HALVINGS = 1e-4, 40
_FALL = 0.01
"""Distance, m, that a part which nothing holds may fall in one iteration."""


def balanced(
    system: System, forces: LocalForces, load: FloatArray, motion: CamMotion, near: FloatArray | None = None
) -> FloatArray:
    """Return the displacement at which loads, stiffness and local forces balance, at rest."""
    free = null_space(system.stiffness) if system.free is None else system.free
    free = np.linalg.qr(free)[0] if free.shape[1] else free
    potential = _Potential.of(system, forces, forces.schedule(motion), load)
    u = np.zeros(system.size) if near is None else near
    # A soft hold of the free motions limits a step along them and vanishes with the step.
    hold = max(float(np.abs(free.T @ load).max(initial=0.0)) / _FALL, 1.0)
    before, energy = np.inf, None
    for _ in range(_MOST_ITERATIONS):
        missing, size, tangent = potential.at(u)
        most = float(np.abs(missing).max(initial=0.0))
        stalled, close = 0.5 * before <= most, most <= _TOLERANCE * size
        done = close and (near is None or stalled or most <= _SHARP * size)
        if done or (stalled and most <= potential.rounding(u)):  # gets no better
            if not close and share_lost(system.stiffness, u) > TOO_MUCH:
                raise RunFailedError(TOO_FINE)
            _refuse_unstable(potential, u, tangent)
            return u
        step = _step(tangent, free, hold, missing)
        part, energy = potential.shortened(u, step, missing, energy)
        u, before = u + part * step, most
    missing, _, tangent = potential.at(u)
    _refuse_unstable(potential, u, tangent)
    raise _unbalanced(system, missing, free)


def _step(tangent: Triplets, free: FloatArray, hold: float, missing: FloatArray) -> FloatArray:
    """Return the step of Newton: where the free motions are held, a tangent is singular by rounding alone."""
    try:
        return factorize_held(tangent, free, hold).solve(missing)
    except SingularMatrixError:
        raise RunFailedError(TOO_FINE) from None


def _refuse_unstable(potential: _Potential, u: FloatArray, tangent: Triplets) -> None:
    """Refuse a balance from which the smallest push leads away: the least of the energy lies elsewhere."""
    system = potential.system
    if system.size > 2 * DENSE_LIMIT or not system.local_forces:
        return
    scale = diagonal_scale(tangent)
    scaled = scale[:, None] * tangent.dense() * scale
    symmetric = 0.5 * (scaled + scaled.T)
    try:
        np.linalg.cholesky(symmetric + _NEGATIVE * np.eye(len(symmetric)))
    except np.linalg.LinAlgError:
        values, vectors = np.linalg.eigh(symmetric)
    else:
        return
    if values[0] >= -_NEGATIVE:
        return
    raise RunFailedError(gives_way(system.names, scale * vectors[:, 0], potential.parts(u)))


@dataclass(frozen=True, eq=False)
class _Touching:
    """What one local law does to the unknowns that it touches, at a cam angle.

    Parameters
    ----------
    name
        Of the local force.
    scalars
        Its place among the sensed scalars.
    touched
        The unknowns, shape (t,).
    act, sense
        Derivatives by them of what it acts along and of what it senses, shape (c, t).
    """

    name: str
    scalars: slice
    touched: IntArray
    act: FloatArray
    sense: FloatArray

    def tangent(self, by_gap: FloatArray, size: int) -> Triplets:
        """Return the stiffness of the law, n x n, from how all forces follow what is sensed, shape (c, c)."""
        own = Triplets.from_dense(-self.act.T @ by_gap[self.scalars, self.scalars] @ self.sense)
        return Triplets(size, self.touched[own.rows], self.touched[own.cols], own.values)


@dataclass(frozen=True, eq=False)
class _Potential:
    """Potential energy of a system at rest, its negative slope (what is out of balance) and its tangent."""

    system: System
    forces: LocalForces
    schedule: Schedule
    act: FloatArray
    sense: FloatArray
    touching: tuple[_Touching, ...]
    load: FloatArray

    @classmethod
    def of(cls, system: System, forces: LocalForces, schedule: Schedule, load: FloatArray) -> _Potential:
        """Return that of a cam angle, under a load of shape (n,)."""
        act = schedule.acting(0) @ forces.act.vectors
        sense = schedule.sensing(0) @ forces.sense.vectors
        each: list[_Touching] = []
        for one, part, _ in forces.parts:
            at = np.flatnonzero((act[part] != 0.0).any(axis=0) | (sense[part] != 0.0).any(axis=0))
            each.append(_Touching(one.name, part, at, act[part, at], sense[part, at]))
        return cls(system, forces, schedule, act, sense, tuple(each), load)

    def at(self, u: FloatArray) -> tuple[FloatArray, float, Triplets]:
        """Return the forces out of balance (n,), the size of the forces, and the tangent."""
        reaction, stiffness = self._reaction(u), self.system.stiffness
        strain, pushed = stiffness.times(u), reaction.force @ self.act
        local = [one.tangent(reaction.by_gap, stiffness.size) for one in self.touching]
        size = max(float(np.abs(part).max(initial=0.0)) for part in (self.load, strain, pushed))
        missing = self.load + pushed - strain
        return missing, max(size, np.finfo(float).tiny), Triplets.joined([stiffness, *local])

    def parts(self, u: FloatArray) -> list[tuple[str, Triplets]]:
        """Return name and stiffness of each local force."""
        reaction = self._reaction(u)
        return [(one.name, one.tangent(reaction.by_gap, self.system.size)) for one in self.touching]

    def _reaction(self, u: FloatArray) -> Reaction:
        still, states = np.zeros(self.forces.count), self.forces.start_state
        return self.forces.respond(self._gap(u), still, states, self.schedule)

    def _gap(self, u: FloatArray) -> FloatArray:
        return self.sense @ u + self.schedule.offset[0]

    def rounding(self, u: FloatArray) -> float:
        """Return what is left out of balance in the best of cases, the strain forces being sums of large parts."""
        K = self.system.stiffness
        parts = Triplets(K.size, K.rows, K.cols, np.abs(K.values)).times(np.abs(u))
        return _SUMS * float(np.finfo(float).eps) * float(parts.max(initial=0.0))

    def energy(self, u: FloatArray) -> float:
        """Return the potential energy; laws that store none count with nothing."""
        state = self.forces.start_state[None]
        stored = float(self.forces.stored_energy().at(self._gap(u)[None], state, self.schedule.angle)[0][0])
        return 0.5 * float(u @ self.system.stiffness.times(u)) - float(self.load @ u) + stored

    def shortened(
        self, u: FloatArray, step: FloatArray, missing: FloatArray, known: float | None
    ) -> tuple[float, float | None]:
        """Return the part of a step that lowers the energy enough, and the energy behind it; `known` is that before."""
        if not self.forces.storing.all():
            return 1.0, None  # a linear coupling: the whole step is right
        before, slope, part = self.energy(u) if known is None else known, float(missing @ step), 1.0
        for _ in range(_HALVINGS):
            after = self.energy(u + part * step)
            if after <= before - _DECREASE * part * slope + 1e-12 * abs(before):
                return part, after
            part *= 0.5
        return part, None


def _unbalanced(system: System, missing: FloatArray, free: FloatArray) -> RunFailedError:
    push = np.abs(free @ (free.T @ missing)) if free.shape[1] else np.zeros(1)
    if float(push.max()) > 1e-6 * float(np.abs(missing).max(initial=0.0)):
        furthest: list[int] = np.argsort(-push)[:4].tolist()
        moving = ", ".join(system.names[i] for i in furthest)
        text = f"no contact holds the mechanism against its loads; it moves off with {moving}"
        return RunFailedError(Status(Cause.SINGULAR, text, "install the springs with a force that closes the contacts"))
    text = "the contacts found no static balance"
    return RunFailedError(Status(Cause.NO_CONVERGENCE, text, "raise the installed forces, or soften a contact"))
