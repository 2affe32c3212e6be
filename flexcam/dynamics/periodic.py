"""Periodic motions: the map of a period and its derivative, the periodic state, and Floquet multipliers.

The state after one period is a function of the state before it. Its derivative is the product of those of the steps
(`disturbances`); the eigenvalues of the derivative are the Floquet multipliers. The periodic state is the fixed point,
without a long transient, by Newton's method: one revolution for a linear train, few for one with contacts. A. H. Nayfeh
and B. Balachandran, Applied Nonlinear Dynamics (1995), sec. 5.2. Larger systems use Anderson's method, which needs as
many revolutions as there are motions that have not decayed: J. ACM 12 (1965); H. F. Walker and P. Ni, SIAM J. Numer.
Anal. 49 (2011).
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
from flexcam.dynamics.solve import pilot, singular_status, solve
from flexcam.dynamics.status import Cause, RunFailedError, Stats, Status

MAX_UNKNOWNS = 400
"""Maximum number of unknowns."""


@dataclass(frozen=True, eq=False)
class PeriodMap:
    """Map of one period; states are displacements, velocities and internal states in a row."""

    end: FloatArray  #: state at the end, shape (2n + s,)
    fields: FloatArray  #: displacements and velocities at the ends of steps, shape (m, 2n)
    #: Of the end by the initial state, shape (2n + s, 2n + s); empty if not requested.
    derivative: FloatArray = field(default_factory=lambda: np.zeros((0, 0)))
    events: int = 0  #: number of contacts that opened or closed


def period_map(
    selected: SelectedEngine, method: Method, stop: Callable[[], bool], *, derived: bool = True
) -> PeriodMap:
    """Return a period of a problem in the unknowns of its engine; a failed run raises `RunFailedError`."""
    problem, fields, end = selected.problem, list[FloatArray](), np.zeros(0)
    try:
        forces = forces_of(selected, method)
        engine = create_engine(selected, method, forces, SaveAt(field_every=problem.steps + 1), stop, pilot)
        disturbances = Disturbances(problem, forces) if derived else None
        within = np.setdiff1d(forces.touching, forces.switching)  # contacts that open and close within steps
        closed = [np.zeros((0, len(within)), dtype=bool)]
        for track in iterate_tracks(engine, problem.steps):
            if disturbances is not None:
                disturbances.follow(track)
            fields.append(np.hstack([track.d, track.v])[track.ends])
            closed.append(track.local[:, within] > 0.0)
            end = np.concatenate([track.d[-1], track.v[-1], track.state[-1]])
    except SingularMatrixError as fault:
        raise RunFailedError(singular_status(fault, problem.system)) from None
    derivative = np.zeros((0, 0)) if disturbances is None else disturbances.monodromy()
    changes = int(np.count_nonzero(np.diff(np.concatenate(closed), axis=0)))
    return PeriodMap(end, np.concatenate(fields), derivative, engine.statistics(Stats()).events + changes)


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


_NOTHING = 1e-6
"""Fraction of the motion of the first guess below which the periodic state is rest."""

_TIME_LIMIT_STATUS = Status(
    Cause.TIME_LIMIT, "the time limit was reached during the search for the periodic start", "allow more time"
)
"""Status of a run that never began."""

_MEMORY = 40
_MOST_REVOLUTIONS = 100
_USUAL_REVOLUTIONS = 10
"""Expected revolutions of a search, for the selection of the engine."""

_MAX_STALLED, _PATIENCE_OF_NEWTON = 12, 8
"""Revolutions without halving the residual after which the search ends: contacts that open and close limit it."""

_MAX_FAILURES = 3
"""Newton steps without reduction of the residual after which the search ends: the motion is chaotic."""

_GOOD = 0.1
"""Reduction of the residual by a Newton step with which its derivative is reused."""

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
    start = problem.start or State.rest(problem.system.size)
    several = replace(problem, runs=problem.runs * _USUAL_REVOLUTIONS)
    selected = select_engine(several, scheme, SaveAt(field_every=problem.steps + 1))
    if not 0 < selected.problem.system.size <= MAX_UNKNOWNS:
        found = _fixed_point(problem, _Anderson(several, scheme, until), _energy_norm(problem, ()), tolerance)
        return replace(found, time=start.time)
    search, norm = _Newton(selected, scheme, until), _energy_norm(problem, selected.bases)
    found = _fixed_point(selected.problem, search, norm, tolerance)
    for basis in selected.bases:
        moved = basis.spread(found.displacement) + basis.held
        found = replace(found, displacement=moved, velocity=basis.spread(found.velocity))
    return replace(found, time=start.time)


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
            parts = [basis.spread(part) for part in parts]
        return np.linalg.norm(weights * np.concatenate(parts, axis=-1), axis=-1)

    return norm


def _fixed_point(problem: Problem, search: _Newton | _Anderson, norm: Norm, tolerance: float) -> State:
    """Return the state with the smallest residual, in the unknowns of the problem."""
    motion = slice(2 * problem.system.size)
    x: FloatArray | None = _pack(problem, problem.start or State.rest(problem.system.size))
    best, least, level, since, first = x, np.inf, np.inf, 0, 0.0
    for _ in range(_MOST_REVOLUTIONS):
        turn, error = search.turn(x), np.inf
        if turn is not None:
            largest = float(norm(turn.fields - x[motion]).max(initial=0.0))
            first = first or largest
            size = max(largest, _NOTHING * first)
            error = float(norm((turn.end - x)[motion])) / size if size > 0.0 else 0.0
        if error < least:
            least, best = error, x
        level, since = (error, 0) if error < 0.5 * level else (level, since + 1)
        x = search.next(x, turn, error) if error > tolerance and since <= search.patience else None
        if x is None:
            break
    return replace(_unpack(problem, best), periodicity=float(least))


class _Newton:
    """Newton's method, ``(I - Phi) dx = P(x) - x``, with a plain revolution if a step increases the residual.

    Phi is reused while it reduces the residual. With decaying motions the plain revolution always reduces the residual;
    half a step does so less reliably if contacts open and close.
    """

    def __init__(self, selected: SelectedEngine, scheme: Method, until: float | None) -> None:
        problem = selected.problem
        self._selected, self._scheme, self._until = selected, scheme, until
        weights = _weights(problem)
        inner = np.full(len(LocalForces(problem.system).start_state), weights.max())
        self._weights = np.concatenate([np.where(weights > 0.0, weights, 1.0), inner])
        self._derivative: FloatArray | None = None
        self._end: FloatArray | None = None
        self._least, self._failures, self.patience = np.inf, 0, _PATIENCE_OF_NEWTON

    def turn(self, x: FloatArray) -> PeriodMap | None:
        """Return a revolution from a state; None if the run fails."""
        problem = self._selected.problem
        one = replace(self._selected, problem=replace(problem, start=_unpack(problem, x)))
        try:
            found = period_map(one, self._scheme, self._late, derived=self._derivative is None)
        except RunFailedError:
            if self._late():
                raise RunFailedError(_TIME_LIMIT_STATUS) from None
            return None
        self._derivative = found.derivative if found.derivative.size else self._derivative
        return found

    def next(self, x: FloatArray, turn: PeriodMap | None, error: float) -> FloatArray | None:
        """Return the next state after one with an error; None to stop."""
        if turn is None or error >= self._least or self._derivative is None:
            end, self._end, self._derivative, self._least = self._end, None, None, np.inf
            self._failures += 1
            return end if self._failures <= _MAX_FAILURES else None
        step, w = turn.end - x, self._weights
        change = np.eye(len(w)) - w[:, None] * self._derivative / w
        if np.isfinite(change).all():  # motions with any periodic amplitude are unchanged
            step = np.asarray(np.linalg.lstsq(change, w * step, rcond=FREE)[0] / w, dtype=float)
        if error > _GOOD * self._least:
            self._derivative = None
        self._end, self._least = turn.end, error
        return x + step

    def _late(self) -> bool:
        return self._until is not None and time.monotonic() >= self._until


class _Anderson:
    """Anderson's method: combination of previous states of minimum residual, plus that residual."""

    def __init__(self, problem: Problem, scheme: Method, until: float | None) -> None:
        self._problem, self._scheme, self._until = problem, scheme, until
        self._weights, self.patience = _weights(problem), _MAX_STALLED
        self._points: list[FloatArray] = []
        self._misses: list[FloatArray] = []

    def turn(self, x: FloatArray) -> PeriodMap | None:
        """Return a revolution from a state; None if the run fails."""
        one = replace(self._problem, start=_unpack(self._problem, x))
        save = SaveAt(field_every=max(one.steps // 64, 1))
        response = solve(one, self._scheme, save=save, until=self._until)
        if response.status.cause is Cause.TIME_LIMIT:
            raise RunFailedError(_TIME_LIMIT_STATUS)
        if not response.status.ok:
            return None
        self.patience = max(_MAX_STALLED, 0 if response.stats.events else len(x))
        fields = np.concatenate([response.fields.displacement, response.fields.velocity], axis=1)
        return PeriodMap(np.concatenate([fields[-1], response.inner]), fields)

    def next(self, x: FloatArray, turn: PeriodMap | None, error: float) -> FloatArray | None:
        """Return the next state after one with an error; None to stop."""
        if turn is None:
            return None
        points = self._points = [*self._points, x][-_MEMORY:]
        misses = self._misses = [*self._misses, turn.end - x][-_MEMORY:]
        if len(points) == 1:
            return points[0] + misses[0]
        dx, df = np.diff(points, axis=0), np.diff(misses, axis=0)
        weighed = df[:, : len(self._weights)] * self._weights
        share = np.linalg.lstsq(weighed.T, misses[-1][: len(self._weights)] * self._weights, rcond=1e-12)[0]
        return points[-1] + misses[-1] - share @ (dx + df)


def _pack(problem: Problem, state: State) -> FloatArray:
    inner = LocalForces(problem.system).start_state if state.inner is None else state.inner
    return np.concatenate([state.displacement, state.velocity, inner])


def _unpack(problem: Problem, x: FloatArray) -> State:
    n = problem.system.size
    begin = problem.start.time if problem.start else 0.0
    return State(x[:n], x[n : 2 * n], begin, x[2 * n :] if len(x) > 2 * n else None)


def _weights(problem: Problem) -> FloatArray:
    """Return weights that convert displacements and velocities to square roots of energies, shape (2n,)."""
    stiff, mass = (np.sqrt(np.abs(one.diagonal())) for one in (problem.system.stiffness, problem.system.mass))
    return np.concatenate([stiff, mass])
