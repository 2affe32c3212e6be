"""Periodic motions: the map of a period and its derivative, the periodic state, and Floquet multipliers.

The state after one period is a function of the state before it. Its derivative is the product of those of the steps
(`disturbances`); the eigenvalues of the derivative are the Floquet multipliers. The periodic state is the fixed point,
without a long transient. A linear train finds it in one revolution by Newton's method: A. H. Nayfeh and B.
Balachandran, Applied Nonlinear Dynamics (1995), sec. 5.2. With local forces the derivative takes as long as some
fifteen revolutions and holds only nearby, because contacts open and close. These systems and large ones use Anderson's
method, which needs as many revolutions as there are motions that have not decayed: J. ACM 12 (1965); H. F. Walker and
P. Ni, SIAM J. Numer. Anal. 49 (2011).
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from flexcam.core import ComplexArray, FloatArray, SingularMatrixError
from flexcam.core.errors import refuse
from flexcam.dynamics.basis import Basis
from flexcam.dynamics.blocks import SaveAt
from flexcam.dynamics.disturbances import Disturbances
from flexcam.dynamics.engine import iterate_tracks
from flexcam.dynamics.engine_selection import SelectedEngine, create_engine, forces_of, select_engine
from flexcam.dynamics.generalized_alpha import newmark
from flexcam.dynamics.integrator import Method
from flexcam.dynamics.local_forces import LocalForces
from flexcam.dynamics.problem import Problem, State
from flexcam.dynamics.solve import limit_blas_threads, pilot, singular_status
from flexcam.dynamics.status import Cause, RunFailedError, Stats, Status

MAX_UNKNOWNS = 400
"""Maximum number of unknowns for a derivative of the map."""

_FIELDS = 64
"""Instants of a revolution at which the size of the motion is measured."""


@dataclass(frozen=True, eq=False)
class PeriodMap:
    """Map of one period; states are displacements, velocities and internal states in a row."""

    end: FloatArray  #: state at the end, shape (2n + s,)
    fields: FloatArray  #: displacements and velocities at some ends of steps, shape (m, 2n)
    #: Of the end by the initial state, shape (2n + s, 2n + s); empty if not requested.
    derivative: FloatArray = field(default_factory=lambda: np.zeros((0, 0)))
    events: int = 0  #: number of contacts that opened or closed


def period_map(
    selected: SelectedEngine, method: Method, stop: Callable[[], bool], *, derived: bool = True
) -> PeriodMap:
    """Return a period of a problem in the unknowns of its engine; a failed run raises `RunFailedError`."""
    problem, fields, end, step = selected.problem, list[FloatArray](), np.zeros(0), 0
    every = max(problem.steps // _FIELDS, 1)
    try:
        forces = forces_of(selected, method)
        engine = create_engine(selected, method, forces, SaveAt(field_every=problem.steps + 1), stop, pilot)
        disturbances = Disturbances(problem, forces) if derived else None
        with limit_blas_threads(selected):
            for track in iterate_tracks(engine, problem.steps, problem.system.size):
                if disturbances is not None:
                    disturbances.follow(track)
                saved = track.ends[-step % every :: every]
                fields.append(np.hstack([track.d[saved], track.v[saved]]))
                end, step = np.concatenate([track.d[-1], track.v[-1], track.state[-1]]), step + len(track.ends)
    except SingularMatrixError as fault:
        raise RunFailedError(singular_status(fault, problem.system)) from None
    derivative = np.zeros((0, 0)) if disturbances is None else disturbances.monodromy()
    return PeriodMap(end, np.concatenate(fields), derivative, engine.statistics(Stats()).events)


@dataclass(frozen=True, eq=False)
class Floquet:
    """Floquet multipliers of a periodic motion."""

    #: Largest first, complex, shape (2m + s,): of m unknowns integrated and s internal states of local forces.
    multipliers: ComplexArray
    shapes: ComplexArray  #: displacements of all unknowns at the beginning of the period, complex, shape (n, 2m + s)
    period: float  #: s
    names: tuple[str, ...]  #: of the unknowns
    #: Number of contact openings and closings within the period. Large multipliers may then indicate chatter: small
    #: differences of the times of bounces grow.
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


def floquet(problem: Problem) -> Floquet:
    """Return the Floquet multipliers of a motion over one period, with the average acceleration.

    Parameters
    ----------
    problem
        One period, from its periodic state.

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
    method = newmark()
    unpruned = replace(problem, prune=False)  # what the motion leaves at rest may still be unstable
    selected = select_engine(unpruned, method)
    n = selected.problem.system.size
    if not 0 < n <= MAX_UNKNOWNS:
        raise refuse("system", f"{n} unknowns", f"1 to {MAX_UNKNOWNS}", "it advances a basis of disturbances")
    revolution = period_map(selected, method, lambda: False)
    values, vectors = np.linalg.eig(revolution.derivative)
    order = np.argsort(-np.abs(values))
    shapes = np.asarray(vectors[:n, order], dtype=complex).T
    for basis in selected.bases:
        real, imaginary = (np.asarray(part(shapes), dtype=float) for part in (np.real, np.imag))
        shapes = basis.expand(real) + 1j * basis.expand(imaginary)
    values = np.asarray(values[order], dtype=complex)
    return Floquet(values, shapes.T, problem.step * problem.steps, problem.system.names, revolution.events)


_NOTHING = 1e-6
"""Fraction of the motion of the first guess below which the periodic state is rest."""

_TIME_LIMIT_STATUS = Status(
    Cause.TIME_LIMIT, "the time limit was reached during the search for the periodic start", "allow more time"
)
"""Status of a run that never began."""

_MEMORY, _DEPENDENT = 40, 1e-8
"""Previous states in Anderson's method, and relative distance below which differences of them are dependent."""

_MAX_REVOLUTIONS = 100
_USUAL_REVOLUTIONS = 10
"""Expected revolutions of a search, for the selection of the engine."""

_MAX_STALLED = 8
"""Revolutions without halving the residual after which the search ends with contacts: their motion may be chaotic. A
system without them may need as many revolutions as it has unknowns."""

FREE = 1e-10
"""Relative change per revolution below which a motion is excluded from the search."""


def solve_periodic(problem: Problem, scheme: Method, *, tolerance: float = 1e-9, until: float | None = None) -> State:
    """Return the periodic state of one revolution.

    Parameters
    ----------
    problem
        One revolution, from a first guess.
    scheme
        Integration method.
    tolerance
        Relative residual of periodicity, in the norm of `_energy_norm`.
    until
        Latest end of the search, s of `time.monotonic`; None for no limit.

    Returns
    -------
    State
        State with the smallest residual, given as `periodicity`.

    Raises
    ------
    RunFailedError
        If the time limit was reached.
    """
    search_problem = replace(problem, runs=problem.runs * _USUAL_REVOLUTIONS)
    selected = select_engine(search_problem, scheme)
    linear = not problem.system.local_forces and 0 < selected.problem.system.size <= MAX_UNKNOWNS
    revolutions, norm = _Revolutions(selected, scheme, until), _energy_norm(problem, selected.bases)
    search = _Newton(revolutions.weights) if linear else _Anderson(revolutions.weights, revolutions.patience)
    state = _fixed_point(revolutions, search, norm, tolerance)
    for basis in selected.bases:
        displacement = basis.expand(state.displacement) + basis.offset
        state = replace(state, displacement=displacement, velocity=basis.expand(state.velocity))
    return replace(state, time=problem.initial_state.time)


Norm = Callable[[FloatArray], FloatArray]


def _energy_norm(problem: Problem, bases: Sequence[Basis]) -> Norm:
    """Return the norm of motions in the unknowns of a problem, the same on every engine: square roots of energies.

    It takes changes of displacements and velocities in a row, shape (..., 2n) to (...). The bases lead from the
    unknowns of the motions to those of the problem, innermost first.
    """
    weights = _weights(problem)

    def norm(motions: FloatArray) -> FloatArray:
        parts = np.split(motions, 2, axis=-1)
        for basis in bases:
            parts = [basis.expand(part) for part in parts]
        return np.linalg.norm(weights * np.concatenate(parts, axis=-1), axis=-1)

    return norm


class _Revolutions:
    def __init__(self, selected: SelectedEngine, scheme: Method, until: float | None) -> None:
        self.problem, self._selected, self._scheme, self._until = selected.problem, selected, scheme, until
        weights = _weights(self.problem)
        forces = LocalForces(self.problem.system)
        inner = np.full(len(forces.start_state), weights.max(initial=0.0))
        self.weights: FloatArray = np.concatenate([weights, inner])  #: of the entries of a state, shape (2n + s,)
        #: Revolutions without halving the residual after which a search is in vain.
        self.patience = _MAX_STALLED if len(forces.touching) else max(_MAX_STALLED, len(self.weights))

    def turn(self, x: FloatArray, *, derived: bool) -> PeriodMap | None:
        """Return a revolution from a state; None if the run fails."""
        selected = replace(self._selected, problem=replace(self.problem, start=_unpack(self.problem, x)))
        try:
            return period_map(selected, self._scheme, self._late, derived=derived)
        except RunFailedError:
            if self._late():
                raise RunFailedError(_TIME_LIMIT_STATUS) from None
            return None

    def _late(self) -> bool:
        return self._until is not None and time.monotonic() >= self._until


def _fixed_point(revolutions: _Revolutions, search: _Newton | _Anderson, norm: Norm, tolerance: float) -> State:
    """Return the state with the smallest residual, in the unknowns of the engine."""
    problem = revolutions.problem
    motion = slice(2 * problem.system.size)
    x: FloatArray | None = problem.initial_state.stack(LocalForces(problem.system).start_state)
    best, smallest, reference, stalled, first = x, np.inf, np.inf, 0, 0.0
    for _ in range(_MAX_REVOLUTIONS):
        revolution, error = revolutions.turn(x, derived=search.derives), np.inf
        if revolution is not None:
            largest = float(norm(revolution.fields - x[motion]).max(initial=0.0))
            first = first or largest
            size = max(largest, _NOTHING * first)
            error = float(norm((revolution.end - x)[motion])) / size if size > 0.0 else 0.0
        if error < smallest:
            smallest, best = error, x
        reference, stalled = (error, 0) if error < 0.5 * reference else (reference, stalled + 1)
        x = search.next(x, revolution) if revolution and error > tolerance and stalled <= search.patience else None
        if x is None:
            break
    return replace(_unpack(problem, best), periodicity=float(smallest))


class _Newton:
    """Newton's method, ``(I - Phi) dx = P(x) - x``, with the derivative of the first revolution."""

    patience = 1

    def __init__(self, weights: FloatArray) -> None:
        self._weights = np.where(weights > 0.0, weights, 1.0)
        self._change: FloatArray | None = None

    @property
    def derives(self) -> bool:
        """True if the next revolution needs its derivative."""
        return self._change is None

    def next(self, x: FloatArray, revolution: PeriodMap) -> FloatArray | None:
        """Return the next state after a revolution; None to stop."""
        w = self._weights
        if self._change is None:
            self._change = np.eye(len(w)) - w[:, None] * revolution.derivative / w
        if not np.isfinite(self._change).all():
            return None
        # Motions with any periodic amplitude are unchanged.
        return x + np.linalg.lstsq(self._change, w * (revolution.end - x), rcond=FREE)[0] / w


class _Anderson:
    """Anderson's method: combination of previous states of minimum residual, plus that residual."""

    derives = False

    def __init__(self, weights: FloatArray, patience: int) -> None:
        self._weights, self.patience = weights, patience
        self._points: list[FloatArray] = []
        self._residuals: list[FloatArray] = []

    def next(self, x: FloatArray, revolution: PeriodMap) -> FloatArray:
        """Return the next state after a revolution."""
        points = self._points = [*self._points, x][-_MEMORY:]
        residuals = self._residuals = [*self._residuals, revolution.end - x][-_MEMORY:]
        if len(points) == 1:
            return points[0] + residuals[0]
        dx, df = np.diff(points, axis=0), np.diff(residuals, axis=0)
        weighted = (df * self._weights).T
        sizes = np.linalg.norm(weighted, axis=0)
        sizes[sizes == 0.0] = 1.0
        weights = np.asarray(
            np.linalg.lstsq(weighted / sizes, residuals[-1] * self._weights, rcond=_DEPENDENT)[0] / sizes, dtype=float
        )
        return points[-1] + residuals[-1] - weights @ (dx + df)


def _unpack(problem: Problem, x: FloatArray) -> State:
    n = problem.system.size
    return State(x[:n], x[n : 2 * n], problem.initial_state.time, x[2 * n :] if len(x) > 2 * n else None)


def _weights(problem: Problem) -> FloatArray:
    """Return weights that convert displacements and velocities to square roots of energies, shape (2n,)."""
    stiff, mass = (np.sqrt(np.abs(matrix.diagonal())) for matrix in (problem.system.stiffness, problem.system.mass))
    return np.concatenate([stiff, mass])
