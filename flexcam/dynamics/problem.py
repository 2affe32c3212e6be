"""Definition of a transient problem: system, cam motion, step, initial state and settings."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
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
        Relative residual of a periodic state; else None.
    acceleration
        Shape (n,), of a resumed run, where some schemes do not derive it from the rest. None for equilibrium.
    """

    displacement: FloatArray
    velocity: FloatArray
    time: float = 0.0
    inner: FloatArray | None = None
    periodicity: float | None = None
    acceleration: FloatArray | None = None

    def __post_init__(self) -> None:
        object.__setattr__(self, "displacement", finite_array("start displacement", self.displacement, (None,)))
        object.__setattr__(self, "velocity", finite_array("start velocity", self.velocity, (None,)))
        if self.acceleration is not None:
            acceleration = finite_array("start acceleration", self.acceleration, self.displacement.shape)
            object.__setattr__(self, "acceleration", acceleration)

    @classmethod
    def rest(cls, size: int) -> State:
        """Return zero displacement and velocity at time zero."""
        return cls(np.zeros(size), np.zeros(size))

    def stack(self, inner: FloatArray) -> FloatArray:
        """Return displacements, velocities and internal states, `inner` by default, in a row."""
        return np.concatenate([self.displacement, self.velocity, inner if self.inner is None else self.inner])


@dataclass(frozen=True)
class Adaptive:
    """Adaptive steps up to the given step.

    Parameters
    ----------
    tolerance
        Largest relative error of a step, in the energy norm.
    smallest
        s; None for 2^-16 of the step given.
    """

    tolerance: float = 1e-6
    smallest: float | None = None

    def __post_init__(self) -> None:
        positive("adaptive.tolerance", self.tolerance, "")
        if self.smallest is not None:
            positive("adaptive.smallest", self.smallest, "s")


EngineName = Literal["auto", "direct", "modal", "kernel"]
"""Solver engines, see `flexcam.dynamics.engine_selection`."""

ENGINES: tuple[EngineName, ...] = get_args(EngineName)


@dataclass(frozen=True, eq=False)
class Problem:
    """Transient problem.

    Parameters
    ----------
    system
        The equations.
    drive
        Motion of the camshaft.
    step
        Step between the output instants, s.
    steps
        Number of steps.
    start
        None for rest.
    adaptive
        Adaptive steps; None for constant steps.
    basis
        Basis for the integration; None for the system's unknowns. Initial state and results are in the system's
        unknowns.
    prune
        Whether inactive unknowns are excluded from the integration; it does not change results.
    engine
        Solver engine; ``auto`` selects the fastest suitable one.
    runs
        Number of similar runs to come, over which preparation costs are distributed.

    Raises
    ------
    InputError
        If the step or the number of steps is not positive, or the initial state has a wrong size.

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
    engine: EngineName = "auto"
    runs: int = 1

    @cached_property
    def initial_state(self) -> State:
        """Initial state; rest if none is given."""
        return self.start or State.rest(self.system.size)

    def times(self, steps: IntArray) -> FloatArray:
        """Return the times of steps.

        Parameters
        ----------
        steps
            Numbers of steps, shape (b,).

        Returns
        -------
        ndarray
            s, shape (b,).
        """
        return np.asarray(self.initial_state.time + steps * self.step, dtype=float)

    def __post_init__(self) -> None:
        positive("step", self.step, "s")
        smallest = None if self.adaptive is None else self.adaptive.smallest
        if smallest is not None and smallest > self.step:
            raise refuse("run.adaptive.smallest", f"{smallest:.4g} s", f"up to the step, {self.step:.4g} s")
        if self.engine not in ENGINES:
            raise refuse("run.engine", repr(self.engine), ", ".join(ENGINES))
        if not hasattr(self.steps, "__index__") or self.steps < 1:
            raise refuse("steps", self.steps, "a whole number, at least 1")
        for name in ("displacement", "velocity"):
            if self.start is not None and (size := getattr(self.start, name).size) != self.system.size:
                raise refuse(f"start {name}", f"{size} unknowns", f"the {self.system.size} unknowns of the system")
