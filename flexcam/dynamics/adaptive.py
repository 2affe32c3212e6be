"""Adaptive time steps: the given step, halved as often as the error requires.

The error of a step is the difference of the displacement from the Taylor series with a linear acceleration, ``d0 + h v0
+ h^2 (a0/3 + a1/6)``: O. C. Zienkiewicz and Y. M. Xie, Earthq. Eng. Struct. Dyn. 20 (1991). Halving preserves the
output instants and needs one operator per step length.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import pairwise

import numpy as np

from flexcam.core import FloatArray
from flexcam.dynamics.blocks import Series
from flexcam.dynamics.contact_events import EventStepper
from flexcam.dynamics.integrator import At
from flexcam.dynamics.problem import Adaptive
from flexcam.dynamics.step_state import StepInputs, StepState
from flexcam.dynamics.system import System

_MOST_HALVINGS = 16
_DOUBLING_LIMIT = 1.0 / 16.0
"""Fraction of the tolerance below which the step is doubled: the error grows by 8, with a safety factor of 2."""


class StepFloorError(ArithmeticError):
    """The error at the smallest step, s, is too large, `times` the tolerance, most at one unknown."""

    def __init__(self, unknown: int, times: float, step: float) -> None:
        super().__init__(f"unknown {unknown}: {times:.3g} times the tolerance at {step:.3g} s")
        self.unknown, self.times, self.step = unknown, times, step


class EnergyNorm:
    """Energy norm of displacements, relative to the largest of a representative motion.

    The weights are the diagonals of the stiffness and, for unknowns without stiffness, of the mass at the frequency of
    the motion, so that the norm does not depend on units. `unseen` is the error not visible in displacements, see
    `Method`.
    """

    def __init__(self, system: System, motion: Series, unseen: float = 0.0) -> None:
        self._unseen = unseen
        stiff, mass = (np.abs(matrix.diagonal()) for matrix in (system.stiffness, system.mass))
        moved = motion.displacement - motion.displacement[:1]
        heavy, fast = (float((series**2 @ mass).max(initial=0.0)) for series in (moved, motion.velocity))
        self._weights = np.sqrt(stiff + mass * (fast / heavy if heavy > 0.0 else 0.0))
        self._size = float(np.linalg.norm(moved * self._weights, axis=1).max(initial=0.0))

    def error(self, moments: Sequence[StepState]) -> tuple[float, int]:
        """Return the largest relative error of successive steps, and the unknown with it."""
        lacking = np.array([_taylor_defect(*pair, self._unseen) for pair in pairwise(moments)]) * self._weights
        sizes = np.linalg.norm(lacking, axis=1)
        worst = int(np.argmax(sizes))
        return float(sizes[worst]) / self._size if self._size > 0.0 else 0.0, int(np.argmax(np.abs(lacking[worst])))


def _taylor_defect(old: StepState, new: StepState, unseen: float) -> FloatArray:
    h = new.time - old.time  # zero across an impact
    lacking = new.d - old.d - h * old.v - h**2 * (old.a / 3.0 + new.a / 6.0)
    return np.maximum(np.abs(lacking), unseen * h**2 * np.abs(new.a - old.a)) if unseen else lacking


class StepController:
    """Step size control on top of an `EventStepper`, whose largest step, s, is halved as the error requires."""

    def __init__(self, walker: EventStepper, at: At, step: float, adaptive: Adaptive, norm: EnergyNorm) -> None:
        self._walker, self._at, self._step, self._norm = walker, at, step, norm
        self._tolerance = adaptive.tolerance
        smallest = adaptive.smallest or step / 2.0**_MOST_HALVINGS
        self._most = min(max(math.floor(math.log2(step / smallest)), 0), _MOST_HALVINGS)
        self.halvings = 0  #: of the given step
        self.rejected = 0  #: steps repeated with half their length

    def walk(self, now: StepState, to: StepInputs) -> list[StepState]:
        """Return the instants after `now` up to `to`, one full step later."""
        begin, whole, done = now.time, 2**self._most, 0
        walked: list[StepState] = []
        while done < whole:
            length = whole >> self.halvings
            last = done + length == whole
            there = to if last else self._at(begin + (done + length) / whole * self._step)
            part, share = self._try_step(now, there)
            if not part:
                self.halvings += 1
                continue
            walked += part
            now, done = part[-1], done + length
            if share < _DOUBLING_LIMIT and self.halvings and done % (2 * length) == 0:
                self.halvings -= 1
        return walked

    def _try_step(self, now: StepState, there: StepInputs) -> tuple[list[StepState], float]:
        """Return a step and its error relative to the tolerance; no step if the error is too large."""
        events = self._walker.events
        part = self._walker.walk(now, there)
        error, unknown = self._norm.error([now, *part])
        share = error / self._tolerance
        if share <= 1.0:
            return part, share
        if self.halvings == self._most:
            raise StepFloorError(unknown, share, self._step / 2.0**self._most)
        self._walker.events = events
        self.rejected += 1
        return [], share
