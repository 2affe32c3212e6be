"""The steady periodic state without a long transient: shooting, accelerated.

The state after one revolution is a function of the state before it; its fixed point is sought by Anderson's method,
which for a linear system is GMRES on the shooting equations: as many revolutions as motions that have not died out.
D. G. Anderson, Iterative procedures for nonlinear integral equations, J. ACM 12 (1965); H. F. Walker and P. Ni, SIAM J.
Numer. Anal. 49 (2011).
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from flexcam.integrate.method import Method
from flexcam.integrate.problem import Problem, State
from flexcam.integrate.solve import solve
from flexcam.linalg import FloatArray
from flexcam.response import Cause, Response, RunFailedError, SaveAt, Status

_NOTHING = 1e-6
"""Part of the first guess's motion below which the periodic state is rest."""

_LATE = Status(
    Cause.TIME_LIMIT, "the time given to the run was over while its periodic start was sought", "allow more time"
)
"""How a run ends that never began."""

_MEMORY = 40
_MOST_REVOLUTIONS = 100
_USUAL_REVOLUTIONS = 10
"""Revolutions of a search, by which its way through time is chosen: engines with contacts take 6 to 21."""

_PATIENCE = 12
"""Revolutions without halving the miss after which the search ends: contacts that open and close leave a floor."""


def periodic(problem: Problem, scheme: Method, *, tolerance: float = 1e-9, until: float | None = None) -> State:
    """Return the state that comes back after one revolution."""
    problem = replace(problem, runs=problem.runs * _USUAL_REVOLUTIONS)
    weights = _weights(problem)
    start = problem.start or State.rest(problem.system.size)
    x, best = _packed(problem, start), start
    points: list[FloatArray] = []
    misses: list[FloatArray] = []
    least, level, since, first = np.inf, np.inf, 0, 0.0
    for _ in range(_MOST_REVOLUTIONS):
        response, end = _revolved(problem, scheme, _unpacked(problem, x), until)
        if response.status.cause is Cause.TIME_LIMIT:
            raise RunFailedError(_LATE)
        if not response.status.ok or end is None:
            break
        miss = end - x
        first = first or _largest(response, weights, x)
        size = max(_largest(response, weights, x), _NOTHING * first)
        error = float(np.linalg.norm(weights * miss[: len(weights)])) / size if size > 0.0 else 0.0
        if error < least:
            least, best = error, _unpacked(problem, x)
        level, since = (error, 0) if error < 0.5 * level else (level, since + 1)
        if error <= tolerance or since > max(_PATIENCE, 0 if response.stats.events else len(x)):
            break
        points, misses = [*points, x][-_MEMORY:], [*misses, miss][-_MEMORY:]
        x = _mixed(points, misses, weights)
    return replace(best, time=start.time, periodicity=float(least))


def _packed(problem: Problem, state: State) -> FloatArray:
    inner = np.zeros(sum(force.states for force in problem.system.local_forces)) if state.inner is None else state.inner
    return np.concatenate([state.displacement, state.velocity, inner])


def _unpacked(problem: Problem, x: FloatArray) -> State:
    n = problem.system.size
    time = problem.start.time if problem.start else 0.0
    return State(x[:n], x[n : 2 * n], time, x[2 * n :] if len(x) > 2 * n else None)


def _revolved(
    problem: Problem, scheme: Method, start: State, until: float | None
) -> tuple[Response, FloatArray | None]:  # fmt: skip
    every = max(problem.steps // 64, 1)
    response = solve(replace(problem, start=start), scheme, save=SaveAt(field_every=every), until=until)
    if not response.status.ok:
        return response, None
    ends = [series[-1] for series in (response.fields.displacement, response.fields.velocity)]
    return response, np.concatenate([*ends, response.inner])


def _weights(problem: Problem) -> FloatArray:
    """Return what makes displacements and velocities roots of energies, shape (2n,)."""
    stiff, mass = (np.sqrt(np.abs(one.diagonal())) for one in (problem.system.stiffness, problem.system.mass))
    return np.concatenate([stiff, mass])


def _largest(response: Response, weights: FloatArray, x: FloatArray) -> float:
    fields = np.concatenate([response.fields.displacement, response.fields.velocity], axis=1)
    return float(np.linalg.norm(weights * (fields - x[: len(weights)]), axis=1).max(initial=0.0))


def _mixed(points: list[FloatArray], misses: list[FloatArray], weights: FloatArray) -> FloatArray:
    """Return the combination of the points behind which the least is missing, moved by what is."""
    if len(points) == 1:
        return points[0] + misses[0]
    dx, df = np.diff(points, axis=0), np.diff(misses, axis=0)
    weighed = df[:, : len(weights)] * weights
    share = np.linalg.lstsq(weighed.T, misses[-1][: len(weights)] * weights, rcond=1e-12)[0]
    return points[-1] + misses[-1] - share @ (dx + df)
