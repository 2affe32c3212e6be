"""Floquet multipliers: map of a period and its derivative.

The derivative is the product of those of the steps of the average acceleration between successive instants of a run,
including events and impacts, so that it is the derivative of the numerical motion. The time of an event depends on the
disturbance: a step ends with it, the velocities may jump, and the next step begins with it. For short steps the three
together are the saltation matrix, ``R_x + (f+ - R_x f- - R_t) g_x'/g'`` for an impact R at g = 0: R. I. Leine and H.
Nijmeijer, Dynamics and Bifurcations of Non-Smooth Mechanical Systems (2004), ch. 7 and 8; M. di Bernardo et al.,
Piecewise-smooth Dynamical Systems (2008), sec. 2.5.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from flexcam.core import ComplexArray, FloatArray, IntArray, SingularMatrixError
from flexcam.core.errors import refuse
from flexcam.dynamics.blocks import SaveAt
from flexcam.dynamics.cam_motion import PrescribedInputs
from flexcam.dynamics.engine_selection import SelectedEngine, create_engine, forces_of, select_engine
from flexcam.dynamics.generalized_alpha import newmark
from flexcam.dynamics.initial_acceleration import InitialAcceleration
from flexcam.dynamics.integrator import Method
from flexcam.dynamics.linearization import (
    SAME_LENGTH,
    Linear,
    Linearization,
    LinearStep,
    SmallStep,
    directions,
    split_state,
)
from flexcam.dynamics.local_forces import LocalForces
from flexcam.dynamics.problem import Problem
from flexcam.dynamics.solve import pilot, singular_status
from flexcam.dynamics.status import RunFailedError, Stats
from flexcam.dynamics.step_state import StepInputs, StepState, Trajectory

MAX_UNKNOWNS = 400
"""Maximum number of unknowns."""

_BLOCK = 500
"""Number of steps whose instants are in memory together."""

_MIN_EQUAL_STEPS = 40
"""Number of equal steps above which a matrix power is cheaper than single steps."""

_TOUCH = 1e-15
"""Penetration, m, assigned to a contact that is about to open or close, to select its side."""

_AT_ONCE = 1e-6
"""Fraction of a step within which a contact is about to switch."""

_BESIDE = 1e-3
"""Fraction of a step for the limits on both sides of an event."""

Bools = NDArray[np.bool_]


@dataclass(frozen=True, eq=False)
class PeriodMap:
    """Map of one period; states are displacements, velocities and internal states in a row."""

    end: FloatArray  #: state at the end, shape (2n + s,)
    derivative: FloatArray  #: of the end by the initial state, shape (2n + s, 2n + s); empty if not requested
    fields: FloatArray  #: displacements and velocities at the ends of steps, shape (m, 2n)
    events: int  #: number of contacts that opened or closed


def period_map(
    selected: SelectedEngine, method: Method, stop: Callable[[], bool], *, derived: bool = True
) -> PeriodMap:
    """Return a period of a problem in the unknowns of its engine; a failed run raises `RunFailedError`."""
    try:
        return _integrate_period(selected, method, stop, derived=derived)
    except SingularMatrixError as fault:
        raise RunFailedError(singular_status(fault, selected.problem.system)) from None


def _integrate_period(
    selected: SelectedEngine, method: Method, stop: Callable[[], bool], *, derived: bool
) -> PeriodMap:
    problem, forces = selected.problem, forces_of(selected, method)
    engine = create_engine(selected, method, forces, SaveAt(field_every=problem.steps + 1), stop, pilot)
    disturbances, fields = Disturbances(problem, forces) if derived else None, list[FloatArray]()
    end = np.zeros(0)
    for begin in range(0, problem.steps + 1, _BLOCK):
        with np.errstate(over="ignore", invalid="ignore"):
            track, status = engine.advance(np.arange(begin, min(begin + _BLOCK, problem.steps + 1)))
        if not status.ok:
            raise RunFailedError(status)
        if disturbances is not None:
            disturbances.follow(track)
        fields.append(np.hstack([track.d, track.v])[track.ends])
        end = np.concatenate([track.d[-1], track.v[-1], track.state[-1]])
    derivative = np.zeros((0, 0)) if disturbances is None else disturbances.monodromy()
    return PeriodMap(end, derivative, np.concatenate(fields), engine.statistics(Stats()).events)


@dataclass(frozen=True, eq=False)
class _Instants:
    """Instants of a trajectory with what their local forces sense."""

    track: Trajectory
    schedule: PrescribedInputs
    penetration: FloatArray
    rate: FloatArray

    def at(self, i: int) -> StepState:
        """Return the instant, with its side and its impulse."""
        track, impulse = self.track, self.track.impulse[i]
        return StepState(
            float(track.time[i]), track.d[i], track.v[i], track.a[i], np.zeros_like(track.d[i]), track.local[i],
            self.penetration[i], self.rate[i], track.state[i], track.pressed[i], impulse if impulse.any() else None,
        )  # fmt: skip


class Disturbances:
    """Evolution of unit disturbances of displacements, velocities and internal states.

    Only system, drive and step of the problem are used.
    """

    def __init__(self, problem: Problem, forces: LocalForces) -> None:
        self._problem, self._forces = problem, forces
        self._linear = Linearization(problem.system, forces)
        self._stepper = LinearStep(problem.system)
        self._starter = InitialAcceleration(problem.system, forces)
        self._carried: FloatArray = np.eye(2 * problem.system.size + len(forces.start_state))
        self._last: Trajectory | None = None
        self._waiting: SmallStep | None = None
        self._count = 0
        self._shift: FloatArray | None = None

    def follow(self, track: Trajectory) -> None:
        """Propagate the disturbances over successive instants."""
        every = self._sense(track if self._last is None else Trajectory.concatenate([self._last, track]))
        time, sides = every.track.time, every.track.pressed
        if self._last is None:
            self._carried = self._stepper.initial_disturbances(self._at(every, 0, sides[0]), self._carried)
        plain = (np.diff(time) > 0.0) & (sides[1:] == sides[:-1]).all(axis=1)
        begin: Linear | None = None
        for i in range(len(time) - 1):
            if plain[i] and self._shift is None:
                end = self._at(every, i + 1, sides[i])
                self._step(self._small(begin or self._at(every, i, sides[i]), end, every, i))
                begin = end  # of the next step as well
                continue
            begin = None
            self._apply_pending()
            if time[i + 1] > time[i]:
                self._event_step(every, i)
            elif every.track.impulse[i + 1].any():
                self._apply_impact(every.at(i), every.at(i + 1))
        self._last = every.track.last()

    def _sense(self, track: Trajectory) -> _Instants:
        schedule = self._forces.prescribed_inputs(self._problem.drive.at(track.time))
        penetration, rate, _ = self._forces.sense_motion(track.d, track.v, schedule)
        return _Instants(track, schedule, penetration, rate)

    def monodromy(self) -> FloatArray:
        """Return the propagated disturbances, shape (2n + s, 2n + s)."""
        self._apply_pending()
        if self._last is None or self._shift is None:
            return self._carried
        last = self._sense(self._last).at(0)
        return self._carried - self._flow(last)[:, None] * self._shift  # a last event does not shift the end

    def _at(self, every: _Instants, i: int, side: Bools) -> Linear:
        """Return the linear forces at an instant, with every contact on its side within the step."""
        penetration = self._set_sides(side, every.penetration[i], every.rate[i])
        return self._linear.at(every.schedule, i, penetration, every.rate[i], every.track.state[i])

    def _set_sides(self, side: Bools, penetration: FloatArray, rate: FloatArray) -> FloatArray:
        """Return the sensed scalars, with contacts that are about to switch set to their side."""
        which = self._forces.switching
        if not len(which):
            return penetration
        penetration, depth = penetration.copy(), penetration[which]
        there = np.abs(depth) <= _AT_ONCE * self._problem.step * np.abs(rate[which])
        penetration[which] = np.where(there, np.where(side, _TOUCH, -_TOUCH), depth)
        return penetration

    def _small(self, begin: Linear, end: Linear, every: _Instants, i: int) -> SmallStep:
        """Return the effect of the step after an instant on disturbances."""
        (h,), none = np.diff(every.track.time[i : i + 2]).tolist(), np.zeros(0)
        if not every.track.state.shape[1]:
            return SmallStep(begin, end, h, none, none)
        new, old = every.penetration[i + 1], every.penetration[i]
        return SmallStep(begin, end, h, *self._forces.state_steps(h, new, old, every.track.state[i]))

    def _step(self, step: SmallStep) -> None:
        usual = self._waiting
        same = usual and usual.old is step.old and usual.new is step.new
        if usual and same and abs(step.length - usual.length) <= SAME_LENGTH * usual.length:
            self._count += 1
            return
        self._apply_pending()
        self._waiting, self._count = step, 1

    def _apply_pending(self) -> None:
        """Apply the pending steps, which are all equal."""
        if self._waiting is None:
            return
        if self._count < _MIN_EQUAL_STEPS:
            for _ in range(self._count):
                self._carried = self._stepper.propagate(self._waiting, self._carried)
        else:
            one = self._stepper.propagate(self._waiting, np.eye(len(self._carried)))
            self._carried = np.linalg.matrix_power(one, self._count) @ self._carried
        self._waiting, self._count = None, 0

    def _event_step(self, every: _Instants, i: int) -> None:
        """Apply a step that begins or ends at an event, whose time depends on the disturbances.

        An event at g(d, t) = 0 comes later by ``-g_d Y/g'``, with the rate of g by the length of the step.
        """
        old, new, side = every.at(i), every.at(i + 1), every.track.pressed[i]
        step = self._small(self._at(every, i, side), self._at(every, i + 1, side), every, i)
        h, longer = step.length, self._stepper.impulse(self._flow(old), self._flow(new))
        moved: FloatArray = np.zeros_like(self._carried)
        if self._shift is not None:
            moved = (self._stepper.old_terms(0.5 * h * self._prescribed_rates(old, side)) - longer)[
                :, None
            ] * self._shift
        after, self._shift = self._stepper.propagate(step, self._carried, moved), None
        crossed = np.flatnonzero(side != every.track.pressed[i + 1])
        if len(crossed):
            which = self._forces.switching[crossed]
            which = int(which[np.argmin(np.abs(new.penetration[which] / new.rate[which]))])
            longer = (longer + 0.5 * h * self._prescribed_rates(new, side))[:, None]
            by_time = self._stepper.propagate(step, np.zeros_like(longer), longer)[:, 0]
            sense, n = directions(self._forces, every.schedule, i + 1)[1][which], len(new.d)
            rate = new.rate[which] + sense @ (by_time[:n] - new.v)
            self._shift = shift = -(sense @ after[:n]) / rate
            after = after + by_time[:, None] * shift
        self._carried = after

    def _apply_impact(self, old: StepState, new: StepState) -> None:
        """Apply an impact R(x, t): the disturbances become ``R_x Y + R_t t'``, with the shift t' of its time."""
        n, switching = self._problem.system.size, self._forces.switching
        impulse = np.zeros_like(new.local) if new.impulse is None else new.impulse
        held = np.flatnonzero(impulse[switching] > 0.0)
        hit, rate = self._starter.impact_data(self._instant(old.time), held), old.rate[switching[held]]
        before, shift = self._carried, self._shift
        if shift is None:  # at the end of a step
            first = int(np.argmax(rate))
            shift = -(hit.sense[first] @ before[:n]) / rate[first]
            before = before + self._flow(old)[:, None] * shift
        d, v, z = split_state(before, n)
        factor, beside = hit.reversal(rate), _BESIDE * self._problem.step
        later, earlier = (self._change(old, held, factor, sign * beside) for sign in (1.0, -1.0))
        v = v + hit.velocity_change(hit.sense @ v + hit.turning @ d, factor)
        v = v + (later - earlier)[:, None] * shift / (2.0 * beside)
        self._carried, self._shift = np.vstack([d, v, z]), shift

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
        rates = self._forces.state_rates(moment.penetration, moment.inner) if len(moment.inner) else moment.inner
        return np.concatenate([moment.v, moment.a, rates])

    def _instant(self, time: float) -> StepInputs:
        motion = self._problem.drive.at(np.array([time]))
        return StepInputs(time, self._problem.system.load_vector(motion)[0], self._forces.prescribed_inputs(motion))


@dataclass(frozen=True, eq=False)
class Floquet:
    """Floquet multipliers of a periodic motion.

    Parameters
    ----------
    multipliers
        Largest first, complex, shape (2m + s,): of m unknowns integrated and s internal states of local forces.
    shapes
        Displacements of all unknowns at the beginning of the period, complex, shape (n, 2m + s).
    period
        s.
    names
        Of the unknowns.
    events
        Number of contact openings and closings within the period. Large multipliers may then indicate chatter: small
        differences of the times of bounces grow.
    """

    multipliers: ComplexArray
    shapes: ComplexArray
    period: float
    names: tuple[str, ...]
    events: int = 0

    @property
    def growth(self) -> float:
        """Growth rate of the largest disturbance, 1/s; negative if it decays."""
        return math.log(max(abs(complex(self.multipliers[0])), np.finfo(float).tiny)) / self.period

    def stable(self, tolerance: float = 1e-5) -> bool:
        """Return whether no multiplier exceeds 1 by more than a tolerance.

        A free motion has a double multiplier of 1, which is accurate to half the digits or fewer.
        """
        return bool(abs(self.multipliers[0]) <= 1.0 + tolerance)

    def moving(self, count: int = 3) -> list[str]:
        """Return the names of the unknowns that move most in the largest disturbance."""
        order: list[int] = np.argsort(-np.abs(self.shapes[:, 0])).tolist()
        return [self.names[i] for i in order[:count]]


def floquet(problem: Problem, method: Method | None = None) -> Floquet:
    """Return the Floquet multipliers of a motion over one period.

    Parameters
    ----------
    problem
        One period, from its periodic state.
    method
        Method for the motion; disturbances use the average acceleration. None for the average acceleration.

    Returns
    -------
    Floquet
        The multipliers.

    Raises
    ------
    InputError
        If there are no unknowns, or too many.
    RunFailedError
        If the run of the period fails.
    """
    chosen = method or newmark()
    whole = replace(problem, prune=False)  # what the motion leaves at rest may still be unstable
    selected = select_engine(whole, chosen, SaveAt(field_every=problem.steps + 1))
    n = selected.problem.system.size
    if not 0 < n <= MAX_UNKNOWNS:
        raise refuse("system", f"{n} unknowns", f"1 to {MAX_UNKNOWNS}", "the derivatives are dense")
    found = period_map(selected, chosen, lambda: False)
    values, vectors = np.linalg.eig(found.derivative)
    order = np.argsort(-np.abs(values))
    shapes = np.asarray(vectors[:n, order], dtype=complex).T
    for basis in selected.bases:
        real, imaginary = (np.asarray(part(shapes), dtype=float) for part in (np.real, np.imag))
        shapes = basis.spread(real) + 1j * basis.spread(imaginary)
    values = np.asarray(values[order], dtype=complex)
    return Floquet(values, shapes.T, problem.step * problem.steps, problem.system.names, found.events)
