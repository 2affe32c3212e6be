"""What a cheaper model costs in error: the ladder of a case, each rung at several steps, against a converged run."""

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
"""Steps of the reference, times those of the case; its elements are three times as many."""

_FINER = 3

_REFERENCES = (_FINER, _REFINED), (_FINER - 1, _REFINED // 2)
"""Elements and steps of the reference and of the run that tells its error, times those of the case."""

_COVERS = 2.0
_FEWEST = 60
"""Steps per revolution below which no rung is tried."""


@dataclass(frozen=True, eq=False)
class Reference:
    """The run all others are held against.

    Parameters
    ----------
    measured
        Its histories over the run.
    errors
        Its own error by quantity, SI: twice the distance to a coarser run.
    size
        Largest value by quantity, SI; of the lift its range.
    steps
        Per camshaft revolution.
    norm
        Of all errors; None for that of `flexcam.analysis.measures.norm_of` for each quantity.
    """

    measured: Measured
    errors: dict[str, float]
    size: dict[str, float]
    steps: int
    norm: Norm | None = None


@dataclass(frozen=True)
class Traded:
    """A rung at a number of steps: what it costs, and by how much it errs.

    Parameters
    ----------
    rung, words
        Name of the model, and what it is.
    steps
        Per camshaft revolution.
    unknowns
        Integrated.
    work
        Unknowns times steps of the run.
    seconds
        Processor time of the run, the median of the repeats; s.
    errors
        Error by quantity in the reference's norm, as a part of its largest value (of the lift, of its range).
    status
        How the run ended.
    best
        Whether no other is both cheaper (by `work`, then by steps) and closer in the worst of its quantities; one that
        knows more of them is closer, whatever its errors.
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
        """Largest of its errors; infinite for a run that ended early."""
        return max(self.errors.values(), default=math.inf)


def reference(case: Case, probe: str, until: float | None = None, *, work: int = 0) -> Reference:
    """Return a converged run of a case, with its own error; `work` is the steps per revolution of runs to come."""
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
    """Return the steps per revolution of all runs that hold rungs against the reference of a case."""
    return sum(n for _, n in _REFERENCES) * steps_of(case) + repeats * sum(steps_of(rung.case) for rung in rungs)


def _sound(case: Case) -> Case:
    """Return a case whose method is stable at every step: itself, or by average acceleration."""
    limited = case.record.run.integrator.made().stable_to() < math.inf
    return case.with_average_acceleration() if limited else case


_NAMED = f"the reference, of {_FINER} times the elements and {_REFINED} times the steps"


def _of_reference(status: Status) -> Status:
    """Return how the reference ended, which the case's own run need not."""
    return status if status.cause is Cause.TIME_LIMIT else replace(status, text=f"{_NAMED}: {status.text}")


def _of_finer(fault: Fault) -> Fault:
    """Return what is refused to the reference; what is refused to the case too has been told before."""
    if not fault.where.startswith("run."):
        return fault
    return replace(fault, why="; ".join(filter(None, (f"asked of {_NAMED}", fault.why))))


def candidates(case: Case) -> list[Rung]:
    """Return the rungs of a case at its own steps and fewer, least work first."""
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
    """Return what a rung costs and by how much it errs; `work` is the steps per revolution of all runs to come."""
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
    """Return a rung whose method does not take its steps; any other refusal is one of the case."""
    if not all(fault.where.startswith("run.") for fault in refusal.faults):
        raise refusal
    problem = prepare(_sound(rung.case)).problem
    unknowns, status = integrated_size(problem), Status(Cause.REFUSED, "; ".join(map(str, refusal.faults)))
    return Traded(rung.name, rung.words, steps_of(rung.case), unknowns, unknowns * problem.steps, 0.0, {}, status)


def _timed(ready: Prepared, until: float | None) -> tuple[Response, float]:
    """Return a run and the processor time it took, s."""
    begun = time.process_time()
    response = solve(ready.problem, ready.scheme, save=ready.save, until=until)
    raise_if_interrupted(response.status)
    return response, time.process_time() - begun


def trade(
    case: Case, probe: str, *, repeats: int = 3, advance: Advance | None = None
) -> tuple[Reference, list[Traded]]:
    """Return what every rung of a case's ladder costs and by how much it errs."""
    rungs = candidates(case)
    work = work_of(case, rungs, repeats)
    against = reference(case, probe, work=work)
    found = [tried(rung, probe, against, repeats=repeats, work=work) for rung in track_progress(rungs, advance)]
    return against, front(found)


def front(found: Sequence[Traded]) -> list[Traded]:
    """Return rungs with those marked that no other beats both in work and in error."""
    every = len({name for one in found for name in one.errors})
    least = every, math.inf
    marked: list[Traded] = []
    for one in sorted(found, key=lambda one: (one.work, one.steps, one.worst)):
        error = every - len(one.errors), one.worst  # what a model does not know it gets wrong
        marked.append(replace(one, best=error < least))
        least = min(least, error)
    return marked
