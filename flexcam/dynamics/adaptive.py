"""Steps as long as the error allows: the given one, halved as often as needed.

The error of a step is what the method's displacement lacks of the Taylor series with a straight acceleration,
``d0 + h v0 + h^2 (a0/3 + a1/6)``: O. C. Zienkiewicz and Y. M. Xie, Earthq. Eng. Struct. Dyn. 20 (1991). Halving keeps
the instants of the results where they are, and as few operators as there are lengths.
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
_DOUBLED = 1.0 / 16.0
"""Share of the tolerance below which the step is doubled: its error grows by 8, and half of it is kept in hand."""


class StepFloorError(ArithmeticError):
    """The error is too large at the smallest step.

    Parameters
    ----------
    unknown
        Where it is largest.
    times
        Error over tolerance.
    step
        The smallest step, s.
    """

    def __init__(self, unknown: int, times: float, step: float) -> None:
        super().__init__(f"unknown {unknown}: {times:.3g} times the tolerance at {step:.3g} s")
        self.unknown, self.times, self.step = unknown, times, step


class Norm:
    """Size of displacements as energies, against the largest of a motion.

    The stiffness weighs them, and so does the mass at the motion's own frequency, for what no stiffness holds; the
    diagonals do, so that no unit of an unknown matters.

    Parameters
    ----------
    system
        The system.
    motion
        A motion of the kind that is to be computed: displacements and velocities, shape (m, n).
    unseen
        Part of an error that displacements do not show, see `Method`.
    """

    def __init__(self, system: System, motion: Series, unseen: float = 0.0) -> None:
        self._unseen = unseen
        stiff, mass = (np.abs(matrix.diagonal()) for matrix in (system.stiffness, system.mass))
        moved = motion.displacement - motion.displacement[:1]
        heavy, fast = (float((series**2 @ mass).max(initial=0.0)) for series in (moved, motion.velocity))
        self._weights = np.sqrt(stiff + mass * (fast / heavy if heavy > 0.0 else 0.0))
        self._size = float(np.linalg.norm(moved * self._weights, axis=1).max(initial=0.0))

    def error(self, moments: Sequence[StepState]) -> tuple[float, int]:
        """Return the largest error of some successive steps, as a part of the motion, and the unknown that leads."""
        lacking = np.array([_lacking(*pair, self._unseen) for pair in pairwise(moments)]) * self._weights
        sizes = np.linalg.norm(lacking, axis=1)
        worst = int(np.argmax(sizes))
        return float(sizes[worst]) / self._size if self._size > 0.0 else 0.0, int(np.argmax(np.abs(lacking[worst])))


def _lacking(old: StepState, new: StepState, unseen: float) -> FloatArray:
    h = new.time - old.time  # zero over an impact
    lacking = new.d - old.d - h * old.v - h**2 * (old.a / 3.0 + new.a / 6.0)
    return np.maximum(np.abs(lacking), unseen * h**2 * np.abs(new.a - old.a)) if unseen else lacking


class StepController:
    """Walks as a `EventStepper` does, by steps whose error is below a tolerance.

    Parameters
    ----------
    walker
        Takes the steps.
    at
        What is prescribed at a time, s.
    step
        The longest one, s.
    adaptive
        Tolerance and smallest step.
    norm
        Measures errors.

    Attributes
    ----------
    halvings
        How often the given step is halved now.
    rejected
        Steps taken again with half their length.
    """

    def __init__(self, walker: EventStepper, at: At, step: float, adaptive: Adaptive, norm: Norm) -> None:
        self._walker, self._at, self._step, self._norm = walker, at, step, norm
        self._tolerance = adaptive.tolerance
        smallest = adaptive.smallest or step / 2.0**_MOST_HALVINGS
        self._most = min(max(math.floor(math.log2(step / smallest)), 0), _MOST_HALVINGS)
        self.halvings = 0
        self.rejected = 0

    def walk(self, now: StepState, to: StepInputs) -> list[StepState]:
        """Return the instants behind `now` up to `to`, a whole step later."""
        begin, whole, done = now.time, 2**self._most, 0
        walked: list[StepState] = []
        while done < whole:
            length = whole >> self.halvings
            last = done + length == whole
            there = to if last else self._at(begin + (done + length) / whole * self._step)
            part, share = self._tried(now, there)
            if not part:
                self.halvings += 1
                continue
            walked += part
            now, done = part[-1], done + length
            if share < _DOUBLED and self.halvings and done % (2 * length) == 0:
                self.halvings -= 1
        return walked

    def _tried(self, now: StepState, there: StepInputs) -> tuple[list[StepState], float]:
        """Return a step and its error over the tolerance; no step if that is too large."""
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
