"""Error versus cost of models: the ladder of a case, each model with several step counts, against a converged run."""

from __future__ import annotations

import math
import statistics
import time
from collections.abc import Sequence
from dataclasses import dataclass, replace

from flexcam.analysis.measures import Measured, Norm, distance, measured
from flexcam.analysis.model_ladder import Rung, as_beams, ladder, measured_run, steps_of, with_elements
from flexcam.analysis.preparation import Prepared, prepare, standing
from flexcam.case.case import Case
from flexcam.case.schema.run import ResultStartRecord
from flexcam.core.errors import Fault, InputError, refuse
from flexcam.dynamics import (
    Advance,
    Cause,
    Response,
    RunFailedError,
    Status,
    integrated_size,
    raise_if_interrupted,
    solve,
    track_progress,
)

_REFINED = 4
"""Ratio of the steps of the reference to those of the case; it has three times as many elements."""

_FINER = 3

_REFERENCES = (_FINER, _REFINED), (_FINER - 1, _REFINED // 2)
"""Elements and steps, relative to the case, of the reference and of the run that estimates its error."""

_COVERS = 2.0
_FEWEST = 60
"""Minimum steps per revolution of an evaluated model."""


@dataclass(frozen=True, eq=False)
class Reference:
    """Converged reference run.

    Parameters
    ----------
    measured
        Histories of the run.
    errors
        Its estimated error by quantity, SI: twice the distance from a coarser run.
    size
        Maximum absolute value by quantity, SI; for the lift its range.
    steps
        Steps per camshaft revolution.
    norm
        Norm of all errors; None for that of `flexcam.analysis.measures.norm_of` for each quantity.
    """

    measured: Measured
    errors: dict[str, float]
    size: dict[str, float]
    steps: int
    norm: Norm | None = None


@dataclass(frozen=True)
class Traded:
    """Cost and error of a model with a number of steps.

    Parameters
    ----------
    rung, words
        Name and description of the model.
    steps
        Steps per camshaft revolution.
    unknowns
        Number of integrated degrees of freedom.
    work
        Degrees of freedom times steps of the run.
    seconds
        Processor time of the run, s, median of the repeats.
    errors
        Error by quantity in the norm of the reference, relative to its maximum (for the lift, its range).
    status
        Status of the run.
    best
        Whether no other model is both cheaper (by `work`, then by steps) and closer in its worst quantity; a model that
        computes more quantities counts as closer, regardless of its errors.
    """

    rung: str
    words: str
    steps: int
    unknowns: int
    work: int
    seconds: float
    errors: dict[str, float]
    status: Status
    best: bool = False

    @property
    def worst(self) -> float:
        """Maximum error; infinite for an incomplete run."""
        return max(self.errors.values(), default=math.inf)


def reference(case: Case, probe: str, until: float | None = None, *, work: int = 0) -> Reference:
    """Return a converged run of a case with its error; `work` is the steps per revolution of all planned runs."""
    _refuse_result(case)
    steps, norm = steps_of(case), case.record.fidelity.norm
    work = max(work, work_of(case, ()))
    beams = _sound(as_beams(case).with_run({"engine": "auto"}))  # which its size decides; the ways agree to rounding
    try:
        finest, coarser = (
            measured_run(
                Rung("reference", "", with_elements(beams, factor=elements)).stepped(n * steps), probe, until, work
            )
            for elements, n in _REFERENCES
        )
    except RunFailedError as failure:
        raise_if_interrupted(failure.status)
        raise RunFailedError(_of_reference(failure.status)) from None
    except InputError as refusal:
        raise InputError(_of_finer(fault) for fault in refusal.faults) from None
    errors = {name: _COVERS * value for name, value in distance(finest, coarser, norm=norm).items()}
    return Reference(finest, errors, {name: finest.size(name) for name in errors}, _REFINED * steps, norm)


def _refuse_result(case: Case) -> None:
    if isinstance(case.record.run.start, ResultStartRecord):
        where, why = case.place(("run", "start")), "a result fits one mesh, and others are tried"
        raise refuse(where, "a start from a result", "another start", why, "give rest, equilibrium, periodic or values")


def work_of(case: Case, rungs: Sequence[Rung], repeats: int = 1) -> int:
    """Return the steps per revolution of all runs that compare models with the reference of a case."""
    return sum(n for _, n in _REFERENCES) * steps_of(case) + repeats * sum(steps_of(rung.case) for rung in rungs)


def _sound(case: Case) -> Case:
    """Return a case with an unconditionally stable method: itself, or with average acceleration."""
    limited = case.record.run.integrator.made().stable_to() < math.inf
    return case.with_average_acceleration() if limited else case


_NAMED = f"the reference, of {_FINER} times the elements and {_REFINED} times the steps"


def _of_reference(status: Status) -> Status:
    """Return a status with a note that it is that of the reference, not of the case."""
    return status if status.cause is Cause.TIME_LIMIT else replace(status, text=f"{_NAMED}: {status.text}")


def _of_finer(fault: Fault) -> Fault:
    """Return a fault with a note that it concerns the reference; faults of the case itself are reported before."""
    if not fault.where.startswith("run."):
        return fault
    return replace(fault, why="; ".join(filter(None, (f"asked of {_NAMED}", fault.why))))


def candidates(case: Case) -> list[Rung]:
    """Return the models of a case with its own steps and fewer, in ascending order of work."""
    _refuse_result(case)
    steps = steps_of(case)
    counts = [steps // n for n in (8, 4, 2, 1) if steps % n == 0 and (steps // n >= _FEWEST or n == 1)]
    return sorted(
        (rung.stepped(n) for rung in ladder(case) for n in counts),
        key=lambda rung: (_size(standing(_sound(rung.case))), steps_of(rung.case)),
    )


def _size(ready: Prepared) -> int:
    return integrated_size(ready.problem) * ready.problem.steps


def tried(
    rung: Rung, probe: str, against: Reference, *, repeats: int = 1, until: float | None = None, work: int = 0
) -> Traded:  # fmt: skip
    """Return cost and error of a model; `work` is the steps per revolution of all planned runs."""
    try:
        ready = rung.prepared(until, work)
    except InputError as refusal:
        return _refused(rung, refusal)
    response, first = _timed(ready, until)
    seconds = [first, *(_timed(ready, until)[1] for _ in range(repeats - 1))]
    errors: dict[str, float] = {}
    if response.status.ok:
        apart = distance(measured(response, probe), against.measured, norm=against.norm)
        errors = {name: value / against.size[name] for name, value in apart.items() if against.size[name] > 0.0}
    return Traded(
        rung.name, rung.words, steps_of(rung.case), response.stats.unknowns,
        response.stats.unknowns * ready.problem.steps, statistics.median(seconds), errors, response.status,
    )  # fmt: skip


def _refused(rung: Rung, refusal: InputError) -> Traded:
    """Return a model whose method does not accept its steps; other errors are raised."""
    if not all(fault.where.startswith("run.") for fault in refusal.faults):
        raise refusal
    problem = prepare(_sound(rung.case)).problem
    unknowns, status = integrated_size(problem), Status(Cause.REFUSED, "; ".join(map(str, refusal.faults)))
    return Traded(rung.name, rung.words, steps_of(rung.case), unknowns, unknowns * problem.steps, 0.0, {}, status)


def _timed(ready: Prepared, until: float | None) -> tuple[Response, float]:
    """Return a run and its processor time, s."""
    begun = time.process_time()
    response = solve(ready.problem, ready.scheme, save=ready.save, until=until)
    raise_if_interrupted(response.status)
    return response, time.process_time() - begun


def trade(
    case: Case, probe: str, *, repeats: int = 3, advance: Advance | None = None
) -> tuple[Reference, list[Traded]]:
    """Return cost and error of every model on a case's ladder."""
    rungs = candidates(case)
    work = work_of(case, rungs, repeats)
    against = reference(case, probe, work=work)
    found = [tried(rung, probe, against, repeats=repeats, work=work) for rung in track_progress(rungs, advance)]
    return against, front(found)


def front(found: Sequence[Traded]) -> list[Traded]:
    """Return the models with the Pareto front in work and error marked."""
    every = len({name for one in found for name in one.errors})
    least = every, math.inf
    marked: list[Traded] = []
    for one in sorted(found, key=lambda one: (one.work, one.steps, one.worst)):
        error = every - len(one.errors), one.worst  # a model without a quantity has an infinite error in it
        marked.append(replace(one, best=error < least))
        least = min(least, error)
    return marked
