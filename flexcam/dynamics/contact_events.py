"""Contact events: location of zero crossings within a step, and sub-steps to them."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from flexcam.core import FloatArray, IntArray
from flexcam.dynamics.force_laws import passes_ramp
from flexcam.dynamics.initial_acceleration import InitialAcceleration
from flexcam.dynamics.integrator import At, NoConvergenceError, Stepper
from flexcam.dynamics.local_forces import LocalForces
from flexcam.dynamics.step_state import StepInputs, StepState

END_TOLERANCE = 1e-9
"""Fraction of a step within which an event coincides with one of its ends."""

TIME_TOLERANCE = 1e-12
"""Tolerance of an event time as a fraction of a step."""

ROUNDING = 4.0 * 2.220446049250313e-16
"""Relative rounding of time differences."""

SIMULTANEITY = 1e-6
"""Fraction of a step within which events are simultaneous, such as those of two symmetric trains."""

MOST_EVENTS = 40
"""Maximum number of events within one step; further chatter is not located."""

CORRECTIONS = 60

MIN_REDUCTION = 0.01
"""Minimum relative reduction of a bracket by a secant step."""


def find_crossing(
    pressed: bool, penetration: float, new_penetration: float, rate: float, new_rate: float, length: float
) -> float:
    """Return the time in (0, length) of the sign change of the cubic through both ends, by bisection: a first guess."""
    low, high = 0.0, 1.0
    for _ in range(20):
        x = 0.5 * (low + high)
        y = 1.0 - x
        value = y * y * ((1.0 + 2.0 * x) * penetration + x * length * rate) + x * x * (
            (3.0 - 2.0 * x) * new_penetration - y * length * new_rate
        )
        if (value > 0.0) == pressed:
            low = x
        else:
            high = x
    return high * length


Bracket = tuple[float, float, float, float, bool]
"""Times that bracket a sign change (s), the values there (m), and whether the later was found last."""


def narrow_bracket(
    pressed: bool, after: float, penetration: float, rate: float, bracket: Bracket
) -> tuple[float, float, float, float, float, bool]:
    """Return the next estimate of the zero, by Newton's method within the bracket, and the new bracket."""
    low, high, near, far, was_crossed = bracket
    crossed = (penetration > 0.0) != pressed
    if crossed:
        if was_crossed:  # same end twice: the Illinois rule avoids slow convergence at a stiff contact
            near *= 0.5
        high, far = after, penetration
    else:
        low, near = after, penetration
    newton = after - penetration / rate if rate != 0.0 else high
    if crossed and was_crossed:
        # After an event the scalar starts at zero up to rounding, which is not the zero sought.
        newton = max(low - near * (high - low) / (far - near), low + MIN_REDUCTION * (high - low))
    if not low < newton < high:
        newton = 0.5 * (low + high)
    return newton, low, high, near, far, crossed


MAX_HALVINGS = 6
"""Maximum number of times that a step is halved."""

_SAME_LENGTH = 1e-6
"""Tolerance for recognizing a step length, as a fraction."""

_SLOW = 1e-3
"""Approach velocity, m/s, below which bodies meet without an impact and the contact law acts."""

Bools = NDArray[np.bool_]


class EventStepper:
    """Stepper with stops at events where a contact switches; the regular step is given in s.

    `stepper` returns the stepper of a step length, `at` the prescribed inputs at a time; `balances` says whether the
    acceleration balances the forces of the same instant.
    """

    def __init__(
        self, step: float, forces: LocalForces, starter: InitialAcceleration, at: At,
        stepper: Callable[[float], Stepper], *,
        balances: bool,
    ) -> None:  # fmt: skip
        self._step, self._forces, self._starter, self._at = step, forces, starter, at
        self._stepper, self._balances = stepper, balances
        self._bouncing = ~np.isnan(forces.restitution)  # which contacts have a restitution
        self._bounces = bool(self._bouncing.any())
        self._has_ramps = bool(np.isfinite(forces.ramps).any())
        self._halved = dict[int, Stepper]()
        self.events = 0  #: number of events located so far

    def walk(self, now: StepState, to: StepInputs, halvings: int = 0) -> list[StepState]:
        """Return the instants after `now` up to and including `to`."""
        try:
            return self._walk(now, to)
        except NoConvergenceError:
            if halvings == MAX_HALVINGS:
                raise
        first = self.walk(now, self._at(0.5 * (now.time + to.time)), halvings + 1)
        return [*first, *self.walk(first[-1], to, halvings + 1)]

    def _walk(self, now: StepState, to: StepInputs) -> list[StepState]:
        instants: list[StepState] = []
        locates_ramps = self._has_ramps
        for _ in range(MOST_EVENTS):
            trial = self._advance(now, to)
            if not len(self._forces.switching):
                return [*instants, trial]
            ramp_ends = self._ramp_ends(now, trial) if locates_ramps else np.zeros(len(self._forces.ramps), dtype=bool)
            if not ramp_ends.any() and not (self._sides(now) != self._sides(trial)).any():
                if self._bounces and (names := self._rebounds(now, trial)):
                    raise NoConvergenceError(names)  # the step is halved: its ends do not show the impact
                return [*instants, trial]
            found = self._first_event(now, trial, to, ramp_ends)
            locates_ramps = self._has_ramps and (found[-1].time > now.time or not ramp_ends.any())  # else it is passed
            instants += found
            now = instants[-1]
            if now.time == to.time:
                return instants
        return [*instants, self._advance(now, to)]

    def _advance(self, now: StepState, to: StepInputs) -> StepState:
        length = to.time - now.time
        halvings = round(math.log2(self._step / length)) if length > 0.0 else -1
        # Time differences have the rounding of the time itself, so step lengths are matched with a tolerance.
        tolerance = _SAME_LENGTH + ROUNDING * abs(to.time) / length if length > 0.0 else 0.0
        if halvings < 0 or abs(length * 2.0**halvings / self._step - 1.0) > tolerance:
            return self._stepper(length).advance(now, to)
        if halvings not in self._halved:
            self._halved[halvings] = self._stepper(self._step / 2.0**halvings)
        return self._halved[halvings].advance(now, to)

    def _sides(self, moment: StepState) -> Bools:
        return moment.sides(self._forces.contact_sides)

    def _rebounds(self, now: StepState, trial: StepState) -> list[str]:
        """Return the contacts with restitution whose force may act and vanish between the ends of a step."""
        (penetration, rate), (_, new_rate) = self._penetrations(now), self._penetrations(trial)
        reaches = penetration + (trial.time - now.time) * rate > 0.0
        turns = (rate > _SLOW) & (new_rate < -_SLOW)
        rebounds = reaches & turns & ~self._sides(now) & self._bouncing
        return [self._forces.names[i] for i in self._forces.switching[rebounds]]

    def _ramp_ends(self, now: StepState, trial: StepState) -> Bools:
        """Return which closed contacts pass the end of the ramp of their damping within a step.

        The force of a step across this kink would depend on where the step begins.
        """
        ends = zip(*(self._penetrations(end)[0].tolist() for end in (now, trial)), self._forces.ramps, strict=True)
        return np.array([passes_ramp(*end) for end in ends], dtype=bool) & self._sides(now)

    def _first_event(self, now: StepState, trial: StepState, to: StepInputs, ramp_ends: Bools) -> list[StepState]:
        """Return the instant of the first event or end of a ramp, and the one after an impact."""
        side, ramps, length = self._sides(now), self._forces.ramps, to.time - now.time
        crossed = side != self._sides(trial)
        roots = self._crossing_times(now, trial, np.flatnonzero(crossed), side, np.zeros(len(side)))
        beyond = self._penetrations(now)[0] > ramps
        ends = self._crossing_times(now, trial, np.flatnonzero(ramp_ends), beyond, ramps)
        first, end = int(np.argmin(roots)), int(np.argmin(ends))
        if ends[end] < roots[first]:
            guess = float(ends[end])
            return [self._locate_crossing(now, trial, to, end, guess, bool(beyond[end]), float(ramps[end]))[0]]
        self.events += 1
        moment, inputs = self._locate_crossing(now, trial, to, first, float(roots[first]), bool(side[first]))
        pressed = self._forces.contact_sides(moment.penetration)
        simultaneous = crossed & (np.abs(roots - roots[first]) <= SIMULTANEITY * length)
        pressed[simultaneous] = ~side[simultaneous]
        moment = replace(moment, pressed=pressed)
        if not self._balances:
            moment = replace(self._starter.restart(moment), pressed=pressed)
        return self._apply_impact(moment, inputs, pressed & ~side)

    def _crossing_times(
        self, now: StepState, trial: StepState, scalars: IntArray, sides: Bools, depths: FloatArray
    ) -> FloatArray:
        """Return first guesses of the times at which some switching scalars pass a depth; infinite for the others."""
        (begin, rate), (end, new_rate) = self._penetrations(now), self._penetrations(trial)
        rows = np.stack([begin - depths, end - depths, rate, new_rate], axis=1).tolist()
        times = np.full(len(sides), np.inf)
        for i in scalars.tolist():
            x, new_x, v, new_v = rows[i]
            times[i] = find_crossing(bool(sides[i]), x, new_x, v, new_v, trial.time - now.time)
        return times

    def _locate_crossing(
        self, now: StepState, trial: StepState, to: StepInputs, scalar: int, guess: float, side: bool,
        depth: float = 0.0,
    ) -> tuple[StepState, StepInputs]:  # fmt: skip
        """Return the instant near a given time at which a scalar passes a depth, by Newton's method in a bracket."""
        length = to.time - now.time
        low, high, elapsed = 0.0, length, guess
        tolerance = max(TIME_TOLERANCE * length, ROUNDING * abs(to.time))
        moment, inputs, was_crossed = trial, to, False
        near, far = (float(self._penetrations(end)[0][scalar]) - depth for end in (now, trial))
        # A stiff contact in the trial holds the penetration small, wherever in the step the crossing lies.
        at_end = abs(far) <= END_TOLERANCE * length * abs(float(self._penetrations(now)[1][scalar]))
        for _ in range(CORRECTIONS):
            if elapsed <= END_TOLERANCE * length:
                return replace(now, impulse=None, iterations=0), self._at(now.time)
            if elapsed >= (1.0 - END_TOLERANCE) * length:
                if at_end:
                    return trial, to
                elapsed = 0.5 * (low + high)
            inputs = self._at(now.time + elapsed)
            moment = self._advance(now, inputs)
            penetration, rate = (float(values[scalar]) for values in self._penetrations(moment))
            penetration -= depth
            if abs(penetration) <= tolerance * abs(rate) or high - low <= tolerance:
                break
            bracket = (low, high, near, far, was_crossed)
            elapsed, low, high, near, far, was_crossed = narrow_bracket(side, elapsed, penetration, rate, bracket)
        return moment, inputs

    def _apply_impact(self, moment: StepState, inputs: StepInputs, closed: Bools) -> list[StepState]:
        restitution = self._forces.restitution
        closing = closed & (self._penetrations(moment)[1] > _SLOW) & self._bouncing
        if not closing.any() or moment.pressed is None:
            return [moment]
        after = self._starter.impact(moment, inputs, np.flatnonzero(moment.pressed & self._bouncing))
        # Without restitution a contact stays closed unless another impulse separates it.
        stays_closed = self._penetrations(after)[1] > np.where(restitution == 0.0, -_SLOW, 0.0)
        pressed, penetration = np.where(closing, stays_closed, moment.pressed), after.penetration.copy()
        penetration[self._forces.switching[closing]] = 0.0  # the remainder is rounding: it would determine the opening
        return [moment, replace(after, pressed=pressed, penetration=penetration)]

    def _penetrations(self, moment: StepState) -> tuple[FloatArray, FloatArray]:
        lifts, index = self._forces.lifts, self._forces.switching
        return lifts.depth(moment.penetration)[index], lifts.depth_rate(moment.penetration, moment.rate)[index]
