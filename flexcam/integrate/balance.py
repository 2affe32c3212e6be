"""Static balance of a system whose local forces may be all that holds it: a train resting on its cam and its seat.

The balance is the least of the potential energy: strain, contacts, less the work of the loads. With contacts that only
push it is convex, so that Newton's method with a line search on it arrives from anywhere, whichever contacts open and
close on the way.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from flexcam.integrate.local import LocalForces, Schedule
from flexcam.linalg import (
    DENSE_LIMIT,
    TOO_MUCH,
    FloatArray,
    Triplets,
    diagonal_scale,
    factorize_held,
    null_space,
    share_lost,
)
from flexcam.response import BUCKLED, TOO_FINE, Cause, RunFailedError, Status
from flexcam.system import CamMotion, System

_MOST_ITERATIONS = 300
_TOLERANCE = 1e-9
"""Of the largest force, by which forces may miss their balance."""

_SUMS = 4.0
"""Roundings of a sum of a dozen parts, a few of which are large."""

_NEGATIVE = 1e-9
"""Eigenvalue of the scaled stiffness, of size 1, that is negative beyond rounding."""

_DECREASE, _HALVINGS = 1e-4, 40
_FALL = 0.01
"""Distance, m, that a part which nothing holds may fall in one iteration."""


def balanced(system: System, forces: LocalForces, load: FloatArray, motion: CamMotion) -> FloatArray:
    """Return the displacement at which loads, stiffness and local forces balance, at rest.

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
    free = null_space(system.stiffness) if system.free is None else system.free
    free = np.linalg.qr(free)[0] if free.shape[1] else free
    potential = _Potential(system, forces, forces.schedule(motion), load)
    u = np.zeros(system.size)
    # A soft hold of the free motions limits a step along them and vanishes with the step.
    hold = max(float(np.abs(free.T @ load).max(initial=0.0)) / _FALL, 1.0)
    before = np.inf
    for _ in range(_MOST_ITERATIONS):
        missing, size, tangent = potential.at(u)
        most = float(np.abs(missing).max(initial=0.0))
        if most <= _TOLERANCE * size or (0.5 * before <= most <= potential.rounding(u)):  # gets no better
            if most > _TOLERANCE * size and share_lost(system.stiffness, u) > TOO_MUCH:
                raise RunFailedError(TOO_FINE)
            _refuse_buckled(tangent, system)
            return u
        step = factorize_held(tangent, free, hold).solve(missing)
        u, before = u + potential.shortened(u, step, missing) * step, most
    missing, _, tangent = potential.at(u)
    _refuse_buckled(tangent, system)
    raise _unbalanced(system, missing, free)


def _refuse_buckled(tangent: Triplets, system: System) -> None:
    """Refuse a balance from which the smallest push leads away: the least of the energy lies elsewhere.

    Raises
    ------
    RunFailedError
        That names what buckles.
    """
    if system.size > 2 * DENSE_LIMIT or not system.local_forces:
        return
    scale = diagonal_scale(tangent)
    scaled = scale[:, None] * tangent.dense() * scale
    values, vectors = np.linalg.eigh(0.5 * (scaled + scaled.T))
    if values[0] >= -_NEGATIVE:
        return
    motion = np.abs(scale * vectors[:, 0])
    order: list[int] = np.argsort(-motion).tolist()
    moving = ", ".join(system.names[i] for i in order[:3])
    raise RunFailedError(replace(BUCKLED, text=f"{BUCKLED.text}; it gives way along {moving}"))


@dataclass(frozen=True, eq=False)
class _Potential:
    """Potential energy of a system at rest, its negative slope (what is out of balance) and its tangent."""

    system: System
    forces: LocalForces
    schedule: Schedule
    load: FloatArray

    def _gap(self, u: FloatArray) -> FloatArray:
        return self.schedule.sensing(0) @ (self.forces.sense.vectors @ u) + self.schedule.offset[0]

    def at(self, u: FloatArray) -> tuple[FloatArray, float, Triplets]:
        """Return the forces out of balance (n,), the size of the forces, and the tangent."""
        still, states = np.zeros(self.forces.count), self.forces.start_state
        reaction = self.forces.respond(self._gap(u), still, states, float(self.schedule.angle[0]))
        act = self.schedule.acting(0) @ self.forces.act.vectors
        sense = self.schedule.sensing(0) @ self.forces.sense.vectors
        strain, pushed = self.system.stiffness.times(u), reaction.force @ act
        coupled = np.argwhere(reaction.by_gap).tolist()
        local = [Triplets.outer(act[i], sense[j], -float(reaction.by_gap[i, j])) for i, j in coupled]
        tangent = Triplets.joined([self.system.stiffness, *local])
        size = max(float(np.abs(part).max(initial=0.0)) for part in (self.load, strain, pushed))
        return self.load + pushed - strain, max(size, np.finfo(float).tiny), tangent

    def rounding(self, u: FloatArray) -> float:
        """Return what is left out of balance in the best of cases, the strain forces being sums of large parts."""
        K = self.system.stiffness
        parts = Triplets(K.size, K.rows, K.cols, np.abs(K.values)).times(np.abs(u))
        return _SUMS * float(np.finfo(float).eps) * float(parts.max(initial=0.0))

    def energy(self, u: FloatArray) -> float:
        """Return the potential energy; laws that store none count with nothing."""
        state = self.forces.start_state[None]
        stored = float(self.forces.stored(self._gap(u)[None], state, self.schedule.angle[:1]).energy[0])
        return 0.5 * float(u @ self.system.stiffness.times(u)) - float(self.load @ u) + stored

    def shortened(self, u: FloatArray, step: FloatArray, missing: FloatArray) -> float:
        """Return the part of a step that lowers the energy enough."""
        if not self.forces.storing.all():
            return 1.0  # a linear coupling: the whole step is right
        before, slope, part = self.energy(u), float(missing @ step), 1.0
        for _ in range(_HALVINGS):
            if self.energy(u + part * step) <= before - _DECREASE * part * slope + 1e-12 * abs(before):
                return part
            part *= 0.5
        return part


def _unbalanced(system: System, missing: FloatArray, free: FloatArray) -> RunFailedError:
    push = np.abs(free @ (free.T @ missing)) if free.shape[1] else np.zeros(1)
    if float(push.max()) > 1e-6 * float(np.abs(missing).max(initial=0.0)):
        furthest: list[int] = np.argsort(-push)[:4].tolist()
        moving = ", ".join(system.names[i] for i in furthest)
        text = f"no contact holds the mechanism against its loads; it moves off with {moving}"
        return RunFailedError(Status(Cause.SINGULAR, text, "install the springs with a force that closes the contacts"))
    text = "the contacts found no static balance"
    return RunFailedError(Status(Cause.NO_CONVERGENCE, text, "raise the installed forces, or soften a contact"))
