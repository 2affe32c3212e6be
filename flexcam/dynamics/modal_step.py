"""A step of the generalized-alpha family for natural motions, which nothing couples: a dozen operations on arrays."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from flexcam.core import FloatArray, IntArray, LongArray
from flexcam.dynamics.generalized_alpha import Scheme, predict
from flexcam.dynamics.massless import BETA, GAMMA
from flexcam.dynamics.problem import Problem


@dataclass(frozen=True, eq=False)
class ModeParameters:
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
    def of(cls, problem: Problem) -> ModeParameters:
        """Return those of an uncoupled problem."""
        system = problem.system
        return cls(system.mass.diagonal(), system.damping.diagonal(), system.stiffness.diagonal(), problem.step)


@dataclass(frozen=True, eq=False)
class ModalStep:
    """A step of the generalized-alpha family, for every motion.

    Parameters
    ----------
    scheme
        The scheme.
    beta, gamma
        Its parameters, or, where a motion has neither mass nor damper, a number for each, shape (n,): see `led`.
    slowed
        Positions of motions without mass whose acceleration is the change of their velocity, for the same reason.
    slow, stiff, heavy
        Damping, stiffness and inertia of the old instant, by what resists an acceleration, shape (n,).
    light
        What a load pushes, shape (n,).
    """

    scheme: Scheme
    beta: float | FloatArray
    gamma: float | FloatArray
    slowed: IntArray
    slow: FloatArray
    stiff: FloatArray
    heavy: FloatArray
    light: FloatArray

    @classmethod
    def of(cls, scheme: Scheme, motions: ModeParameters) -> ModalStep:
        """Return the step of some motions."""
        h, new = motions.step, 1.0 - scheme.alpha_f
        slow, stiff = h * motions.damping, h**2 * motions.stiffness
        led = (motions.mass == 0.0) & (motions.damping == 0.0)
        beta, gamma = scheme.beta, scheme.gamma
        if led.any():
            beta, gamma = np.where(led, BETA, beta), np.where(led, GAMMA, gamma)
        whole = (1.0 - scheme.alpha_m) * motions.mass + new * (gamma * slow + beta * stiff)
        slowed = np.flatnonzero((motions.mass == 0.0) & ~led & scheme.average)
        heavy = scheme.alpha_m * motions.mass / whole
        return cls(scheme, beta, gamma, slowed, slow / whole, stiff / whole, heavy, h**2 / whole)

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
        """
        old = self.old
        state = np.array(begin, order="C")
        q, v, a = state
        slow, stiff = (np.broadcast_to(one, q.shape).copy() for one in (self.slow, self.stiff))
        pull = np.empty_like(q)
        damped, looks_back, lag = bool(np.any(slow)), bool(self.scheme.alpha_m or old), bool(len(self.slowed))
        for k, push in enumerate(pushed):
            right = push - old * (stiff * q + slow * v) - self.heavy * a if looks_back else push
            moved, moving = predict(q, v, a, 1.0, self.beta, self.gamma)
            np.multiply(stiff, moved, out=pull)
            if damped:
                pull += slow * moving
            np.subtract(right, (1.0 - old) * pull if old else pull, out=a)
            np.multiply(self.beta, a, out=q)
            q += moved
            before = v[..., self.slowed] if lag else v
            np.multiply(self.gamma, a, out=v)
            v += moving
            if lag:
                a[..., self.slowed] = v[..., self.slowed] - before
            found[:, k] = state

    def change(self) -> LongArray:
        """Return by how much a step changes states, ``A - 1``, and by a steady push, shape (3, 4, n).

        The difference keeps the digits that tell of a slow motion: those of A end where its frequency begins. What is
        rounded off here comes back in every stride, so that powers of it are taken in extended precision.
        """
        new = 1.0 - self.old
        slow, stiff, heavy = (one.astype(np.longdouble) for one in (self.slow, self.stiff, self.heavy))
        one, no = np.ones_like(stiff), np.zeros_like(stiff)
        by_a = heavy + new * ((0.5 - self.beta) * stiff + (1.0 - self.gamma) * slow)
        a = np.array([-stiff, -(new * stiff + slow), -by_a, one])
        unit = np.array([[one, no, no, no], [no, one, no, no], [no, no, one, no]])
        there, moving = predict(unit[0], unit[1], unit[2], 1.0, self.beta, self.gamma)
        drift = [there - unit[0], moving - unit[1], -unit[2]]
        change = np.array([self.beta * a, self.gamma * a, a]) + np.array(drift)
        change[2][:, self.slowed] = (change[1] + np.array([no, no, -one, no]))[:, self.slowed]
        return change


_FEWEST, USUAL, _LONG, _MOST = 16, 40, 64, 128
"""Steps of a stride: the longer, the less is done one after the other, and the less side by side."""

_SELDOM = 1024
"""Steps between saved fields from which strides are long."""

_GROWN = 1e6
"""Growth over a stride beyond which a motion is walked step by step, to see where it leaves the range of numbers."""

_GONE = 1e-130
"""Added and taken away, it leaves nothing of a motion that is none any more, and everything of any other.

What dies out further would end in numbers that processors handle very slowly.
"""


def stride_length(every: int) -> int:
    """Return the steps of a stride where motions are taken anew after every so many steps."""
    usual = USUAL if every < _SELDOM else _LONG
    even = [length for length in range(_FEWEST, _MOST + 1) if every % length == 0]
    if even:
        return min(even, key=lambda length: abs(length - usual))
    return every if every <= _MOST else min(range(usual - 8, usual + 8), key=lambda length: every % length)


@dataclass(frozen=True, eq=False)
class StepBlock:
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
        Of states, by what pushes at the begin less what the displacement takes, by h v and by h^2 a: by its causes,
        shape (3, 3, n).
    shift
        Of these causes, by themselves, shape (3, 3, n).
    within
        States after every step by the same three, shape (3, L, 3, n); a displacement at the begin is to be added.
    answer
        States after every step, per unit of the push at the end of the first one, shape (3, L, n).
    """

    length: int
    stiff: FloatArray
    change: FloatArray
    shift: FloatArray
    within: FloatArray
    answer: FloatArray

    @classmethod
    def of(cls, steps: ModalStep, length: int) -> StepBlock | None:
        """Return that of a step; None where motions grow within it."""
        n = len(steps.stiff)
        begin, pushed, found = np.zeros((3, 4, n)), np.zeros((length, 4, n)), np.empty((3, length, 4, n))
        begin[[0, 1, 2], [0, 1, 2]], pushed[0, 3] = 1.0, 1.0
        steps.walk(begin, pushed, found)
        if not np.abs(found[:, :, :3]).max(initial=0.0) < _GROWN:
            return None
        within, pulse, old = found[:, :, :3], found[:, :, 3], steps.old
        # By a steady push; the displacement that it balances would change it by as much less.
        within[:, :, 0] = np.cumsum(pulse, axis=1)
        change = _repeated(steps.change(), length)[:, [3, 1, 2]]
        shift = np.concatenate([-steps.stiff * change[:1], change[1:]]).astype(float)
        answer = (1.0 - old) * pulse
        answer[:, 1:] += old * pulse[:, :-1]  # a step is pushed by what acts at its begin too
        return cls(length, steps.stiff, change.astype(float), shift, within, answer)

    def causes(self, begin: FloatArray, push: FloatArray) -> FloatArray:
        """Return what changes a state under a push, shape (3, n)."""
        return np.concatenate([(push - self.stiff * begin[0])[None], begin[1:]])

    def land(self, begin: FloatArray, pushes: FloatArray, causes: FloatArray, ends: FloatArray) -> None:
        """Put where a state is after every stride, and what changes it there."""
        shifts = ends.copy()
        shifts[:, 0] *= -self.stiff
        shifts[:, 0] += pushes[1:] - pushes[:-1]
        for now, later, shift in zip(causes, causes[1:], shifts, strict=False):
            np.einsum("oin,in->on", self.shift, now, out=later)
            later += shift
            later += now
        ends += np.einsum("oin,bin->bon", self.change, causes[:-1])
        ends[0] += begin
        np.add.accumulate(ends, axis=0, out=ends)


def drop_vanished(state: FloatArray) -> FloatArray:
    """Return a state without the motions that are none any more."""
    return (state + _GONE) - _GONE


def _repeated(change: LongArray, times: int) -> LongArray:
    """Return ``A^L - 1`` from ``A - 1``: by doubling, without ever adding the one."""
    if times == 1:
        return change
    half = _repeated(change, times // 2)
    twice = 2.0 * half + _after(half, half)
    return twice + change + _after(change, twice) if times % 2 else twice


def _after(later: LongArray, earlier: LongArray) -> LongArray:
    return np.einsum("oin,ifn->ofn", later[:, :3], earlier)
