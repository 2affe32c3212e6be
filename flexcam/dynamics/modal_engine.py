"""Modal engine: advance modal coordinates in blocks of steps, and step by step where blocks are not possible."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

from flexcam.core import FloatArray, IntArray, LongArray
from flexcam.dynamics.blocks import Arrays
from flexcam.dynamics.engine import STOPPED, Engine, first_track, in_range, no_instants, stack_motion
from flexcam.dynamics.generalized_alpha import Scheme, predict
from flexcam.dynamics.local_forces import LocalForces
from flexcam.dynamics.massless import BETA, GAMMA
from flexcam.dynamics.problem import Problem
from flexcam.dynamics.status import Status
from flexcam.dynamics.step_state import Trajectory
from flexcam.dynamics.system import System


@dataclass(frozen=True, eq=False)
class ModalStep:
    """Step of the generalized-alpha family for every mode."""

    scheme: Scheme
    beta: float | FloatArray  #: of the scheme, or one per mode, shape (n,), if a mode has neither mass nor damper
    gamma: float | FloatArray  #: likewise, see `find_massless_motions`
    slowed: IntArray  #: massless motions whose acceleration is the change of their velocity
    damping: FloatArray  #: damping of the old instant divided by the effective mass, shape (n,)
    stiffness: FloatArray  #: stiffness, likewise
    inertia: FloatArray  #: inertia, likewise
    load_factor: FloatArray  #: factor of the load, shape (n,)

    @classmethod
    def of(cls, scheme: Scheme, system: System, h: float) -> ModalStep:
        """Return the step h, s, of a system whose matrices are diagonal."""
        new, mass = 1.0 - scheme.alpha_f, system.mass.diagonal()
        damping, stiffness = h * system.damping.diagonal(), h**2 * system.stiffness.diagonal()
        massless = (mass == 0.0) & (damping == 0.0)
        beta, gamma = scheme.beta, scheme.gamma
        if massless.any():
            beta, gamma = np.where(massless, BETA, beta), np.where(massless, GAMMA, gamma)
        effective = (1.0 - scheme.alpha_m) * mass + new * (gamma * damping + beta * stiffness)
        slowed = np.flatnonzero((mass == 0.0) & ~massless & scheme.average)
        inertia = scheme.alpha_m * mass / effective
        return cls(scheme, beta, gamma, slowed, damping / effective, stiffness / effective, inertia, h**2 / effective)

    @property
    def old(self) -> float:
        """Weight of the forces at the beginning of a step."""
        return self.scheme.alpha_f

    def modal_forces(self, loads: FloatArray) -> FloatArray:
        """Return the modal forces of every step, shape (m, n), from those at both ends, shape (m + 1, n)."""
        old, push = self.old, self.load_factor * loads
        return (1.0 - old) * push[1:] + old * push[:-1] if old else push[1:]

    def walk(self, begin: FloatArray, pushed: FloatArray, found: FloatArray) -> None:
        """Write the states after every step, independently per mode bit by bit."""
        old = self.old
        state = np.array(begin, order="C")
        q, v, a = state
        damping, stiffness = (np.broadcast_to(factors, q.shape).copy() for factors in (self.damping, self.stiffness))
        internal = np.empty_like(q)
        damped, looks_back, lag = bool(np.any(damping)), bool(self.scheme.alpha_m or old), bool(len(self.slowed))
        for k, push in enumerate(pushed):
            right = push - old * (stiffness * q + damping * v) - self.inertia * a if looks_back else push
            q_free, v_free = predict(q, v, a, 1.0, self.beta, self.gamma)
            np.multiply(stiffness, q_free, out=internal)
            if damped:
                internal += damping * v_free
            np.subtract(right, (1.0 - old) * internal if old else internal, out=a)
            np.multiply(self.beta, a, out=q)
            q += q_free
            before = v[..., self.slowed] if lag else v
            np.multiply(self.gamma, a, out=v)
            v += v_free
            if lag:
                a[..., self.slowed] = v[..., self.slowed] - before
            found[:, k] = state

    def change(self) -> LongArray:
        """Return the change of the state per step, ``A - 1``, and per constant force, shape (3, 4, n).

        The difference keeps the digits of slow modes, which A would lose. Its rounding recurs in every block, so powers
        of it are computed in extended precision.
        """
        new = 1.0 - self.old
        coefficients = self.damping, self.stiffness, self.inertia
        damping, stiffness, inertia = (factors.astype(np.longdouble) for factors in coefficients)
        ones, zeros = np.ones_like(stiffness), np.zeros_like(stiffness)
        by_a = inertia + new * ((0.5 - self.beta) * stiffness + (1.0 - self.gamma) * damping)
        a = np.array([-stiffness, -(new * stiffness + damping), -by_a, ones])
        unit = np.array([[ones, zeros, zeros, zeros], [zeros, ones, zeros, zeros], [zeros, zeros, ones, zeros]])
        q_free, v_free = predict(unit[0], unit[1], unit[2], 1.0, self.beta, self.gamma)
        drift = [q_free - unit[0], v_free - unit[1], -unit[2]]
        change = np.array([self.beta * a, self.gamma * a, a]) + np.array(drift)
        change[2][:, self.slowed] = (change[1] + np.array([zeros, zeros, -ones, zeros]))[:, self.slowed]
        return change


BLOCK = 40
"""Steps of a block: longer blocks need fewer sequential and more parallel operations."""

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
    stiffness: FloatArray  #: force per displacement, shape (n,)
    change: FloatArray  #: of states per cause: initial residual force, h v and h^2 a, shape (3, 3, n)
    shift: FloatArray  #: change of the causes per cause, shape (3, 3, n)
    answer: FloatArray  #: states after every step per unit force at the end of the first one, shape (3, L, n)

    @classmethod
    def of(cls, steps: ModalStep, length: int) -> StepBlock | None:
        """Return the block of a step; None if motions grow within it."""
        n = len(steps.stiffness)
        begin, pushed, states = np.zeros((3, 4, n)), np.zeros((length, 4, n)), np.empty((3, length, 4, n))
        begin[[0, 1, 2], [0, 1, 2]], pushed[0, 3] = 1.0, 1.0
        steps.walk(begin, pushed, states)
        if not np.abs(states[:, :, :3]).max(initial=0.0) < _GROWTH_LIMIT:
            return None
        pulse, old = states[:, :, 3], steps.old
        # Of a constant force; the displacement in equilibrium would cause the opposite change.
        change = _power(steps.change(), length)[:, [3, 1, 2]]
        shift = np.concatenate([-steps.stiffness * change[:1], change[1:]]).astype(float)
        answer = (1.0 - old) * pulse
        answer[:, 1:] += old * pulse[:, :-1]  # forces at the beginning of a step act as well
        return cls(length, steps.stiffness, change.astype(float), shift, answer)

    def end_states(self, pushes: FloatArray) -> FloatArray:
        """Return the state at the end per unit of every load history at every instant, shape (k (L + 1), 3 n).

        `pushes` are the modal forces of unit load histories, shape (k, n).
        """
        responses = np.concatenate([np.zeros((3, 1, len(self.stiffness))), self.answer[:, ::-1]], axis=1)
        parts = np.einsum("kn,sjn->kjsn", pushes, responses)
        return parts.reshape(parts.shape[0] * parts.shape[1], 3 * len(self.stiffness))

    def advance(self, begin: FloatArray, pushes: FloatArray, ends: FloatArray) -> None:
        """Write the states after every block; `ends` are those due to the changes of load within each block."""
        shifts, causes = ends.copy(), np.empty((len(ends) + 1, *begin.shape))
        shifts[:, 0] *= -self.stiffness
        shifts[:, 0] += pushes[1:] - pushes[:-1]
        causes[0] = pushes[0] - self.stiffness * begin[0], begin[1], begin[2]
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
    twice = 2.0 * half + _compose(half, half)
    return twice + change + _compose(change, twice) if times % 2 else twice


def _compose(later: LongArray, earlier: LongArray) -> LongArray:
    return np.einsum("oin,ifn->ofn", later[:, :3], earlier)


class ModalEngine(Engine):
    """Engine of a linear problem (`modal_problem`), whose damping is diagonal; `stop` is called before every call.

    Its state is that at the end of the last complete block: a call begins there again, so that blocks have one length.
    """

    def __init__(self, problem: Problem, scheme: Scheme, stop: Callable[[], bool]) -> None:
        self._problem, self._system, self._stop = problem, problem.system, stop
        self._forces, self._vectors = LocalForces(problem.system), problem.system.load_vectors()
        self._at: int = -1  # step of the state, -1 before the start
        self._state = np.zeros((3, problem.system.size))  # coordinates and their rates times powers of the step
        self._scale = problem.step ** np.arange(3.0)[:, None, None]
        self._steps = ModalStep.of(scheme, problem.system, problem.step)
        self._block = StepBlock.of(self._steps, BLOCK)
        self._pushes = self._steps.load_factor * self._vectors  # modal forces of unit load histories, shape (k, n)
        self._end_states = np.zeros((0, 0)) if self._block is None else self._block.end_states(self._pushes)

    def advance(self, steps: IntArray) -> tuple[Trajectory, Status]:
        """Return the instants of some successive steps, see `Engine`."""
        if self._stop():
            return no_instants(self._system.size, self._forces), STOPPED
        first, times = self._first_instant(), self._problem.times(steps)
        row = int(steps[0]) - self._at
        states = self._advance_states(int(steps[-1]))
        states[1:] /= self._scale[1:]
        if first is None:
            track = self._track(times, states[:, row:])
        else:  # the first instant is unchanged
            track = first if len(times) == 1 else Trajectory.concatenate([first, self._track(times[1:], states[:, 1:])])
        before = None if first is not None else stack_motion(self._track(times[:1], states[:, row - 1 : row]))[0]
        return in_range(track, before, self._system, self._problem.drive.at(times).angle)

    def _first_instant(self) -> Trajectory | None:
        if self._at >= 0:
            return None
        first = first_track(self._problem, self._forces)
        self._at, self._state = 0, np.array([first.d[0], first.v[0], first.a[0]]) * self._scale[:, 0]
        return first

    def _advance_states(self, last: int) -> FloatArray:
        """Return the states from the current one up to a step, shape (3, m + 1, n), and advance the current one."""
        times = self._problem.times(np.arange(self._at, last + 1))
        histories = self._system.load_histories(self._problem.drive.at(times))
        if self._block is None:
            forces = self._steps.modal_forces(histories @ self._vectors)
            states = np.empty((3, len(histories), self._system.size))
            states[:, 0] = self._state
            self._steps.walk(self._state, forces, states[:, 1:])
            self._at, self._state = last, states[:, -1].copy()
            return states
        return self._advance_blocks(self._block, histories)

    def _advance_blocks(self, block: StepBlock, histories: FloatArray) -> FloatArray:
        """Return the states of steps in blocks, the last of which may extend beyond the last step."""
        steps, length, n = len(histories) - 1, block.length, self._system.size
        if not steps:
            return self._state[:, None].copy()
        count = -(-steps // length)
        histories = np.concatenate([histories, np.zeros((count * length - steps, histories.shape[1]))])
        begins, ends = self._advance_ends(block, histories, count)
        states = np.empty((3, count * length + 1, n))
        states[:, 0] = self._state
        pushes = self._steps.modal_forces(histories @ self._vectors).reshape(count, length, n).swapaxes(0, 1)
        by_block = states[:, 1:].reshape(3, count, length, n).swapaxes(1, 2)
        self._steps.walk(begins.swapaxes(0, 1), pushes, by_block)
        states[:, length::length] = ends.swapaxes(0, 1)
        if complete := steps // length:
            self._at += complete * length
            self._state = ends[complete - 1]
        return states[:, : steps + 1]

    def _advance_ends(self, block: StepBlock, histories: FloatArray, count: int) -> tuple[FloatArray, FloatArray]:
        """Return the states at the beginnings and ends of blocks, shape (b, 3, n)."""
        length = block.length
        windows = sliding_window_view(histories, length + 1, axis=0)[::length]
        rising = (windows - windows[:, :, :1]).reshape(count, -1)
        pushes = histories[::length] @ self._pushes
        state = drop_vanished(self._state)
        ends = (rising @ self._end_states).reshape(count, *state.shape)
        block.advance(state, pushes, ends)
        return np.concatenate([state[None], ends])[:count], ends

    def _track(self, times: FloatArray, states: FloatArray) -> Trajectory:
        (d, v, a), empty, sides = states, np.zeros((len(times), 0)), np.zeros((len(times), 0), dtype=bool)
        return Trajectory(times, d, v, a, empty, empty, empty, sides, np.arange(len(times)))

    def state(self) -> Arrays:
        """Return the state of the modes, see `Engine`."""
        return {"at": np.array(self._at), "amounts": self._state}

    def restore(self, state: Arrays) -> None:
        """Restore the state, see `Engine`."""
        self._at, self._state = int(state["at"]), state["amounts"]
