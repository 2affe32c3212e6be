"""Evolution of small disturbances along a motion, including contact events and impacts.

Disturbances of the initial state and those by parameters follow the same equations. The derivatives of the steps of the
average acceleration between successive instants of a run are multiplied, so that the result is the derivative of the
numerical motion. The time of an event depends on the disturbance: a step ends with it, the velocities may jump, and the
next step begins with it. For short steps the three together are the saltation matrix, ``R_x + (f+ - R_x f- - R_t)
g_x'/g'`` for an impact R at g = 0: R. I. Leine and H. Nijmeijer, Dynamics and Bifurcations of Non-Smooth Mechanical
Systems (2004), ch. 7 and 8; M. di Bernardo et al., Piecewise-smooth Dynamical Systems (2008), sec. 2.5.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from flexcam.core import FloatArray, IntArray
from flexcam.dynamics.engine import inputs_at
from flexcam.dynamics.force_laws import BY_BEGIN, BY_TRAVEL, FLOW, STATE_RATE
from flexcam.dynamics.initial_acceleration import InitialAcceleration
from flexcam.dynamics.linearization import Linear, LinearStep, StepSequence, directions, linearize, split_state
from flexcam.dynamics.local_forces import LocalForces
from flexcam.dynamics.parameter_forces import ExplicitDerivatives, ParameterForces
from flexcam.dynamics.problem import Problem
from flexcam.dynamics.step_state import SensedTrajectory, StepState, Trajectory

_MAX_VALUES, _MIN_STEPS = 100_000, 32
"""Number of derivatives of forces that are prepared together, and minimum number of steps."""

_TOUCH = 1e-15
"""Penetration, m, assigned to a contact that is about to open or close, to select its side."""

_NEAR_SWITCH = 1e-6
"""Fraction of a step within which a contact is about to switch."""

_OFFSET = 1e-3
"""Fraction of a step for the limits on both sides of an event."""

_AT_REST = 1e-6
"""Rate, m/s, below which a contact that switches rests on its side: a force that begins at zero has no jump."""

_SAME_TIME = 1e-7
"""Relative difference of a step from the usual one that is rounding of the time."""

_FEW = 32
"""Number of disturbances up to which compiled steps are faster than those of numpy."""

Bools = NDArray[np.bool_]


@dataclass(frozen=True, eq=False)
class _LinearizedMotion:
    """Successive instants of a motion with their derivatives.

    Rows are instants with the contacts on their sides within a step: an instant at which sides change, or at which
    the ramp of the damping of a contact ends, has two.
    """

    trajectory: SensedTrajectory
    lengths: FloatArray  #: of the steps, s, shape (m - 1,)
    plain: Bools  #: steps of some length without a second row at an end, shape (m - 1,)
    begin: list[int]  #: row of every instant as the beginning of a step, shape (m,)
    ramp_ends: Bools  #: switching scalars at the end of the ramp of their damping, shape (m, w)
    tangents: FloatArray  #: derivatives of the forces of the rows, see `LocalForces.tangents`
    by_travel: FloatArray  #: T of the steps, see `StepSequence`, shape (m - 1, s)
    by_begin: FloatArray  #: B of the steps, shape (m - 1, s)
    prescribed_rates: dict[int, FloatArray]  #: rates due to the cam motion alone at events, by row
    flow: FloatArray  #: velocities, accelerations and rates of internal states, shape (m, 2n + s)
    explicit: ExplicitDerivatives | None  #: derivatives by the parameters


class Disturbances:
    """Evolution of disturbances of displacements, velocities and internal states along a motion of a problem.

    The initial disturbances are columns, shape (2n + s, k); None for unit disturbances of each. Parameters, if given,
    disturb the first columns along the motion.
    """

    def __init__(
        self, problem: Problem, forces: LocalForces, initial: FloatArray | None = None,
        parameters: ParameterForces | None = None,
    ) -> None:  # fmt: skip
        self._problem, self._forces = problem, forces
        self._stepper = LinearStep(problem.system)
        self._starter = InitialAcceleration(problem.system, forces)
        self._current: FloatArray = (
            np.eye(2 * problem.system.size + len(forces.start_state)) if initial is None else initial.copy()
        )
        self._parameters = parameters
        self._max_steps = max(_MAX_VALUES // max(problem.system.size * forces.count, 1), _MIN_STEPS)
        self._last: Trajectory | None = None
        self._shift: FloatArray | None = None

    def follow(self, track: Trajectory) -> tuple[Trajectory, FloatArray]:
        """Propagate the disturbances over successive instants.

        With parameters, return the instants, after the last one before them, and the disturbances at the ends of steps,
        shape (steps, 2n + s, k).
        """
        first = self._last is None
        if self._last is not None:
            track = replace(Trajectory.concatenate([self._last, track]), ends=track.ends + 1)
        motion = self._prepare(track)
        if first:
            begin = self._linearize(motion, 0, 0)
            source = self._source(motion, begin, slice(0, 1))[0]
            self._current = self._stepper.initial_disturbances(begin, self._current, source)
        ends = np.zeros(len(motion.flow), dtype=bool)
        if self._parameters is not None:
            ends[track.ends] = True
        blocks = [self._at_fixed_time(motion.flow[0])[None]] if ends[0] and first else list[FloatArray]()
        lengths, plain, i = motion.lengths, motion.plain, 0
        while i < len(lengths):
            count = 1
            if plain[i] and self._shift is None:
                part = slice(i, i + self._max_steps)
                equal = plain[part] & (np.abs(lengths[part] / lengths[i] - 1.0) <= _SAME_TIME)
                count = len(equal) if equal.all() else int(np.argmin(equal))
                blocks.append(self._propagate(motion, i, i + count, ends[i + 1 : i + count + 1]))
            else:
                if lengths[i] > 0.0:
                    self._event_step(motion, i)
                elif motion.trajectory.track.impulse[i + 1].any():
                    self._apply_impact(motion, i)
                if ends[i + 1]:
                    blocks.append(self._at_fixed_time(motion.flow[i + 1])[None])
            i += count
        self._last = track.at_ends(slice(-1, None))
        return motion.trajectory.track, np.concatenate([np.zeros((0, *self._current.shape)), *blocks])

    def _propagate(self, motion: _LinearizedMotion, first: int, last: int, ends: Bools) -> FloatArray:
        """Propagate the disturbances over the equal steps between instants; return those after some of them."""
        sequence, terms = self._steps(motion, first, last)
        if self._parameters is None:
            size = len(self._current)
            if sequence.constant:  # a power of a step has less rounding than many steps
                step = sequence.propagate(0, np.eye(size), np.zeros((size, 1)))
                self._current = np.linalg.matrix_power(step, last - first) @ self._current
            else:
                self._current = sequence.propagate_all(self._current, terms, last=True)[(last - first) % 2]
            return self._current[None][:0]
        states = sequence.propagate_all(self._current, terms)[1:]
        self._current = states[-1]
        return states[ends]

    def _prepare(self, track: Trajectory) -> _LinearizedMotion:
        """Return the instants of successive steps with their derivatives, all at once."""
        forces, time, sides, step = self._forces, track.time, track.pressed, self._problem.step
        inputs = forces.prescribed_inputs(self._problem.drive.at(time))
        penetration, rate, _ = forces.sense_motion(track.d, track.v, inputs)
        sensed = SensedTrajectory(replace(track, cam=inputs.cam), inputs, penetration, rate)
        lengths = np.diff(time)
        lengths[np.abs(lengths - step) <= _SAME_TIME * step] = step
        ramp_ends = self._near(penetration, rate, forces.ramps)
        changed = (sides[1:] != sides[:-1]).any(axis=1) | ramp_ends[1:].any(axis=1)
        instants = np.repeat(np.arange(len(time)), 1 + np.append(False, changed))
        begin = np.arange(len(time)) + np.cumsum(np.append(False, changed))
        row_sides = sides[instants]
        row_sides[begin[1:][changed] - 1] = sides[:-1][changed]
        depth, speed, functions = penetration[instants], rate[instants], inputs.functions
        depth = self._set_sides(row_sides, depth, speed)
        states = track.state[instants]
        tangents = forces.tangents(depth, speed, states, functions[instants])[2]
        state_rows = forces.follow_states(lengths, penetration[1:], penetration[:-1], track.state[:-1])
        rates = forces.follow_states(np.zeros(len(time)), penetration, penetration, track.state)[:, STATE_RATE]
        plain = (lengths > 0.0) & ~changed
        events = np.flatnonzero(~plain)
        rows = np.unique(np.concatenate([begin[:1], begin[events], begin[events] + 1, begin[events + 1]]))
        shifts = self._prescribed_rates(sensed, instants[rows], depth[rows])
        return _LinearizedMotion(
            sensed, lengths, plain, begin.tolist(), ramp_ends, tangents, state_rows[:, BY_TRAVEL],
            state_rows[:, BY_BEGIN], dict(zip(rows.tolist(), shifts, strict=True)),
            np.hstack([track.v, track.a, rates]),
            None if self._parameters is None else self._parameters.along(sensed, lengths),
        )  # fmt: skip

    def monodromy(self) -> FloatArray:
        """Return the propagated disturbances, shape (2n + s, 2n + s)."""
        if self._last is None or self._shift is None:
            return self._current
        return self._at_fixed_time(self._prepare(self._last).flow[0])

    def _at_fixed_time(self, flow: FloatArray) -> FloatArray:
        """Return the disturbances at the time of an instant; those at the time of an event include its shift."""
        return self._current if self._shift is None else self._current - flow[:, None] * self._shift

    def _linearize(self, motion: _LinearizedMotion, first: int, last: int) -> Linear:
        at, rows = slice(first, last + 1), slice(motion.begin[first], motion.begin[first] + last - first + 1)
        answer = None if motion.explicit is None else motion.explicit.answer[at]
        return linearize(self._forces, motion.trajectory.inputs.at(at), motion.tangents[rows], answer)

    def _near(self, penetration: FloatArray, rate: FloatArray, level: float | FloatArray) -> Bools:
        """Return which switching scalars pass a level at an instant of some sensed scalars, shape (..., w)."""
        depth = self._forces.lifts.depth(penetration)[..., self._forces.switching]
        return np.abs(depth - level) <= _NEAR_SWITCH * self._problem.step * np.abs(self._depth_rate(penetration, rate))

    def _depth_rate(self, penetration: FloatArray, rate: FloatArray) -> FloatArray:
        return self._forces.lifts.depth_rate(penetration, rate)[..., self._forces.switching]

    def _set_sides(self, side: Bools, penetration: FloatArray, rate: FloatArray) -> FloatArray:
        """Return the sensed scalars, shape (..., c), with contacts that are about to switch set to their side."""
        index = self._forces.switching
        if not len(index):
            return penetration
        near, depth = self._near(penetration, rate, 0.0), self._forces.lifts.depth(penetration)[..., index]
        penetration, scalars = penetration.copy(), penetration[..., index]
        penetration[..., index] = np.where(near, scalars - depth + np.where(side, _TOUCH, -_TOUCH), scalars)
        return penetration

    def _steps(self, motion: _LinearizedMotion, first: int, last: int) -> tuple[StepSequence, FloatArray]:
        part, linear = slice(first, last), self._linearize(motion, first, last)
        few = self._parameters is not None and self._current.shape[1] <= _FEW
        sequence = StepSequence(
            self._stepper, float(motion.lengths[first]), linear, motion.by_travel[part], motion.by_begin[part],
            self._forces.compiled if few else None,
        )  # fmt: skip
        return sequence, self._parameter_terms(motion, part, self._source(motion, linear, slice(first, last + 1)))

    def _parameter_terms(self, motion: _LinearizedMotion, steps: slice, source: FloatArray) -> FloatArray:
        """Return the contributions of the parameters to some equal steps, see `StepSequence.propagate`.

        `source` are the forces of the parameters at the m + 1 instants of the steps, shape (m + 1, n, k).
        """
        n, length = self._problem.system.size, float(motion.lengths[steps.start])
        shape, half = (len(source) - 1, *self._current.shape), 0.5 * length
        if self._parameters is None or motion.explicit is None:
            return np.broadcast_to(np.zeros(()), shape)
        terms = np.zeros(shape)
        count, begin = self._parameters.count, (half * source[:-1]).swapaxes(0, 1)
        terms[:, n : 2 * n] = half * source[1:]
        terms[:, n : 2 * n] += self._stepper.equilibrate(begin.reshape(n, -1)).reshape(begin.shape).swapaxes(0, 1)
        terms[:, 2 * n :, :count] = motion.explicit.states_after[steps]
        if (stretch := self._parameters.stretch).any():
            mean = self._stepper.by_length(motion.flow[steps], motion.flow[steps.start + 1 : steps.stop + 1])
            terms[:, : 2 * n, :count] += mean[:, : 2 * n, None] * (length * stretch)
        return terms

    def _event_step(self, motion: _LinearizedMotion, i: int) -> None:
        """Apply a step that begins or ends at an event, whose time depends on the disturbances.

        An event at g(d, t) = 0 comes later by ``-g_d Y/g'``, with the rate of g by the length of the step.
        """
        sensed = motion.trajectory
        new, side = sensed.at(i + 1), sensed.track.pressed[i]
        step, (terms,) = self._steps(motion, i, i + 1)
        h, by_length = float(motion.lengths[i]), self._stepper.by_length(motion.flow[i], motion.flow[i + 1])
        if self._shift is not None:
            shifted = self._stepper.old_terms(0.5 * h * motion.prescribed_rates[motion.begin[i]]) - by_length
            terms = terms + shifted[:, None] * self._shift
        after, self._shift = step.propagate(0, self._current, terms), None
        ramp_ends, switching, lifts = motion.ramp_ends[i + 1], self._forces.switching, self._forces.lifts
        crossed = np.flatnonzero((side != sensed.track.pressed[i + 1]) | ramp_ends)
        levels, depth_rate = np.where(ramp_ends, self._forces.ramps, 0.0), self._depth_rate(new.penetration, new.rate)
        crossed = crossed[np.abs(depth_rate[crossed]) > _AT_REST]
        if len(crossed):
            away = (lifts.depth(new.penetration)[switching] - levels)[crossed] / depth_rate[crossed]
            first = int(crossed[np.argmin(np.abs(away))])
            scalar = int(switching[first])
            gradient = lifts.gradient(scalar, new.penetration)
            by_length = (by_length + 0.5 * h * motion.prescribed_rates[motion.begin[i] + 1])[:, None]
            by_time = step.propagate(0, np.zeros_like(by_length), by_length)[:, 0]
            sense, n = gradient @ directions(self._forces, sensed.inputs, i + 1)[1], len(new.d)
            rate = depth_rate[first] + sense @ (by_time[:n] - new.v)
            self._shift = shift = -(sense @ after[:n] + gradient @ self._scalar_derivatives(motion, i + 1)) / rate
            after = after + by_time[:, None] * shift
        self._current = after

    def _apply_impact(self, motion: _LinearizedMotion, i: int) -> None:
        """Apply an impact R(x, t): the disturbances become ``R_x Y + R_t t'``, with the shift t' of its time."""
        old, new = motion.trajectory.at(i), motion.trajectory.at(i + 1)
        n, switching = self._problem.system.size, self._forces.switching
        impulse = np.zeros_like(new.local) if new.impulse is None else new.impulse
        contacts = np.flatnonzero(impulse[switching] > 0.0)
        to, rate = inputs_at(self._problem, self._forces, old.time), old.rate[switching[contacts]]
        hit = self._starter.impact_data(to, contacts)
        before, shift = self._current, self._shift
        if shift is None:  # at the end of a step
            first = int(np.argmax(rate))
            shift = (
                -(hit.sense[first] @ before[:n] + self._scalar_derivatives(motion, i)[switching[contacts[first]]])
                / rate[first]
            )
            before = before + motion.flow[i][:, None] * shift
        d, v, z = split_state(before, n)
        factor, offset = hit.reversal(rate), _OFFSET * self._problem.step
        later, earlier = (self._change(old, contacts, factor, sign * offset) for sign in (1.0, -1.0))
        v = v + hit.velocity_change(hit.sense @ v + hit.turning @ d, factor)
        v = v + (later - earlier)[:, None] * shift / (2.0 * offset)
        if self._parameters is not None:
            v[:, : self._parameters.count] += self._parameters.impact_change(old, contacts)
        self._current, self._shift = np.vstack([d, v, z]), shift

    def _change(self, old: StepState, contacts: IntArray, factor: FloatArray, delay: float) -> FloatArray:
        """Return the change of the impact velocities per delay of the same motion, shape (n,)."""
        to = inputs_at(self._problem, self._forces, old.time + delay)
        hit = self._starter.impact_data(to, contacts)
        rate = hit.sense @ old.v + hit.turning @ old.d + to.inputs.offset_rate[0][self._forces.switching[contacts]]
        return hit.velocity_change(rate, factor)

    def _prescribed_rates(self, sensed: SensedTrajectory, instants: IntArray, depth: FloatArray) -> FloatArray:
        """Return the rates of forces and of internal state rates due to the cam motion alone, per second.

        The shape is (e, 2n + s), with zeros in front. The sensed scalars `depth` at the instants, shape (e, c), are
        those of contacts on their side: the prescribed penetration rate is multiplied by their stiffness.
        """
        offset, forces, track, n = _OFFSET * self._problem.step, self._forces, sensed.track, self._problem.system.size
        motion = self._problem.drive.at((track.time[instants, None] + offset * np.array([-1.0, 0.0, 1.0])).ravel())
        inputs, at = forces.prescribed_inputs(motion), np.repeat(instants, 3)

        def slope(values: FloatArray) -> FloatArray:
            return (values[2::3] - values[::3]) / (2.0 * offset)

        histories = forces.sense_motion(track.d[at], track.v[at], inputs)
        by_penetration, by_rate = slope(histories[0]), slope(histories[1])
        depth = np.repeat(depth, 3, axis=0)
        force, state_rows, tangents = forces.tangents(depth, sensed.rate[at], track.state[at], inputs.functions)
        (row, places, column), change = forces.coupled_scalars, slope(force)
        for i, rates in enumerate((by_penetration, by_rate)):
            change += (tangents[1::3, i][:, row, places] * rates[:, column]) @ (row[:, None] == np.arange(forces.count))
        scalars, weights = forces.act.scalars, inputs.acting_weights
        change = change[:, scalars] * weights[1::3] + force[1::3, scalars] * slope(weights)
        result = np.zeros((len(instants), 2 * n + track.state.shape[1]))
        result[:, n : 2 * n] = slope(self._problem.system.load_vector(motion)) + change @ forces.act.vectors
        result[:, 2 * n :] = state_rows[1::3, FLOW] * by_penetration[:, forces.table.owners]
        return result

    def _source(self, motion: _LinearizedMotion, linear: Linear, part: slice) -> FloatArray:
        """Return the forces of the parameters on the unknowns at some instants, shape (m, n, k)."""
        forces = np.zeros((len(linear.act), self._problem.system.size, self._current.shape[1]))
        if motion.explicit is not None:
            source = motion.explicit.source(linear, part)
            forces[:, :, : source.shape[2]] = source
        return forces

    def _scalar_derivatives(self, motion: _LinearizedMotion, i: int) -> FloatArray:
        """Return the derivatives of the sensed scalars at an instant by the parameters, shape (c, k)."""
        derivatives = np.zeros((self._forces.count, self._current.shape[1]))
        if motion.explicit is not None:
            derivatives[:, : motion.explicit.penetration.shape[2]] = motion.explicit.penetration[i]
        return derivatives
