"""Evolution of small disturbances along a motion, including contact events and impacts.

Disturbances of the initial state and those by parameters follow the same equations. The derivatives of the steps of the
average acceleration between successive instants of a run are multiplied, so that the result is the derivative of the
numerical motion. The time of an event depends on the disturbance: a step ends with it, the velocities may jump, and the
next step begins with it. For short steps the three together are the saltation matrix, ``R_x + (f+ - R_x f- - R_t)
g_x'/g'`` for an impact R at g = 0: R. I. Leine and H. Nijmeijer, Dynamics and Bifurcations of Non-Smooth Mechanical
Systems (2004), ch. 7 and 8; M. di Bernardo et al., Piecewise-smooth Dynamical Systems (2008), sec. 2.5.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from flexcam.core import FloatArray, IntArray
from flexcam.dynamics.force_laws import BY_BEGIN, BY_TRAVEL, STATE_RATE
from flexcam.dynamics.initial_acceleration import InitialAcceleration
from flexcam.dynamics.linearization import Linear, LinearStep, StepSequence, directions, linearize, split_state
from flexcam.dynamics.local_forces import LocalForces
from flexcam.dynamics.parameter_forces import ExplicitDerivatives, ParameterForces
from flexcam.dynamics.problem import Problem
from flexcam.dynamics.step_state import SensedTrajectory, StepInputs, StepState, Trajectory

_MOST_STEPS = 256
"""Number of steps that are prepared together."""

_TOUCH = 1e-15
"""Penetration, m, assigned to a contact that is about to open or close, to select its side."""

_AT_ONCE = 1e-6
"""Fraction of a step within which a contact is about to switch."""

_BESIDE = 1e-3
"""Fraction of a step for the limits on both sides of an event."""

_AT_REST = 1e-6
"""Rate, m/s, below which a contact that switches rests on its side: a force that begins at zero has no jump."""

_SAME_TIME = 1e-7
"""Relative difference of a step from the usual one that is rounding of the time."""

Bools = NDArray[np.bool_]


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
        self._explicit: ExplicitDerivatives | None = None  # of the instants that are followed
        self._last: Trajectory | None = None
        self._shift: FloatArray | None = None

    def follow(self, track: Trajectory) -> FloatArray:
        """Propagate the disturbances over successive instants.

        With parameters, return the disturbances at the ends of steps, shape (steps, 2n + s, k), otherwise nothing.
        """
        first = self._last is None
        every = self._sense(track if self._last is None else Trajectory.concatenate([self._last, track]))
        time, sides = every.track.time, every.track.pressed
        if self._parameters is not None:
            self._explicit = self._parameters.along(every)
        if first:
            begin = self._linearize(every, slice(0, 1), sides[0])
            self._current = self._stepper.initial_disturbances(
                begin, self._current, self._source(begin, slice(0, 1))[0]
            )
        ends = set[int]() if self._parameters is None else set((track.ends + (not first)).tolist())
        found = [self._at_fixed_time(every.at(0))] if 0 in ends and first else list[FloatArray]()
        lengths = np.diff(time)
        plain, i = (lengths > 0.0) & (sides[1:] == sides[:-1]).all(axis=1), 0
        while i < len(lengths):
            count = 1
            if plain[i] and self._shift is None:
                same = plain[i : i + _MOST_STEPS] & (
                    np.abs(lengths[i : i + _MOST_STEPS] / lengths[i] - 1.0) <= _SAME_TIME
                )
                count = len(same) if same.all() else int(np.argmin(same))
                found += self._propagate(every, slice(i, i + count + 1), sides[i], ends)
            else:
                if lengths[i] > 0.0:
                    self._event_step(every, i)
                elif every.track.impulse[i + 1].any():
                    self._apply_impact(every, i)
                if i + 1 in ends:
                    found.append(self._at_fixed_time(every.at(i + 1)))
            i += count
        self._last = every.track.last()
        return np.array(found)

    def _propagate(self, every: SensedTrajectory, part: slice, side: Bools, ends: set[int]) -> list[FloatArray]:
        """Propagate the disturbances over the equal steps between some instants; return those at the `ends`."""
        sequence, more = self._steps(every, part, side)
        found, size = list[FloatArray](), len(self._current)
        if sequence.constant and self._parameters is None:  # a power of a step has less rounding than many steps
            step = sequence.propagate(0, np.eye(size), np.zeros((size, 1)))
            self._current = np.linalg.matrix_power(step, len(more)) @ self._current
            return found
        for j, terms in enumerate(more):
            self._current = sequence.propagate(j, self._current, terms)
            if part.start + j + 1 in ends:
                found.append(self._current)
        return found

    def _sense(self, track: Trajectory) -> SensedTrajectory:
        schedule = self._forces.prescribed_inputs(self._problem.drive.at(track.time))
        penetration, rate, _ = self._forces.sense_motion(track.d, track.v, schedule)
        return SensedTrajectory(track, schedule, penetration, rate)

    def monodromy(self) -> FloatArray:
        """Return the propagated disturbances, shape (2n + s, 2n + s)."""
        return self._current if self._last is None else self._at_fixed_time(self._sense(self._last).at(0))

    def _at_fixed_time(self, moment: StepState) -> FloatArray:
        """Return the disturbances at the time of an instant; those at the time of an event include its shift."""
        return self._current if self._shift is None else self._current - self._flow(moment)[:, None] * self._shift

    def _linearize(self, every: SensedTrajectory, part: slice, side: Bools) -> Linear:
        """Return the linear forces at some instants, with every contact on its side within the steps."""
        penetration = self._set_sides(side, every.penetration[part], every.rate[part])
        return linearize(self._forces, every.schedule.at(part), penetration, every.rate[part], every.track.state[part])

    def _set_sides(self, side: Bools, penetration: FloatArray, rate: FloatArray) -> FloatArray:
        """Return the sensed scalars, shape (..., c), with contacts that are about to switch set to their side."""
        which = self._forces.switching
        if not len(which):
            return penetration
        lifts = self._forces.lifts
        depth, depth_rate = lifts.depth(penetration)[..., which], lifts.depth_rate(penetration, rate)[..., which]
        penetration, sensed = penetration.copy(), penetration[..., which]
        there = np.abs(depth) <= _AT_ONCE * self._problem.step * np.abs(depth_rate)
        penetration[..., which] = np.where(there, sensed - depth + np.where(side, _TOUCH, -_TOUCH), sensed)
        return penetration

    def _steps(self, every: SensedTrajectory, part: slice, side: Bools) -> tuple[StepSequence, FloatArray]:
        """Return the equal steps between some instants, and the contributions of the parameters to them."""
        forces, time, state = self._forces, every.track.time[part], every.track.state[part]
        length, usual, linear = float(time[1] - time[0]), self._problem.step, self._linearize(every, part, side)
        length = usual if abs(length - usual) <= _SAME_TIME * usual else length
        travel, begin = np.zeros((2, len(time) - 1, state.shape[1]))
        for i in range(len(travel) if state.shape[1] else 0):
            old, new = every.penetration[part.start + i], every.penetration[part.start + i + 1]
            travel[i], begin[i] = forces.follow_states(length, new, old, state[i])[[BY_TRAVEL, BY_BEGIN]]
        sequence = StepSequence(self._stepper, length, linear, travel, begin)
        return sequence, self._parameter_terms(every, part, length, self._source(linear, part))

    def _parameter_terms(self, every: SensedTrajectory, part: slice, length: float, source: FloatArray) -> FloatArray:
        """Return the contributions of the parameters to the steps between some instants, see `StepSequence.propagate`.

        `source` are the forces of the parameters at these instants, shape (m, n, k).
        """
        track, n, half = every.track, self._problem.system.size, 0.5 * length
        shape = (len(source) - 1, *self._current.shape)
        if self._parameters is None:
            return np.broadcast_to(np.zeros(()), shape)
        terms = np.zeros(shape)
        count, begin = self._parameters.count, (half * source[:-1]).swapaxes(0, 1)
        terms[:, n : 2 * n] = half * source[1:]
        terms[:, n : 2 * n] += self._stepper.equilibrate(begin.reshape(n, -1)).reshape(begin.shape).swapaxes(0, 1)
        if track.state.shape[1]:
            terms[:, 2 * n :, :count] = [
                self._parameters.states_after(every, part.start + i) for i in range(len(terms))
            ]
        if (stretch := self._parameters.stretch).any():
            v, a = (0.5 * (rows[part][:-1] + rows[part][1:]) for rows in (track.v, track.a))
            mean = np.hstack([v, self._problem.system.mass.multiply(a.T).T])
            terms[:, : 2 * n, :count] += mean[:, :, None] * (length * stretch)
        return terms

    def _event_step(self, every: SensedTrajectory, i: int) -> None:
        """Apply a step that begins or ends at an event, whose time depends on the disturbances.

        An event at g(d, t) = 0 comes later by ``-g_d Y/g'``, with the rate of g by the length of the step.
        """
        old, new, side = every.at(i), every.at(i + 1), every.track.pressed[i]
        step, (moved,) = self._steps(every, slice(i, i + 2), side)
        h, longer = new.time - old.time, self._stepper.by_length(self._flow(old), self._flow(new))
        if self._shift is not None:
            shifted = self._stepper.old_terms(0.5 * h * self._prescribed_rates(old, side)) - longer
            moved = moved + shifted[:, None] * self._shift
        after, self._shift = step.propagate(0, self._current, moved), None
        crossed = np.flatnonzero(side != every.track.pressed[i + 1])
        lifts = self._forces.lifts
        depth, depth_rate = lifts.depth(new.penetration), lifts.depth_rate(new.penetration, new.rate)
        crossed = crossed[np.abs(depth_rate[self._forces.switching[crossed]]) > _AT_REST]
        if len(crossed):
            which = self._forces.switching[crossed]
            which = int(which[np.argmin(np.abs(depth[which] / depth_rate[which]))])
            gradient = lifts.gradient(which, new.penetration)
            longer = (longer + 0.5 * h * self._prescribed_rates(new, side))[:, None]
            by_time = step.propagate(0, np.zeros_like(longer), longer)[:, 0]
            sense, n = gradient @ directions(self._forces, every.schedule, i + 1)[1], len(new.d)
            rate = depth_rate[which] + sense @ (by_time[:n] - new.v)
            self._shift = shift = -(sense @ after[:n] + gradient @ self._scalar_derivatives(i + 1)) / rate
            after = after + by_time[:, None] * shift
        self._current = after

    def _apply_impact(self, every: SensedTrajectory, i: int) -> None:
        """Apply an impact R(x, t): the disturbances become ``R_x Y + R_t t'``, with the shift t' of its time."""
        old, new = every.at(i), every.at(i + 1)
        n, switching = self._problem.system.size, self._forces.switching
        impulse = np.zeros_like(new.local) if new.impulse is None else new.impulse
        held = np.flatnonzero(impulse[switching] > 0.0)
        hit, rate = self._starter.impact_data(self._instant(old.time), held), old.rate[switching[held]]
        before, shift = self._current, self._shift
        if shift is None:  # at the end of a step
            first = int(np.argmax(rate))
            shift = -(hit.sense[first] @ before[:n] + self._scalar_derivatives(i)[switching[held[first]]]) / rate[first]
            before = before + self._flow(old)[:, None] * shift
        d, v, z = split_state(before, n)
        factor, beside = hit.reversal(rate), _BESIDE * self._problem.step
        later, earlier = (self._change(old, held, factor, sign * beside) for sign in (1.0, -1.0))
        v = v + hit.velocity_change(hit.sense @ v + hit.turning @ d, factor)
        v = v + (later - earlier)[:, None] * shift / (2.0 * beside)
        if self._parameters is not None:
            v[:, : self._parameters.count] += self._parameters.impact_change(old, held)
        self._current, self._shift = np.vstack([d, v, z]), shift

    def _change(self, old: StepState, held: IntArray, factor: FloatArray, after: float) -> FloatArray:
        """Return the change of the impact velocities per delay of the same motion, shape (n,)."""
        to = self._instant(old.time + after)
        hit = self._starter.impact_data(to, held)
        rate = hit.sense @ old.v + hit.turning @ old.d + to.schedule.offset_rate[0][self._forces.switching[held]]
        return hit.velocity_change(rate, factor)

    def _prescribed_rates(self, moment: StepState, side: Bools) -> FloatArray:
        """Return the rates of forces (n,) and of internal state rates (s,) due to the cam motion alone, per second.

        Contacts stay on their side: the prescribed penetration rate is multiplied by their stiffness.
        """
        beside = _BESIDE * self._problem.step
        before, there, after = (self._instant(moment.time + one * beside) for one in (-1.0, 0.0, 1.0))
        forces, state = self._forces, moment.inner

        def slope(earlier: FloatArray, later: FloatArray) -> FloatArray:
            return (later - earlier) / (2.0 * beside)

        if not forces.count:
            return np.concatenate([np.zeros_like(moment.d), slope(before.load, after.load)])
        seen = [forces.sense_motion(moment.d[None], moment.v[None], one.schedule) for one in (before, after)]
        by_penetration, by_rate = (
            slope(one[0], other[0]) for one, other in zip(*(part[:2] for part in seen), strict=True)
        )
        penetration = self._set_sides(side, moment.penetration, moment.rate)
        early, now, late = (
            forces.respond(penetration, moment.rate, state, one.schedule) for one in (before, there, after)
        )
        force = slope(early.force, late.force) + now.by_penetration @ by_penetration + now.by_rate @ by_rate
        act, turned = (
            there.schedule.acting_matrix(0),
            slope(before.schedule.acting_matrix(0), after.schedule.acting_matrix(0)),
        )
        pushed = slope(before.load, after.load) + (force @ act + now.force @ turned) @ forces.act.vectors
        return np.concatenate([np.zeros_like(moment.d), pushed, now.flow * by_penetration[forces.table.owners]])

    def _flow(self, moment: StepState) -> FloatArray:
        """Return velocities, accelerations and rates of internal states in a row."""
        rates, depth = moment.inner, moment.penetration
        if len(rates):
            rates = self._forces.follow_states(0.0, depth, depth, moment.inner)[STATE_RATE]
        return np.concatenate([moment.v, moment.a, rates])

    def _instant(self, time: float) -> StepInputs:
        motion = self._problem.drive.at(np.array([time]))
        return StepInputs(time, self._problem.system.load_vector(motion)[0], self._forces.prescribed_inputs(motion))

    def _source(self, at: Linear, part: slice) -> FloatArray:
        """Return the forces of the parameters on the unknowns at some instants, shape (m, n, k)."""
        pushed = np.zeros((len(at.act), self._problem.system.size, self._current.shape[1]))
        if self._explicit is not None:
            found = self._explicit.source(at, part)
            pushed[:, :, : found.shape[2]] = found
        return pushed

    def _scalar_derivatives(self, i: int) -> FloatArray:
        """Return the derivatives of the sensed scalars at an instant by the parameters, shape (c, k)."""
        found = np.zeros((self._forces.count, self._current.shape[1]))
        if self._explicit is not None:
            found[:, : self._explicit.penetration.shape[2]] = self._explicit.penetration[i]
        return found
