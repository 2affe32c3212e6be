"""The way through time of a linear system whose natural motions nothing couples: all of them side by side."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from flexcam.checkpoint import Arrays, below, flattened
from flexcam.integrate.engine import STOPPED, everything, first_track, in_range
from flexcam.integrate.local import LocalForces
from flexcam.integrate.moment import Track
from flexcam.integrate.problem import Problem
from flexcam.integrate.scheme import Scheme
from flexcam.integrate.uncoupled import Natural
from flexcam.linalg import FloatArray, IntArray
from flexcam.response import SaveAt, Stats, Status

State = tuple[FloatArray, FloatArray, FloatArray]
"""Amounts, velocities times the step and accelerations times its square: all three are of one size."""


@dataclass(frozen=True, eq=False)
class Motions:
    """Natural motions, and the length of a step.

    Parameters
    ----------
    mass, damping, stiffness
        Shape (n,).
    step
        s.
    """

    mass: FloatArray
    damping: FloatArray
    stiffness: FloatArray
    step: float

    @classmethod
    def of(cls, problem: Problem) -> Motions:
        """Return those of an uncoupled problem."""
        system = problem.system
        return cls(system.mass.diagonal(), system.damping.diagonal(), system.stiffness.diagonal(), problem.step)


def advance(scheme: Scheme, motions: Motions, begin: State, loads: FloatArray) -> State:
    """Return the states after every step of the generalized-alpha family.

    Parameters
    ----------
    scheme
        The scheme.
    motions
        The motions.
    begin
        At the start, shape (n,) each.
    loads
        On the motions, at the start and after every step, shape (m + 1, n).

    Returns
    -------
    tuple
        Three arrays of shape (m, n).
    """
    h, new, old = motions.step, 1.0 - scheme.alpha_f, scheme.alpha_f
    slow, stiff = h * motions.damping, h**2 * motions.stiffness
    whole = (1.0 - scheme.alpha_m) * motions.mass + new * (scheme.gamma * slow + scheme.beta * stiff)
    slow, stiff, heavy = slow / whole, stiff / whole, scheme.alpha_m * motions.mass / whole
    pushed = h**2 / whole * (new * loads[1:] + old * loads[:-1] if old else loads[1:])
    q, v, a = begin
    found = (np.empty_like(pushed), np.empty_like(pushed), np.empty_like(pushed))
    damped, looks_back = bool(np.any(slow)), bool(scheme.alpha_m or old)
    for k, push in enumerate(pushed):
        right = push - old * (stiff * q + slow * v) - heavy * a if looks_back else push
        moving = v + (1.0 - scheme.gamma) * a
        moved = q + v + (0.5 - scheme.beta) * a
        pull = stiff * moved + slow * moving if damped else stiff * moved
        a = right - (new * pull if old else pull)
        q, v = moved + scheme.beta * a, moving + scheme.gamma * a
        found[0][k], found[1][k], found[2][k] = q, v, a
    return found


class Superposed:
    """Walks through a linear problem in its natural motions.

    Parameters
    ----------
    problem
        `uncoupled`, without local forces, its damping diagonal.
    scheme
        Of the generalized-alpha family.
    save
        What is kept: at saved fields the amounts are taken anew from the unknowns, so that a run from there is this
        one bit by bit.
    stop
        Asked before every block of steps.
    natural
        The motions, for that.
    """

    def __init__(
        self, problem: Problem, scheme: Scheme, save: SaveAt, stop: Callable[[], bool], natural: Natural
    ) -> None:
        self._problem, self._system, self._scheme, self._stop = problem, problem.system, scheme, stop
        self._save, self._natural = save, natural
        self._motions = Motions.of(problem)
        self._forces = LocalForces(problem.system)
        self._last: tuple[Track, FloatArray] | None = None
        self._state: State = (np.zeros(0), np.zeros(0), np.zeros(0))

    def advance(self, steps: IntArray) -> tuple[Track, Status]:
        """Return the instants of some successive steps, as `Engine` says."""
        if self._stop():
            return Track.none(self._system.size, self._forces), STOPPED
        at = self._problem.times(steps)
        motion = self._problem.drive.at(at)
        loads = self._system.applied(motion)
        if self._last is None:
            track = first = first_track(self._problem, self._forces)
            self._state = self._scaled((first.d[0], first.v[0], first.a[0]))
            if len(steps) > 1:
                track = Track.joined([first, self._walked(loads, at[1:], steps[1:])])
        else:
            first, load = self._last
            track = self._walked(np.vstack([load, loads]), at, steps)
        before = None if self._last is None else everything(first)[-1]
        self._last = track.last(), loads[-1:]
        return in_range(track, before, self._system, motion.angle)

    def _walked(self, loads: FloatArray, at: FloatArray, steps: IntArray) -> Track:
        """Return the instants behind the last, in pieces from saved field to saved field."""
        state = self._state
        pieces: list[State] = []
        every = self._save.field_every
        for piece in np.split(np.arange(len(steps)), np.flatnonzero(steps[:-1] % every == 0) + 1):
            before = int(steps[piece[0]]) - 1
            if before and before % every == 0 and self._natural.exactly:
                state = self._taken_anew(state)
            pieces.append(advance(self._scheme, self._motions, state, loads[piece[0] : piece[-1] + 2]))
            state = (pieces[-1][0][-1], pieces[-1][1][-1], pieces[-1][2][-1])
        self._state = state  # as it is: a block's end must leave no rounding
        q, v, a = (np.concatenate([piece[i] for piece in pieces]) / self._problem.step**i for i in range(3))
        nothing = np.zeros((len(at), 0))
        return Track(at, q, v, a, nothing, nothing, nothing, np.arange(len(at)))

    def _taken_anew(self, state: State) -> State:
        """Return the amounts as they follow from the unknowns that are saved."""
        h, natural = self._problem.step, self._natural
        q, v, a = (natural.back @ natural.saved(one[None] / h**i)[0] for i, one in enumerate(state))
        return self._scaled((q, v, a))

    def _scaled(self, motion: tuple[FloatArray, FloatArray, FloatArray]) -> State:
        """Return amounts, velocities and accelerations as a state."""
        q, v, a = motion
        return q, v * self._problem.step, a * self._problem.step**2

    def counted(self, stats: Stats) -> Stats:
        """Return the figures as they are: there is nothing to iterate on."""
        return stats

    def state(self) -> Arrays:
        """Return the last instant, its load, and the amounts as they are stepped on, as `Engine` says."""
        if self._last is None:
            return {}
        track, load = self._last
        return {**flattened("last", track), "load": load, "amounts": np.array(self._state)}

    def restore(self, state: Arrays) -> None:
        """Go on, as `Engine` says."""
        self._last = (Track(**below("last", state)), state["load"])
        q, v, a = state["amounts"]
        self._state = (q, v, a)
