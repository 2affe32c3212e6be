"""Step of the generalized-alpha family in modal coordinates: a dozen array operations."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from flexcam.core import FloatArray, IntArray, LongArray
from flexcam.dynamics.generalized_alpha import Scheme, predict
from flexcam.dynamics.massless import BETA, GAMMA
from flexcam.dynamics.system import System


@dataclass(frozen=True, eq=False)
class ModalStep:
    """Step of the generalized-alpha family for every mode."""

    scheme: Scheme
    beta: float | FloatArray  #: of the scheme, or one per mode, shape (n,), if a mode has neither mass nor damper
    gamma: float | FloatArray  #: likewise, see `find_massless_motions`
    slowed: IntArray  #: massless motions whose acceleration is the change of their velocity
    slow: FloatArray  #: damping of the old instant divided by the effective mass, shape (n,)
    stiff: FloatArray  #: stiffness, likewise
    heavy: FloatArray  #: inertia, likewise
    light: FloatArray  #: factor of the load, shape (n,)

    @classmethod
    def of(cls, scheme: Scheme, system: System, h: float) -> ModalStep:
        """Return the step h, s, of a system whose matrices are diagonal."""
        new, mass = 1.0 - scheme.alpha_f, system.mass.diagonal()
        slow, stiff = h * system.damping.diagonal(), h**2 * system.stiffness.diagonal()
        led = (mass == 0.0) & (slow == 0.0)
        beta, gamma = scheme.beta, scheme.gamma
        if led.any():
            beta, gamma = np.where(led, BETA, beta), np.where(led, GAMMA, gamma)
        whole = (1.0 - scheme.alpha_m) * mass + new * (gamma * slow + beta * stiff)
        slowed = np.flatnonzero((mass == 0.0) & ~led & scheme.average)
        heavy = scheme.alpha_m * mass / whole
        return cls(scheme, beta, gamma, slowed, slow / whole, stiff / whole, heavy, h**2 / whole)

    @property
    def old(self) -> float:
        """Weight of the forces at the beginning of a step."""
        return self.scheme.alpha_f

    def modal_forces(self, loads: FloatArray) -> FloatArray:
        """Return the modal forces of every step, shape (m, n), from those at both ends, shape (m + 1, n)."""
        old, push = self.old, self.light * loads
        return (1.0 - old) * push[1:] + old * push[:-1] if old else push[1:]

    def walk(self, begin: FloatArray, pushed: FloatArray, found: FloatArray) -> None:
        """Write the states after every step, independently per mode bit by bit."""
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
        """Return the change of the state per step, ``A - 1``, and per constant force, shape (3, 4, n).

        The difference keeps the digits of slow modes, which A would lose. Its rounding recurs in every block, so powers
        of it are computed in extended precision.
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


MODAL_BLOCK, PROBE_BLOCK = 40, 64
"""Steps of a block: longer blocks need fewer sequential and more parallel operations, which pays if probes suffice."""

_GROWTH_LIMIT = 1e6
"""Growth over a block above which a mode is advanced step by step, to locate divergence."""

_VANISHING_OFFSET = 1e-130
"""Constant that, added and subtracted, removes vanished motions and leaves others unchanged.

Motions that decay further would become denormal numbers, which are very slow.
"""


@dataclass(frozen=True, eq=False)
class StepBlock:
    """A block of steps in one operation.

    The change of state depends on the initial residual force and on the change of loads from there. Under a constant
    load both vanish, whereas sums of the effects of single instants would accumulate rounding.
    """

    length: int  #: L, steps
    stiff: FloatArray  #: force per displacement, shape (n,)
    change: FloatArray  #: of states per cause: initial residual force, h v and h^2 a, shape (3, 3, n)
    shift: FloatArray  #: change of the causes per cause, shape (3, 3, n)
    within: FloatArray  #: states after every step per cause, without initial displacement, shape (3, L, 3, n)
    answer: FloatArray  #: states after every step per unit force at the end of the first one, shape (3, L, n)

    @classmethod
    def of(cls, steps: ModalStep, length: int) -> StepBlock | None:
        """Return the block of a step; None if motions grow within it."""
        n = len(steps.stiff)
        begin, pushed, found = np.zeros((3, 4, n)), np.zeros((length, 4, n)), np.empty((3, length, 4, n))
        begin[[0, 1, 2], [0, 1, 2]], pushed[0, 3] = 1.0, 1.0
        steps.walk(begin, pushed, found)
        if not np.abs(found[:, :, :3]).max(initial=0.0) < _GROWTH_LIMIT:
            return None
        within, pulse, old = found[:, :, :3], found[:, :, 3], steps.old
        # By a constant force; the displacement in equilibrium would cause the opposite change.
        within[:, :, 0] = np.cumsum(pulse, axis=1)
        change = _power(steps.change(), length)[:, [3, 1, 2]]
        shift = np.concatenate([-steps.stiff * change[:1], change[1:]]).astype(float)
        answer = (1.0 - old) * pulse
        answer[:, 1:] += old * pulse[:, :-1]  # forces at the beginning of a step act as well
        return cls(length, steps.stiff, change.astype(float), shift, within, answer)

    def causes(self, begin: FloatArray, push: FloatArray) -> FloatArray:
        """Return the causes of change of a state under a force, shape (3, n)."""
        return np.concatenate([(push - self.stiff * begin[0])[None], begin[1:]])

    def advance(self, begin: FloatArray, pushes: FloatArray, causes: FloatArray, ends: FloatArray) -> None:
        """Write the states after every block and their causes of change."""
        shifts = ends.copy()
        shifts[:, 0] *= -self.stiff
        shifts[:, 0] += pushes[1:] - pushes[:-1]
        for now, later, shift in zip(causes, causes[1:], shifts, strict=False):
            np.einsum("oin,in->on", self.shift, now, out=later)
            later += shift
            later += now
        ends += np.einsum("oin,bin->bon", self.change, causes[:-1])
        ends[:1] += begin
        np.add.accumulate(ends, axis=0, out=ends)


def drop_vanished(state: FloatArray) -> FloatArray:
    """Return a state without vanished motions."""
    return (state + _VANISHING_OFFSET) - _VANISHING_OFFSET


def _power(change: LongArray, times: int) -> LongArray:
    """Return ``A^L - 1`` from ``A - 1`` by doubling, without adding the identity."""
    if times == 1:
        return change
    half = _power(change, times // 2)
    twice = 2.0 * half + _after(half, half)
    return twice + change + _after(change, twice) if times % 2 else twice


def _after(later: LongArray, earlier: LongArray) -> LongArray:
    return np.einsum("oin,ifn->ofn", later[:, :3], earlier)
