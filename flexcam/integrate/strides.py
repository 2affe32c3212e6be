"""Many steps of natural motions at once: a step is linear, so the state after many follows from one matrix product.

A motion is a state s = (q, h v, h^2 a), and a step of length h takes it to ``A s + b p``, with p what its load pushes.
After L steps it is ``A^L s`` and what the loads of these steps leave: both are known before the run begins.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from flexcam.integrate.problem import Problem
from flexcam.integrate.scheme import Scheme
from flexcam.linalg import FloatArray

_GROWN = 1e6
"""Growth over a stride beyond which a motion is walked step by step, to see where it leaves the range of numbers."""

_GONE = 1e-130
"""Added and taken away, it leaves nothing of a motion that is none any more, and everything of any other.

What dies out further would end in numbers that processors handle very slowly.
"""


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


@dataclass(frozen=True, eq=False)
class Steps:
    """A step of the generalized-alpha family, for every motion.

    Parameters
    ----------
    scheme
        The scheme.
    slow, stiff, heavy
        Damping, stiffness and inertia of the old instant, by what resists an acceleration, shape (n,).
    light
        What a load pushes, shape (n,).
    """

    scheme: Scheme
    slow: FloatArray
    stiff: FloatArray
    heavy: FloatArray
    light: FloatArray

    @classmethod
    def of(cls, scheme: Scheme, motions: Motions) -> Steps:
        """Return the step of some motions."""
        h, new = motions.step, 1.0 - scheme.alpha_f
        slow, stiff = h * motions.damping, h**2 * motions.stiffness
        whole = (1.0 - scheme.alpha_m) * motions.mass + new * (scheme.gamma * slow + scheme.beta * stiff)
        return cls(scheme, slow / whole, stiff / whole, scheme.alpha_m * motions.mass / whole, h**2 / whole)

    @property
    def old(self) -> float:
        """Weight of what acts at the begin of a step."""
        return self.scheme.alpha_f

    def pushed(self, loads: FloatArray) -> FloatArray:
        """Return what loads push in every step, shape (m, n), from those at both ends of it, shape (m + 1, n)."""
        old, push = self.old, self.light * loads
        return (1.0 - old) * push[1:] + old * push[:-1] if old else push[1:]

    def walk(self, begin: FloatArray, pushed: FloatArray, found: FloatArray) -> None:
        """Put the states after every step.

        Every motion has the same bits as if it were alone.

        Parameters
        ----------
        begin
            States, shape (3, ..., n).
        pushed
            Shape (m, ..., n).
        found
            Shape (3, m, ..., n).
        """
        scheme, old = self.scheme, self.old
        state = np.array(begin, order="C")
        q, v, a = state
        slow, stiff = (np.broadcast_to(one, q.shape).copy() for one in (self.slow, self.stiff))
        moved, moving, pull = (np.empty_like(q) for _ in range(3))
        damped, looks_back = bool(np.any(slow)), bool(scheme.alpha_m or old)
        for k, push in enumerate(pushed):
            right = push - old * (stiff * q + slow * v) - self.heavy * a if looks_back else push
            np.add(q, v, out=moved)
            moved += np.multiply(0.5 - scheme.beta, a, out=pull)
            np.multiply(1.0 - scheme.gamma, a, out=moving)
            moving += v
            np.multiply(stiff, moved, out=pull)
            if damped:
                pull += slow * moving
            np.subtract(right, (1.0 - old) * pull if old else pull, out=a)
            np.multiply(scheme.beta, a, out=q)
            q += moved
            np.multiply(scheme.gamma, a, out=v)
            v += moving
            found[:, k] = state

    def change(self) -> FloatArray:
        """Return by how much a step changes states, ``A - 1``, shape (3, 3, n).

        The difference keeps the digits that tell of a slow motion: those of A end where its frequency begins.
        """
        scheme, new = self.scheme, 1.0 - self.old
        by_v = new * self.stiff + self.slow
        by_a = self.heavy + new * ((0.5 - scheme.beta) * self.stiff + (1.0 - scheme.gamma) * self.slow)
        a = -np.array([self.stiff, by_v, by_a])
        one, no = np.ones_like(self.stiff), np.zeros_like(self.stiff)
        drift = [no, one, (0.5 - scheme.beta) * one], [no, no, (1.0 - scheme.gamma) * one], [no, no, -one]
        return np.array([scheme.beta * a, scheme.gamma * a, a]) + np.array(drift)


@dataclass(frozen=True, eq=False)
class Stride:
    """So many steps at once.

    What a stride changes is told by what is out of balance at its begin, and by how loads change from there: under a
    steady load both vanish, where sums of what each instant's load does would leave their rounding.

    Parameters
    ----------
    length
        L, steps.
    stiff
        What a displacement takes from the push, shape (n,).
    change
        Of states, by what pushes at the begin less what the displacement takes, by h v and by h^2 a, shape (3, 3, n).
    within
        States after every step by the same three, shape (3, L, 3, n); a displacement at the begin is to be added.
    answer
        States after every step, per unit of the push at the end of the first one, shape (3, L, n).
    """

    length: int
    stiff: FloatArray
    change: FloatArray
    within: FloatArray
    answer: FloatArray

    @classmethod
    def of(cls, steps: Steps, length: int) -> Stride | None:
        """Return that of a step; None where motions grow within it."""
        n = len(steps.stiff)
        begin, pushed, found = np.zeros((3, 4, n)), np.zeros((length, 4, n)), np.empty((3, length, 4, n))
        begin[[0, 1, 2], [0, 1, 2]], pushed[0, 3] = 1.0, 1.0
        steps.walk(begin, pushed, found)
        if not np.abs(found[:, :, :3]).max(initial=0.0) < _GROWN:
            return None
        within, pulse, change, old = found[:, :, :3], found[:, :, 3], _repeated(steps.change(), length), steps.old
        # Of a steady push; the displacement that it balances would change by as much less.
        within[:, :, 0], change[:, 0] = np.cumsum(pulse, axis=1), pulse.sum(axis=1)
        answer = (1.0 - old) * pulse
        answer[:, 1:] += old * pulse[:, :-1]  # a step is pushed by what acts at its begin too
        return cls(length, steps.stiff, change, within, answer)

    def land(self, begin: FloatArray, push: FloatArray, causes: FloatArray, end: FloatArray) -> None:
        """Put what changes a state under a push, and the state a stride later, where what loads add stands, (3, n)."""
        causes[:] = begin
        causes[0] = push - self.stiff * begin[0]
        end += np.einsum("oin,in->on", self.change, causes)
        end += begin
        end += _GONE
        end -= _GONE


def _repeated(change: FloatArray, times: int) -> FloatArray:
    """Return ``A^L - 1`` from ``A - 1``: by doubling, without ever adding the one."""
    if times == 1:
        return change
    half = _repeated(change, times // 2)
    twice = 2.0 * half + _after(half, half)
    return twice + change + _after(change, twice) if times % 2 else twice


def _after(later: FloatArray, earlier: FloatArray) -> FloatArray:
    return np.einsum("oin,ifn->ofn", later, earlier)
