"""A step of the generalized-alpha family for natural motions, which nothing couples: a dozen operations on arrays."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from flexcam.integrate.generalized_alpha import Scheme, predict
from flexcam.integrate.led import BETA, GAMMA
from flexcam.integrate.problem import Problem
from flexcam.linalg import FloatArray, IntArray, LongArray


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
    def of(cls, scheme: Scheme, motions: Motions) -> Steps:
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
        there, moving = predict(*unit, 1.0, self.beta, self.gamma)
        drift = [there - unit[0], moving - unit[1], -unit[2]]
        change = np.array([self.beta * a, self.gamma * a, a]) + np.array(drift)
        change[2][:, self.slowed] = (change[1] + np.array([no, no, -one, no]))[:, self.slowed]
        return change
