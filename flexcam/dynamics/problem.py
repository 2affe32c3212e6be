"""What `solve` is asked: a system, how the cam turns, the step, the start, and what to save."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, get_args

import numpy as np

from flexcam.core import FloatArray, IntArray
from flexcam.core.errors import finite_array, positive, refuse
from flexcam.dynamics.basis import Basis
from flexcam.dynamics.cam_motion import Drive
from flexcam.dynamics.system import System


@dataclass(frozen=True, eq=False)
class State:
    """Displacements and velocities at an instant.

    Parameters
    ----------
    displacement, velocity
        Shape (n,), SI; copied and read-only.
    time
        s.
    inner
        Internal states of the local forces, one after the other, shape (s,); None for those at rest.
    periodicity
        Of a state that should return after a revolution: by how much it misses, as a part of the motion; else None.
    acceleration
        Shape (n,), where a run goes on: of some schemes it is no function of the rest. None to balance the forces.
    taken
        Steps of the problem's length that led here: instants are counted from before them.
    """

    displacement: FloatArray
    velocity: FloatArray
    time: float = 0.0
    inner: FloatArray | None = None
    periodicity: float | None = None
    acceleration: FloatArray | None = None
    taken: int = 0

    def __post_init__(self) -> None:
        object.__setattr__(self, "displacement", finite_array("start displacement", self.displacement, (None,)))
        object.__setattr__(self, "velocity", finite_array("start velocity", self.velocity, (None,)))
        if self.acceleration is not None:
            given = finite_array("start acceleration", self.acceleration, self.displacement.shape)
            object.__setattr__(self, "acceleration", given)

    @classmethod
    def rest(cls, size: int) -> State:
        """Return zero displacement and velocity at time zero."""
        return cls(np.zeros(size), np.zeros(size))


@dataclass(frozen=True)
class Adaptive:
    """Steps as long as their error allows, up to the one given.

    Parameters
    ----------
    tolerance
        Largest error of a step, as a part of the motion, in the energy norm.
    smallest
        s; None for 2^-16 of the step given.
    """

    tolerance: float = 1e-6
    smallest: float | None = None

    def __post_init__(self) -> None:
        positive("adaptive.tolerance", self.tolerance, "")
        if self.smallest is not None:
            positive("adaptive.smallest", self.smallest, "s")


Engine = Literal["auto", "direct", "modal", "kernel"]
"""Solver engines, see `flexcam.dynamics.engine_selection`."""

ENGINES: tuple[Engine, ...] = get_args(Engine)


@dataclass(frozen=True, eq=False)
class Problem:
    """A transient to be solved.

    Parameters
    ----------
    system
        The equations.
    drive
        How the cam turns.
    step
        Between the instants of the results, s.
    steps
        Number of steps.
    start
        None for rest.
    adaptive
        How the steps are divided further; None to take them as they are.
    basis
        Other unknowns to integrate in; None for the system's own. The start and all results are in the system's own.
    prune
        Whether unknowns that nothing can move from the start are left out of the integration: it changes no result.
    engine
        The solver engine; ``auto`` takes the fastest that fits.
    runs
        How many runs like this one are to come: together they are worth what one is not.

    Raises
    ------
    InputError
        If the step is not positive, there is no step, or the start has another size than the system.

    Examples
    --------
    >>> from flexcam.core import Triplets
    >>> from flexcam.dynamics import ConstantSpeed
    >>> one = Triplets.from_dense([[1.0]])
    >>> Problem(System(one, Triplets.zeros(1), one, ("x",)), ConstantSpeed(1.0), step=0.1, steps=10).steps
    10
    """

    system: System
    drive: Drive
    step: float
    steps: int
    start: State | None = None
    adaptive: Adaptive | None = None
    basis: Basis | None = None
    prune: bool = False
    engine: Engine = "auto"
    runs: int = 1

    def times(self, steps: IntArray) -> FloatArray:
        """Return the times after so many steps; a run that goes on counts from where the first one began.

        Parameters
        ----------
        steps
            Numbers of steps, shape (b,).

        Returns
        -------
        ndarray
            s, shape (b,).
        """
        begin, taken = (self.start.time, self.start.taken) if self.start else (0.0, 0)
        return np.asarray((begin - taken * self.step) + (taken + steps) * self.step, dtype=float)

    def __post_init__(self) -> None:
        positive("step", self.step, "s")
        smallest = None if self.adaptive is None else self.adaptive.smallest
        if smallest is not None and smallest > self.step:
            raise refuse("run.adaptive.smallest", f"{smallest:.4g} s", f"up to the step, {self.step:.4g} s")
        if self.engine not in ENGINES:
            raise refuse("run.engine", repr(self.engine), ", ".join(ENGINES))
        if self.steps < 1:
            raise refuse("steps", self.steps, "a whole number from 1")
        for name in ("displacement", "velocity"):
            if self.start is not None and (given := getattr(self.start, name).size) != self.system.size:
                raise refuse(f"start {name}", f"{given} unknowns", f"the {self.system.size} unknowns of the system")
