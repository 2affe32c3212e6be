"""Modal engine: advance modal coordinates in blocks of steps, and step by step where blocks are not possible."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import NDArray

from flexcam.core import FloatArray, IntArray, LongArray
from flexcam.dynamics.blocks import Arrays, SaveAt, Series
from flexcam.dynamics.engine import STOPPED, Engine, all_within, first_track, in_range, no_instants, stack_motion
from flexcam.dynamics.generalized_alpha import Scheme, predict
from flexcam.dynamics.local_forces import LocalForces
from flexcam.dynamics.massless import BETA, GAMMA
from flexcam.dynamics.problem import Problem
from flexcam.dynamics.status import Status
from flexcam.dynamics.step_state import ProbeTrajectory, Trajectory
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
    stiffness: FloatArray  #: force per displacement, shape (n,)
    change: FloatArray  #: of states per cause: initial residual force, h v and h^2 a, shape (3, 3, n)
    shift: FloatArray  #: change of the causes per cause, shape (3, 3, n)
    by_cause: FloatArray  #: states after every step per cause, without initial displacement, shape (3, L, 3, n)
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
        by_cause, pulse, old = states[:, :, :3], states[:, :, 3], steps.old
        # By a constant force; the displacement in equilibrium would cause the opposite change.
        by_cause[:, :, 0] = np.cumsum(pulse, axis=1)
        change = _power(steps.change(), length)[:, [3, 1, 2]]
        shift = np.concatenate([-steps.stiffness * change[:1], change[1:]]).astype(float)
        answer = (1.0 - old) * pulse
        answer[:, 1:] += old * pulse[:, :-1]  # forces at the beginning of a step act as well
        return cls(length, steps.stiffness, change.astype(float), shift, by_cause, answer)

    def causes(self, begin: FloatArray, push: FloatArray) -> FloatArray:
        """Return the causes of change of a state under a force, shape (3, n)."""
        return np.concatenate([(push - self.stiffness * begin[0])[None], begin[1:]])

    def advance(self, begin: FloatArray, pushes: FloatArray, causes: FloatArray, ends: FloatArray) -> None:
        """Write the states after every block and their causes of change."""
        shifts = ends.copy()
        shifts[:, 0] *= -self.stiffness
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
    twice = 2.0 * half + _compose(half, half)
    return twice + change + _compose(change, twice) if times % 2 else twice


def _compose(later: LongArray, earlier: LongArray) -> LongArray:
    return np.einsum("oin,ifn->ofn", later[:, :3], earlier)


@dataclass(frozen=True, eq=False)
class StepBlocks:
    """Successive blocks of steps, or single steps."""

    begins: FloatArray  #: states at the beginning of blocks, shape (b, 3, n)
    ends: FloatArray  #: states at their end, shape (b, 3, n)
    causes: FloatArray  #: causes of the change of state in a block, shape (b, 3, n)
    rising: FloatArray  #: load histories over every block minus their initial values, shape (b, k (L + 1))
    states: FloatArray | None = None  #: after every step of a sequence without blocks, shape (3, m, n)


class ModalPropagator:
    """State of the modes and its propagation through `modal_problem`, whose damping is diagonal.

    The state is that at the end of the last complete block: a call begins there again, so that blocks have one length.
    """

    def __init__(self, problem: Problem, scheme: Scheme, length: int) -> None:
        self._problem, self._vectors = problem, problem.system.load_vectors()
        self.at: int = -1  #: step of the state, -1 before the start
        self.state = np.zeros((3, problem.system.size))  #: coordinates and their rates times powers of the step, (3, n)
        self.steps = ModalStep.of(scheme, problem.system, problem.step)
        self.stride = StepBlock.of(self.steps, length)
        self.pushes = self.steps.load_factor * self._vectors  #: modal forces of unit load histories, shape (k, n)
        self._end_states = np.zeros((0, 0)) if self.stride is None else self._by_history(self.stride)
        self.scale = problem.step ** np.arange(3.0)[:, None]  #: powers of the step

    @property
    def length(self) -> int:
        """Steps of a block; none if motions grow within one."""
        return self.stride.length if self.stride else 0

    def _by_history(self, stride: StepBlock) -> FloatArray:
        """Return states at the end of a block per unit of every history at every instant, shape (k (L + 1), 3 n)."""
        responses = np.concatenate([np.zeros((3, 1, len(stride.stiffness))), stride.answer[:, ::-1]], axis=1)
        parts = np.einsum("kn,sjn->kjsn", self.pushes, responses)
        return parts.reshape(parts.shape[0] * parts.shape[1], self.state.size)

    def begin(self, first: Trajectory) -> None:
        """Begin at an instant."""
        self.at, self.state = 0, np.array([first.d[0], first.v[0], first.a[0]]) * self.scale

    def histories(self, last: int) -> FloatArray:
        """Return the load histories from the state up to a step, padded with zeros to the end of a block."""
        times = self._problem.times(np.arange(self.at, last + 1))
        values = self._problem.system.load_histories(self._problem.drive.at(times))
        return np.concatenate([values, np.zeros((self.length, values.shape[1]))])

    def modal_forces(self, histories: FloatArray) -> FloatArray:
        """Return the modal forces of every step, shape (m, n), from load histories, shape (m + 1, k)."""
        return self.steps.modal_forces(histories @ self._vectors)

    def advance(self, last: int, histories: FloatArray) -> StepBlocks:
        """Return the steps up to one, where the last block may extend beyond it, and advance the state."""
        if self.stride is None:
            return self._single(last, histories)
        length, steps = self.length, last - self.at
        count = -(-steps // length)
        windows = sliding_window_view(histories, length + 1, axis=0)[: count * length : length]
        rising = (windows - windows[:, :, :1]).reshape(count, windows.shape[1] * windows.shape[2])
        pushes = histories[: count * length + 1 : length] @ self.pushes
        state, causes = drop_vanished(self.state), np.empty((count + 1, *self.state.shape))
        causes[0] = self.stride.causes(state, pushes[0])
        ends = (rising @ self._end_states).reshape(count, *self.state.shape)
        self.stride.advance(state, pushes, causes, ends)
        complete = steps // length
        if complete:
            self.at += complete * length
            self.state = ends[complete - 1]
        return StepBlocks(np.concatenate([state[None], ends])[:count], ends, causes[:-1], rising)

    def _single(self, last: int, histories: FloatArray) -> StepBlocks:
        forces = self.modal_forces(histories)
        states = np.empty((3, *forces.shape))
        self.steps.walk(self.state, forces, states)
        if last > self.at:
            self.at, self.state = last, states[:, -1].copy()
        empty = np.zeros((0, *self.state.shape))
        return StepBlocks(empty, empty, empty, empty[:, 0], states)


class ModalEngine(Engine):
    """Engine of a linear problem (`modal_problem`); `stop` is called before every block of steps."""

    def __init__(self, problem: Problem, scheme: Scheme, stop: Callable[[], bool], length: int = MODAL_BLOCK) -> None:
        self._problem, self._system, self._stop = problem, problem.system, stop
        self._forces = LocalForces(problem.system)
        self._propagator = ModalPropagator(problem, scheme, length)

    def advance(self, steps: IntArray) -> tuple[Trajectory, Status]:
        """Return the instants of some successive steps, see `Engine`."""
        if self._stop():
            return no_instants(self._system.size, self._forces), STOPPED
        first, times = self._first_instant(), self._problem.times(steps)
        row = int(steps[0]) - self._propagator.at
        states = self._advance_states(int(steps[-1]))
        states[1:] /= self._propagator.scale[1:, None]
        if first is None:
            track = self._track(times, states[:, row:])
        else:  # the first instant is unchanged
            track = first if len(times) == 1 else Trajectory.concatenate([first, self._track(times[1:], states[:, 1:])])
        before = None if first is not None else stack_motion(self._track(times[:1], states[:, row - 1 : row]))[0]
        return in_range(track, before, self._system, self._problem.drive.at(times).angle)

    def _first_instant(self) -> Trajectory | None:
        if self._propagator.at >= 0:
            return None
        first = first_track(self._problem, self._forces)
        self._propagator.begin(first)
        return first

    def _advance_states(self, last: int) -> FloatArray:
        """Return the states from the current one up to a step, shape (3, m + 1, n)."""
        modes, count, n = self._propagator, last - self._propagator.at + 1, self._system.size
        histories, begin = modes.histories(last), modes.state
        part = modes.advance(last, histories)
        if part.states is not None:
            return np.concatenate([begin[:, None], part.states], axis=1)
        blocks, length = len(part.begins), modes.length
        end = blocks * length
        states = np.empty((3, end + 1, n))
        states[:, 0] = begin
        pushes = modes.modal_forces(histories)[:end].reshape(blocks, length, n).swapaxes(0, 1)
        by_block = states[:, 1:].reshape(3, blocks, length, n).swapaxes(1, 2)
        modes.steps.walk(part.begins.swapaxes(0, 1), pushes, by_block)
        states[:, length::length] = part.ends.swapaxes(0, 1)
        return states[:, :count]

    def _track(self, times: FloatArray, states: FloatArray) -> Trajectory:
        (d, v, a), empty, sides = states, np.zeros((len(times), 0)), np.zeros((len(times), 0), dtype=bool)
        return Trajectory(times, d, v, a, empty, empty, empty, sides, np.arange(len(times)))

    def state(self) -> Arrays:
        """Return the state of the modes, see `Engine`."""
        return {"at": np.array(self._propagator.at), "amounts": self._propagator.state}

    def restore(self, state: Arrays) -> None:
        """Restore the state, see `Engine`."""
        self._propagator.at, self._propagator.state = int(state["at"]), state["amounts"]


@dataclass(frozen=True, eq=False)
class OutputMatrices:
    """Matrices for the motion of p rows in a block."""

    rows: FloatArray  #: shape (p, n)
    matrix: FloatArray  #: motion after every step per cause and per change of load, shape (3 n + k (L + 1), L 3 p)

    @classmethod
    def of(cls, rows: FloatArray, course: ModalPropagator) -> OutputMatrices:
        """Return the matrices for a propagator with blocks."""
        stride, length, count = course.stride, course.length, 3 * len(rows)
        if stride is None:  # without blocks no motion is computed from them
            return cls(rows, np.zeros((0, 0)))
        causes, histories = 3 * rows.shape[1], len(course.pushes)
        matrix = np.zeros((causes + histories * (length + 1), length, count))
        by_cause = np.einsum("sjcn,pn->cnjsp", stride.by_cause / course.scale[:, None, None], rows)
        matrix[:causes] = by_cause.reshape(causes, length, count)
        answers = np.einsum("sjn,knp->kjsp", stride.answer / course.scale[:, None], course.pushes[:, :, None] * rows.T)
        answers = answers.reshape(histories, length, count)
        by_load = matrix[causes:].reshape(histories, length + 1, length, count)
        for instant in range(1, length + 1):  # forces act from their instant on
            by_load[:, instant, instant - 1 :] = answers[:, : length + 1 - instant]
        return cls(rows, matrix.reshape(len(matrix), length * count))

    def evaluate(self, part: StepBlocks) -> FloatArray:
        """Return displacements, velocities and accelerations after every step of blocks, shape (m, 3, p)."""
        count, p = len(part.begins), len(self.rows)
        result = np.concatenate([part.causes.reshape(count, -1), part.rising], axis=1) @ self.matrix
        result = result.reshape(count, -1, 3, p)
        result[:, :, 0] += (part.begins[:, 0] @ self.rows.T)[:, None]
        return result.reshape(-1, 3, p)


class ProbeEngine(ModalEngine):
    """Engine of a linear problem in modal coordinates that computes only the probes."""

    def __init__(self, problem: Problem, scheme: Scheme, save: SaveAt, stop: Callable[[], bool]) -> None:
        super().__init__(problem, scheme, stop, PROBE_BLOCK)
        self._save = save
        self._view = OutputMatrices.of(probe_rows(problem), self._propagator)

    def advance_probes(self, steps: IntArray) -> tuple[ProbeTrajectory, Status]:
        """Return the saved results of successive steps, up to the last in range, and a status, see `Engine`."""
        rows = self._view.rows
        if self._stop():
            probes, motion = np.zeros((3, 0, len(rows))), np.zeros((3, 0, self._system.size))
            return ProbeTrajectory(np.zeros(0), Series(*probes), Series(*motion)), STOPPED
        saved, earlier = self._save.fields(steps, self._problem.steps), self.state()
        if self._propagator.stride is not None and (history := self._evaluate(steps, saved)) is not None:
            return history, Status()
        self.restore(earlier)  # instant by instant where motions grow, to find the diverging one
        track, status = self.advance(steps)
        motion = Series(track.d, track.v, track.a)
        probes = Series(*(values @ rows.T for values in motion))
        return ProbeTrajectory(track.time, probes, motion.at(saved[: len(track.time)])), status

    def _evaluate(self, steps: IntArray, saved: NDArray[np.bool_]) -> ProbeTrajectory | None:
        """Return the saved results of steps; None if a value diverges."""
        first, modes = self._first_instant(), self._propagator
        begin, times = modes.at, self._problem.times(steps)
        histories, rows = modes.histories(int(steps[-1])), steps[saved] - begin
        values = np.empty((len(histories), 3, len(self._view.rows)))
        fields = np.empty((3, len(rows), self._system.size))
        if first is not None:
            fields[:, 0] = first.d[0], first.v[0], first.a[0]
            values[0] = fields[:, 0] @ self._view.rows.T
        part = modes.advance(int(steps[-1]), histories)
        outputs, later = self._view.evaluate(part), rows > 0
        values[1 : 1 + len(outputs)] = outputs
        fields[:, later] = self._states(part, rows[later], histories) / modes.scale[:, None]
        values = values[int(steps[0]) - begin : int(steps[-1]) - begin + 1]
        if not (all_within(values) and all_within(fields) and all_within(modes.state)):
            return None
        return ProbeTrajectory(times, Series(*values.swapaxes(0, 1)), Series(*fields))

    def _states(self, part: StepBlocks, rows: IntArray, histories: FloatArray) -> FloatArray:
        """Return the states after selected steps, counted from the state before them, shape (3, r, n)."""
        block, step = np.divmod(rows - 1, self._propagator.length)
        result = part.ends[block].swapaxes(0, 1).copy()
        last = self._propagator.length - 1  # the last step of a run may not end a block
        for i in np.flatnonzero(step < last).tolist():
            row = int(block[i]) * self._propagator.length
            forces = self._propagator.modal_forces(histories[row : row + int(step[i]) + 2])
            states = np.empty((3, *forces.shape))
            self._propagator.steps.walk(part.begins[block[i]], forces, states)
            result[:, i] = states[:, -1]
        return result


def probe_rows(problem: Problem) -> FloatArray:
    """Return the rows of all probes of a problem."""
    return np.concatenate([np.zeros((0, problem.system.size)), *(probe.rows for probe in problem.system.probes)])
