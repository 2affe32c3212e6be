"""Where a scalar passes zero within a step: in plain numbers, for the steps of every way through time."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from flexcam.core import FloatArray
from flexcam.dynamics.implicit_step import NoConvergenceError
from flexcam.dynamics.initial_acceleration import InitialAcceleration
from flexcam.dynamics.integrator import At, Stepper
from flexcam.dynamics.local_forces import LocalForces
from flexcam.dynamics.step_state import StepInputs, StepState

CLOSE = 1e-9
"""Share of a step within which an event counts as at one of its ends."""

SHARP = 1e-12
"""Share of a step by which an event may be missed."""

ROUNDING = 4.0 * 2.220446049250313e-16
"""Of a time: what differences of times carry."""

TOGETHER = 1e-6
"""Share of a step within which events are one, such as those of two trains that mirror each other."""

MOST_EVENTS = 40
"""Within one step; what chatters beyond is taken as it comes."""

CORRECTIONS = 60

LEAST = 0.01
"""Part of a bracket by which a straight line between its ends narrows it at least."""


def crossing(pressed: bool, gap: float, new_gap: float, rate: float, new_rate: float, length: float) -> float:
    """Return the time in (0, length) at which the cubic through both ends changes sides, by bisection."""
    low, high = 0.0, 1.0
    for _ in range(50):
        x = 0.5 * (low + high)
        y = 1.0 - x
        value = y * y * ((1.0 + 2.0 * x) * gap + x * length * rate) + x * x * (
            (3.0 - 2.0 * x) * new_gap - y * length * new_rate
        )
        if (value > 0.0) == pressed:
            low = x
        else:
            high = x
    return high * length


Bracket = tuple[float, float, float, float, bool]
"""Times between which a scalar changes sides (s), the scalar there (m), and whether the later was the last found."""


def narrow_bracket(
    pressed: bool, after: float, gap: float, rate: float, bracket: Bracket
) -> tuple[float, float, float, float, float, bool]:
    """Return where to look next for the zero of a scalar, and the bracket: Newton's method, kept within it."""
    low, high, near, far, was_beyond = bracket
    beyond = (gap > 0.0) != pressed
    if beyond:
        if was_beyond:  # the same end again: the Illinois rule, lest a stiff contact's side is crept along
            near *= 0.5
        high, far = after, gap
    else:
        low, near = after, gap
    newton = after - gap / rate if rate != 0.0 else high
    if beyond and was_beyond:
        # Behind an event the scalar begins at zero but for rounding, which is not the zero that is looked for.
        newton = max(low - near * (high - low) / (far - near), low + LEAST * (high - low))
    if not low < newton < high:
        newton = 0.5 * (low + high)
    return newton, low, high, near, far, beyond


_MOST_HALVINGS = 6

_WHOLE = 1e-6
"""Share of a step by which it may seem longer or shorter than it is."""

_SLOW = 1e-3
"""Rate of approach, m/s, up to which bodies meet without an impact: the contact's own law then holds them."""

Bools = NDArray[np.bool_]


class EventStepper:
    """Walks from instant to instant, with stops in between where a contact switches.

    Parameters
    ----------
    step
        The usual one, s.
    forces
        The system's local forces, stacked.
    starter
        Restarts after an event.
    at
        What is prescribed at a time, s.
    stepper
        Makes what takes steps of a length, s.
    balances
        Whether the acceleration balances the forces of its own instant.

    Attributes
    ----------
    events
        How many were located so far.
    """

    def __init__(
        self, step: float, forces: LocalForces, starter: InitialAcceleration, at: At,
        stepper: Callable[[float], Stepper], *,
        balances: bool,
    ) -> None:  # fmt: skip
        self._step, self._forces, self._starter, self._at = step, forces, starter, at
        self._stepper, self._balances = stepper, balances
        self._halved: dict[int, Stepper] = {0: self._stepper(step)}
        self.events = 0

    def walk(self, now: StepState, to: StepInputs, halvings: int = 0) -> list[StepState]:
        """Return the instants behind `now` up to `to`, which is the last."""
        try:
            return self._walk(now, to)
        except NoConvergenceError:
            if halvings == _MOST_HALVINGS:
                raise
        first = self.walk(now, self._at(0.5 * (now.time + to.time)), halvings + 1)
        return [*first, *self.walk(first[-1], to, halvings + 1)]

    def _walk(self, now: StepState, to: StepInputs) -> list[StepState]:
        walked: list[StepState] = []
        for _ in range(MOST_EVENTS):
            trial = self._advance(now, to)
            if not len(self._forces.switching) or not (self._side(now) != self._side(trial)).any():
                return [*walked, trial]
            walked += self._event(now, trial, to)
            now = walked[-1]
            if now.time == to.time:
                return walked
        return [*walked, self._advance(now, to)]

    def _advance(self, now: StepState, to: StepInputs) -> StepState:
        length = to.time - now.time
        halvings = round(math.log2(self._step / length)) if length > 0.0 else -1
        # Differences of times carry the rounding of the time itself: whole, halved... steps are recognized generously.
        vague = _WHOLE + ROUNDING * abs(to.time) / length if length > 0.0 else 0.0
        if halvings < 0 or abs(length * 2.0**halvings / self._step - 1.0) > vague:
            return self._stepper(length).advance(now, to)
        if halvings not in self._halved:
            self._halved[halvings] = self._stepper(self._step / 2.0**halvings)
        return self._halved[halvings].advance(now, to)

    def _side(self, moment: StepState) -> Bools:
        return self._forces.pressed(moment.gap) if moment.pressed is None else moment.pressed

    def _event(self, now: StepState, trial: StepState, to: StepInputs) -> list[StepState]:
        """Return the instant of the first switch, and behind it the one after an impact."""
        self.events += 1
        side, crossed = self._side(now), self._side(now) != self._side(trial)
        length = to.time - now.time
        (gap, rate), (new_gap, new_rate) = self._gaps(now), self._gaps(trial)
        roots = [
            crossing(bool(side[i]), gap[i], new_gap[i], rate[i], new_rate[i], length) if crossed[i] else np.inf
            for i in range(len(crossed))
        ]
        first = int(np.argmin(roots))
        moment, there = self._stopped(now, trial, to, first, roots[first])
        pressed = self._forces.pressed(moment.gap)
        together = crossed & (np.abs(np.array(roots) - roots[first]) <= TOGETHER * length)
        pressed[together] = ~side[together]
        moment = replace(moment, pressed=pressed)
        if not self._balances:
            moment = replace(self._starter.restarted(moment), pressed=pressed)
        return self._struck(moment, there, pressed & ~side)

    def _stopped(
        self, now: StepState, trial: StepState, to: StepInputs, which: int, guess: float
    ) -> tuple[StepState, StepInputs]:
        """Return the instant at which a scalar passes zero, about a time after now.

        Newton's method, kept within a bracket.
        """
        length, side = to.time - now.time, bool(self._side(now)[which])
        low, high, after = 0.0, length, guess
        sharp = max(SHARP * length, ROUNDING * abs(to.time))
        moment, there, was_beyond = trial, to, False
        near, far = float(self._gaps(now)[0][which]), float(self._gaps(trial)[0][which])
        for _ in range(CORRECTIONS):
            if after <= CLOSE * length:
                return replace(now, impulse=None, iterations=0), self._at(now.time)
            if after >= (1.0 - CLOSE) * length:
                return trial, to
            there = self._at(now.time + after)
            moment = self._advance(now, there)
            its_gap, its_rate = (float(one[which]) for one in self._gaps(moment))
            if abs(its_gap) <= sharp * abs(its_rate) or high - low <= sharp:
                break
            bracket = (low, high, near, far, was_beyond)
            after, low, high, near, far, was_beyond = narrow_bracket(side, after, its_gap, its_rate, bracket)
        return moment, there

    def _struck(self, moment: StepState, there: StepInputs, closed: Bools) -> list[StepState]:
        restitution = self._forces.restitution
        bouncing = ~np.isnan(restitution)
        struck = closed & (self._gaps(moment)[1] > _SLOW) & bouncing
        if not struck.any() or moment.pressed is None:
            return [moment]
        after = self._starter.impact(moment, there, np.flatnonzero(moment.pressed & bouncing))
        # Without restitution a contact stays closed, unless another one's impulse drives its bodies apart.
        stays = self._gaps(after)[1] > np.where(restitution == 0.0, -_SLOW, 0.0)
        pressed, gap = np.where(struck, stays, moment.pressed), after.gap.copy()
        gap[self._forces.switching[struck]] = 0.0  # what is left of it is rounding, which would say when it opens again
        return [moment, replace(after, pressed=pressed, gap=gap)]

    def _gaps(self, moment: StepState) -> tuple[FloatArray, FloatArray]:
        """Return the switching scalars and their rates."""
        return moment.gap[self._forces.switching], moment.rate[self._forces.switching]
