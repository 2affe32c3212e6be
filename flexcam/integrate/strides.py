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

_GONE = 1e-150
"""Motion that is none any more: what dies out further would end in numbers that processors handle very slowly."""


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

    def pushed(self, loads: FloatArray) -> FloatArray:
        """Return what loads push in every step, shape (m, n), from those at both ends of it, shape (m + 1, n)."""
        old = self.scheme.alpha_f
        push = self.light * loads
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
        scheme, old = self.scheme, self.scheme.alpha_f
        slow, stiff, heavy, new = self.slow, self.stiff, self.heavy, 1.0 - old
        damped, looks_back = bool(np.any(slow)), bool(scheme.alpha_m or old)
        q, v, a = begin
        for k, push in enumerate(pushed):
            right = push - old * (stiff * q + slow * v) - heavy * a if looks_back else push
            moving = v + (1.0 - scheme.gamma) * a
            moved = q + v + (0.5 - scheme.beta) * a
            pull = stiff * moved + slow * moving if damped else stiff * moved
            a = np.subtract(right, new * pull if old else pull, out=found[2, k])
            q = np.add(moved, scheme.beta * a, out=found[0, k])
            v = np.add(moving, scheme.gamma * a, out=found[1, k])

    def change(self) -> FloatArray:
        """Return by how much a step changes states, ``A - 1``, shape (3, 3, n).

        The difference keeps the digits that tell of a slow motion: those of A end where its frequency begins.
        """
        scheme, new = self.scheme, 1.0 - self.scheme.alpha_f
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
    states
        After every step, per unit of every state at the begin, shape (3, L, 3, n).
    pushes
        State at the end, per unit of the push at every instant, shape (3, L + 1, n).
    """

    length: int
    stiff: FloatArray
    change: FloatArray
    states: FloatArray
    pushes: FloatArray

    @classmethod
    def of(cls, steps: Steps, length: int) -> Stride | None:
        """Return that of a step; None where motions grow within it."""
        n = len(steps.stiff)
        begin, pushed, found = np.zeros((3, 4, n)), np.zeros((length, 4, n)), np.empty((3, length, 4, n))
        begin[[0, 1, 2], [0, 1, 2]], pushed[0, 3] = 1.0, 1.0
        steps.walk(begin, pushed, found)
        if not np.abs(found[:, :, :3]).max(initial=0.0) < _GROWN:
            return None
        pushes = _by_instant(found[:, :, 3], steps.scheme.alpha_f)
        change = _repeated(steps.change(), length)
        change[:, 0] = pushes.sum(axis=1)  # of a steady push; the displacement it balances would change by as much less
        return cls(length, steps.stiff, change, found[:, :, :3], pushes)

    def landed(self, begin: FloatArray, push: FloatArray, left: FloatArray) -> FloatArray:
        """Return the state a stride later, from the push at its begin and what changes of it left, shape (3, n)."""
        causes = begin.copy()
        causes[0] = push - self.stiff * begin[0]
        end = begin + np.einsum("oin,in->on", self.change, causes) + left
        end[np.abs(end) < _GONE] = 0.0
        return end


def _by_instant(pulse: FloatArray, old: float) -> FloatArray:
    """Return states at the end by the push at every instant, from those after every step by that of the first step.

    A step is pushed at its begin with the weight `old`, and with the rest at its end.
    """
    late = np.concatenate([np.zeros_like(pulse[:, :1]), pulse[:, ::-1]], axis=1)
    return (1.0 - old) * late + old * np.roll(late, -1, axis=1)


def _repeated(change: FloatArray, times: int) -> FloatArray:
    """Return ``A^L - 1`` from ``A - 1``: by doubling, without ever adding the one."""
    if times == 1:
        return change
    half = _repeated(change, times // 2)
    twice = 2.0 * half + _after(half, half)
    return twice + change + _after(change, twice) if times % 2 else twice


def _after(later: FloatArray, earlier: FloatArray) -> FloatArray:
    return np.einsum("oin,ifn->ofn", later, earlier)
