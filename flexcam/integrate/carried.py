"""The way through time of what has no unknowns: all that moves is carried by the cam, and no step is to be taken."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from flexcam.checkpoint import Arrays
from flexcam.integrate.engine import STOPPED
from flexcam.integrate.local import LocalForces
from flexcam.integrate.moment import Track
from flexcam.integrate.problem import Problem
from flexcam.linalg import IntArray
from flexcam.response import Stats, Status


class Carried:
    """Goes through the instants of a problem without unknowns and local forces.

    Parameters
    ----------
    problem
        The problem.
    forces
        Its local forces: none.
    stop
        Asked before every block of steps.
    """

    def __init__(self, problem: Problem, forces: LocalForces, stop: Callable[[], bool]) -> None:
        self._problem, self._forces, self._stop = problem, forces, stop

    def advance(self, steps: IntArray) -> tuple[Track, Status]:
        """Return the instants of some successive steps, as `Engine` says."""
        if self._stop():
            return Track.none(0, self._forces), STOPPED
        nothing = np.zeros((len(steps), 0))
        at, each = self._problem.times(steps), np.arange(len(steps))
        return Track(at, nothing, nothing, nothing, nothing, nothing, nothing, each), Status()

    def counted(self, stats: Stats) -> Stats:
        """Return the figures as they are: no step is taken."""
        return stats

    def state(self) -> Arrays:
        """Return nothing: every instant follows from the problem alone."""
        return {}

    def restore(self, state: Arrays) -> None:
        """Go on, as `Engine` says."""
