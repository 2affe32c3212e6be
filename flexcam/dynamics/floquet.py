"""Floquet multipliers: map of a period and its derivative, the product of those of its steps (`disturbances`)."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from flexcam.core import ComplexArray, FloatArray, SingularMatrixError
from flexcam.core.errors import refuse
from flexcam.dynamics.blocks import SaveAt
from flexcam.dynamics.disturbances import Disturbances
from flexcam.dynamics.engine import iterate_tracks
from flexcam.dynamics.engine_selection import SelectedEngine, create_engine, forces_of, select_engine
from flexcam.dynamics.generalized_alpha import newmark
from flexcam.dynamics.integrator import Method
from flexcam.dynamics.problem import Problem
from flexcam.dynamics.solve import pilot, singular_status
from flexcam.dynamics.status import RunFailedError, Stats

MAX_UNKNOWNS = 400
"""Maximum number of unknowns."""


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
    for track in iterate_tracks(engine, problem.steps):
        if disturbances is not None:
            disturbances.follow(track)
        fields.append(np.hstack([track.d, track.v])[track.ends])
        end = np.concatenate([track.d[-1], track.v[-1], track.state[-1]])
    derivative = np.zeros((0, 0)) if disturbances is None else disturbances.monodromy()
    return PeriodMap(end, derivative, np.concatenate(fields), engine.statistics(Stats()).events)


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
        raise refuse("system", f"{n} unknowns", f"1 to {MAX_UNKNOWNS}", "it advances a basis of disturbances")
    found = period_map(selected, chosen, lambda: False)
    values, vectors = np.linalg.eig(found.derivative)
    order = np.argsort(-np.abs(values))
    shapes = np.asarray(vectors[:n, order], dtype=complex).T
    for basis in selected.bases:
        real, imaginary = (np.asarray(part(shapes), dtype=float) for part in (np.real, np.imag))
        shapes = basis.spread(real) + 1j * basis.spread(imaginary)
    values = np.asarray(values[order], dtype=complex)
    return Floquet(values, shapes.T, problem.step * problem.steps, problem.system.names, found.events)
