"""What a revolution makes of a state and of small disturbances of it: the map of a period and its derivative.

The derivative is the product of those of the steps of the average acceleration between successive instants of a run,
events and impacts among them, so that it is that of the numerical motion itself. The time of an event depends on the
disturbance: a step ends with it, the velocities may jump, and the next step begins with it. For short steps the three
together are the saltation matrix, ``R_x + (f+ - R_x f- - R_t) g_x'/g'`` for an impact R at g = 0: R. I. Leine and H.
Nijmeijer, Dynamics and Bifurcations of Non-Smooth Mechanical Systems (2004), ch. 7 and 8; M. di Bernardo et al.,
Piecewise-smooth Dynamical Systems (2008), sec. 2.5.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from flexcam.integrate.first import Starter
from flexcam.integrate.linear_step import LinearStep, parts
from flexcam.integrate.local import LocalForces
from flexcam.integrate.method import Method
from flexcam.integrate.moment import Instant, Moment
from flexcam.integrate.problem import Problem
from flexcam.integrate.schedule import Schedule
from flexcam.integrate.solve import pilot, singular
from flexcam.integrate.stepwise import Stepwise
from flexcam.integrate.tangent import Linear, Linearization, directions
from flexcam.linalg import FloatArray, IntArray, SingularMatrixError
from flexcam.response import RunFailedError, SaveAt, Stats

LARGEST = 400
"""Unknowns up to which a basis of disturbances is carried along."""

_BLOCK = 500
"""Steps whose instants are in memory together."""

_SAME = 1e-9
"""Difference of the lengths of two steps, as a part of them, that is rounding of their times."""

_OFTEN = 40
"""Equal steps in a row from which a power of their matrix is cheaper than one after the other."""

_TOUCH = 1e-15
"""Depth, m, of a contact that is about to part or to close: on its side, and nowhere."""

_AT_ONCE = 1e-6
"""Part of a step within which it is about to."""

_BESIDE = 1e-3
"""Part of a step by which one looks to both sides of an event."""

Bools = NDArray[np.bool_]


@dataclass(frozen=True, eq=False)
class Revolution:
    """A period of a problem, with its states as displacements, velocities and internal states in a row.

    Parameters
    ----------
    end
        The state behind it, shape (2n + s,).
    derivative
        Of the end by the begin, shape (2n + s, 2n + s); empty where it was not asked for.
    fields
        Displacements and velocities at the ends of steps, shape (m, 2n).
    events
        Contacts that opened or closed.
    """

    end: FloatArray
    derivative: FloatArray
    fields: FloatArray
    events: int


def revolution(problem: Problem, method: Method, stop: Callable[[], bool], *, derived: bool = True) -> Revolution:
    """Return a period of a problem in its own unknowns.

    Raises
    ------
    RunFailedError
        If the run breaks off, with its status.
    """
    if refusal := method.refusal(problem.system, problem.step):
        raise refusal
    try:
        return _revolved(problem, method, stop, derived=derived)
    except SingularMatrixError as fault:
        raise RunFailedError(singular(fault, problem.system)) from None


def _revolved(problem: Problem, method: Method, stop: Callable[[], bool], *, derived: bool) -> Revolution:
    forces = LocalForces(problem.system)
    engine = Stepwise(problem, method, forces, SaveAt(field_every=problem.steps + 1), stop, pilot)
    disturbances, fields = Disturbances(problem, forces) if derived else None, list[FloatArray]()
    end = np.zeros(0)
    for begin in range(0, problem.steps + 1, _BLOCK):
        with np.errstate(over="ignore", invalid="ignore"):
            walked, track, status = engine.walk(np.arange(begin, min(begin + _BLOCK, problem.steps + 1)))
        if not status.ok:
            raise RunFailedError(status)
        if disturbances is not None:
            disturbances.follow([moment for part in walked for moment in part])
        fields.append(np.hstack([track.d, track.v])[track.ends])
        end = np.concatenate([track.d[-1], track.v[-1], track.state[-1]])
    derivative = np.zeros((0, 0)) if disturbances is None else disturbances.carried()
    return Revolution(end, derivative, np.concatenate(fields), engine.counted(Stats()).events)


class Disturbances:
    """What becomes of a unit disturbance of every displacement, velocity and internal state.

    Parameters
    ----------
    problem
        The problem, of which system, drive and step count.
    forces
        Its local forces, stacked.
    """

    def __init__(self, problem: Problem, forces: LocalForces) -> None:
        self._problem, self._forces = problem, forces
        self._linear = Linearization(problem.system, forces)
        self._stepper = LinearStep(problem.system)
        self._starter = Starter(problem.system, forces)
        self._carried: FloatArray = np.eye(2 * problem.system.size + len(forces.start_state))
        self._last: Moment | None = None
        self._waiting: tuple[Linear, Linear, float] | None = None
        self._count = 0
        self._shift: FloatArray | None = None

    def follow(self, moments: list[Moment]) -> None:
        """Carry the disturbances on over successive instants, from the last one followed before."""
        every = moments if self._last is None else [self._last, *moments]
        schedule = self._forces.schedule(self._problem.drive.at(np.array([one.time for one in every])))
        if self._last is None:
            first = self._at(schedule, 0, every[0], self._side(every[0]))
            self._carried = self._stepper.begun(first, self._carried)
        begin: Linear | None = None
        for i, (old, new) in enumerate(pairwise(every)):
            side = self._side(old)
            if new.time > old.time and self._shift is None and (side == self._side(new)).all():
                end = self._at(schedule, i + 1, new, side)
                self._step(begin or self._at(schedule, i, old, side), end, new.time - old.time)
                begin = end  # of the next step as well
                continue
            begin = None
            self._flush()
            if new.time > old.time:
                self._pass(schedule, i, old, new)
            elif new.impulse is not None:
                self._strike(old, new)
        self._last = every[-1]

    def carried(self) -> FloatArray:
        """Return what has become of the disturbances, shape (2n + s, 2n + s)."""
        self._flush()
        if self._last is None or self._shift is None:
            return self._carried
        return self._carried - self._flow(self._last)[:, None] * self._shift  # the end does not shift with a last event

    def _side(self, moment: Moment) -> Bools:
        return self._forces.pressed(moment.gap) if moment.pressed is None else moment.pressed

    def _at(self, schedule: Schedule, i: int, moment: Moment, side: Bools) -> Linear:
        """Return the linear system at an instant, every contact on the side on which it is within the step."""
        return self._linear.at(schedule, i, self._on(side, moment), moment.rate, moment.inner)

    def _on(self, side: Bools, moment: Moment) -> FloatArray:
        """Return what is sensed, with contacts that are about to part or to close on their side."""
        gap, which = moment.gap.copy(), self._forces.switching
        depth = gap[which]
        there = np.abs(depth) <= _AT_ONCE * self._problem.step * np.abs(moment.rate[which])
        gap[which] = np.where(there, np.where(side, _TOUCH, -_TOUCH), depth)
        return gap

    def _step(self, old: Linear, new: Linear, length: float) -> None:
        if self._waiting is not None:
            begin, end, usual = self._waiting
            if begin is old and end is new and abs(length - usual) <= _SAME * usual:
                self._count += 1
                return
        self._flush()
        self._waiting, self._count = (old, new, length), 1

    def _flush(self) -> None:
        """Take the steps that wait, all of them equal."""
        if self._waiting is None:
            return
        if self._count < _OFTEN:
            for _ in range(self._count):
                self._carried = self._stepper.carried(*self._waiting, self._carried)
        else:
            one = self._stepper.carried(*self._waiting, np.eye(len(self._carried)))
            self._carried = np.linalg.matrix_power(one, self._count) @ self._carried
        self._waiting, self._count = None, 0

    def _pass(self, schedule: Schedule, i: int, old: Moment, new: Moment) -> None:
        """Take a step that begins or ends at an event, whose time follows the disturbances.

        An event at g(d, t) = 0 comes later by ``-g_d Y/g'``, with the rate of g by the length of the step.
        """
        side, h = self._side(old), new.time - old.time
        begin, end = self._at(schedule, i, old, side), self._at(schedule, i + 1, new, side)
        longer = self._stepper.impulse(self._flow(old), self._flow(new))
        moved: FloatArray = np.zeros_like(self._carried)
        if self._shift is not None:
            moved = (self._stepper.passed(0.5 * h * self._drift(old, side)) - longer)[:, None] * self._shift
        after, self._shift = self._stepper.carried(begin, end, h, self._carried, moved), None
        crossed = np.flatnonzero(side != self._side(new))
        if len(crossed):
            which = self._forces.switching[crossed]
            which = int(which[np.argmin(np.abs(new.gap[which] / new.rate[which]))])
            longer = (longer + 0.5 * h * self._drift(new, side))[:, None]
            by_time = self._stepper.carried(begin, end, h, np.zeros_like(longer), longer)[:, 0]
            sense, n = directions(self._forces, schedule, i + 1)[1][which], len(new.d)
            rate = new.rate[which] + sense @ (by_time[:n] - new.v)
            self._shift = shift = -(sense @ after[:n]) / rate
            after = after + by_time[:, None] * shift
        self._carried = after

    def _strike(self, old: Moment, new: Moment) -> None:
        """Go on behind an impact R(x, t): the disturbances become ``R_x Y + R_t t'``, with the shift t' of its time."""
        n, switching = self._problem.system.size, self._forces.switching
        held = np.flatnonzero(_impulse(new)[switching] > 0.0)
        hit, rate = self._starter.struck(self._instant(old.time), held), old.rate[switching[held]]
        before, shift = self._carried, self._shift
        if shift is None:  # at the end of a step
            first = int(np.argmax(rate))
            shift = -(hit.sense[first] @ before[:n]) / rate[first]
            before = before + self._flow(old)[:, None] * shift
        d, v, z = parts(before, n)
        factor, beside = hit.reversal(rate), _BESIDE * self._problem.step
        later, earlier = (self._change(old, held, factor, sign * beside) for sign in (1.0, -1.0))
        v = v + hit.turned(hit.sense @ v + hit.turning @ d, factor)
        v = v + (later - earlier)[:, None] * shift / (2.0 * beside)
        self._carried, self._shift = np.vstack([d, v, z]), shift

    def _change(self, old: Moment, held: IntArray, factor: FloatArray, after: float) -> FloatArray:
        """Return by how much the velocities would change if the same motion met a little later, shape (n,)."""
        to = self._instant(old.time + after)
        hit = self._starter.struck(to, held)
        rate = hit.sense @ old.v + hit.turning @ old.d + to.schedule.offset_rate[0][self._forces.switching[held]]
        return hit.turned(rate, factor)

    def _drift(self, moment: Moment, side: Bools) -> FloatArray:
        """Return by how much the cam alone changes forces (n,) and rates of internal states (s,), per second.

        Contacts stay on their side: what the cam does to their depth is weighed with their stiffness there.
        """
        beside = _BESIDE * self._problem.step
        before, there, after = (self._instant(moment.time + one * beside) for one in (-1.0, 0.0, 1.0))
        forces, state = self._forces, moment.inner

        def slope(earlier: FloatArray, later: FloatArray) -> FloatArray:
            return (later - earlier) / (2.0 * beside)

        if not forces.count:
            return np.concatenate([np.zeros_like(moment.d), slope(before.load, after.load)])
        seen = [forces.sensed(moment.d[None], moment.v[None], one.schedule) for one in (before, after)]
        by_gap, by_rate = (slope(one[0], other[0]) for one, other in zip(*(part[:2] for part in seen), strict=True))
        gap = self._on(side, moment)
        early, now, late = (forces.respond(gap, moment.rate, state, one.schedule) for one in (before, there, after))
        force = slope(early.force, late.force) + now.by_gap @ by_gap + now.by_rate @ by_rate
        act, turned = there.schedule.acting(0), slope(before.schedule.acting(0), after.schedule.acting(0))
        pushed = slope(before.load, after.load) + (force @ act + now.force @ turned) @ forces.act.vectors
        if not len(state):
            return np.concatenate([np.zeros_like(moment.d), pushed])
        flow = slope(early.state_rate, late.state_rate)
        flow += now.state_rate_by_gap @ by_gap + now.state_rate_by_rate @ by_rate
        return np.concatenate([np.zeros_like(moment.d), pushed, flow])

    def _flow(self, moment: Moment) -> FloatArray:
        """Return velocities, accelerations and rates of internal states in a row."""
        rates = self._forces.state_rates(moment.gap, moment.inner) if len(moment.inner) else moment.inner
        return np.concatenate([moment.v, moment.a, rates])

    def _instant(self, time: float) -> Instant:
        motion = self._problem.drive.at(np.array([time]))
        return Instant(time, self._problem.system.applied(motion)[0], self._forces.schedule(motion))


def _impulse(moment: Moment) -> FloatArray:
    return np.zeros_like(moment.local) if moment.impulse is None else moment.impulse
