"""Models of a case from rigid to refined beams, their cost and error, and choice of the cheapest within a tolerance.

Models are compared with a converged reference run, in ascending order of work; the error of one run follows from runs
with other steps and elements.
"""

from __future__ import annotations

import math
import statistics
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import pairwise

from flexcam.analysis.histories import Histories, Norm, distance, extract_histories, with_seating
from flexcam.analysis.preparation import PreparedRun, prepare, prepare_without_periodic_search, scalar_probe
from flexcam.case.case import Case
from flexcam.case.problem_builder import DEFAULT_STEPS_PER_REVOLUTION
from flexcam.case.schema.run import ResultStartRecord
from flexcam.case.variants import with_beam_model, with_elements, with_steps
from flexcam.core.errors import InputError, refuse
from flexcam.dynamics import (
    Cause,
    ProgressCallback,
    Response,
    RunFailedError,
    Status,
    integrated_size,
    reraise_interrupt,
    solve,
    track_progress,
)

_REFERENCE_STEPS_RATIO = 4
"""Ratio of the steps of the reference to those of the case; it has three times as many elements."""

_FINER = 3
_REFERENCES = (_FINER, _REFERENCE_STEPS_RATIO), (_FINER - 1, _REFERENCE_STEPS_RATIO // 2)
"""Elements and steps, relative to the case, of the reference and of the run that estimates its error."""

_SAFETY_FACTOR = 2.0
_MIN_STEPS = 60  # minimum steps per revolution of an evaluated model
_ELEMENTS = (1, 2)  # elements per segment of every member, in addition to those of the case and twice as many
_MODE_COUNTS = (3, 10, 30)  # numbers of modes of the reduced models


@dataclass(frozen=True, eq=False)
class ModelLevel:
    """Model of a case."""

    name: str  #: name, such as ``rigid`` or ``beams x2``
    words: str  #: description
    case: Case  #: case with the settings of this model

    @cached_property
    def unknowns(self) -> int | None:
        """Number of integrated unknowns; None if the case has no such model: a chain requires a single train."""
        try:
            problem = prepare_without_periodic_search(self.case.with_stable_method()).problem
        except (InputError, RunFailedError):
            return None
        return integrated_size(problem)


def run_count(case: Case, work: int) -> int:
    """Return the number of runs like that of a case with this sum of steps per revolution, at least one.

    Setup that speeds up many short runs may not pay for a single run.
    """
    return max(round(work / steps_per_revolution_of(case)), 1) if work else 1


def run_histories(
    case: Case, probe: str, until: float | None = None, work: int = 0, *, seatings: bool = False
) -> Histories:
    """Return the compared histories of a case's run; `work` is the steps per revolution of all planned runs."""
    ready = prepare(case, until=until, runs=run_count(case, work))
    response = solve(ready.problem, ready.scheme, save=ready.save, until=until)
    if not response.status.ok:
        raise RunFailedError(response.status)
    histories = extract_histories(response, probe)
    return with_seating(histories, response) if seatings else histories


def steps_per_revolution_of(case: Case) -> int:
    """Return the steps per camshaft revolution of a case, rounded if it gives a time step."""
    run = case.record.run
    if run.step is None:
        return run.steps_per_revolution or DEFAULT_STEPS_PER_REVOLUTION
    ready = prepare(case, rigid=True)
    return round(ready.revolution / ready.problem.step)


def model_ladder(case: Case) -> tuple[ModelLevel, ...]:
    """Return the models of a case from coarse to fine."""
    beams = with_beam_model(case)
    elements = {member.elements for member in case.record.members.values()}
    unknowns = prepare_without_periodic_search(beams).problem.system.size
    fewer = [
        ModelLevel(f"beams {n}", f"{n} element{'s' if n > 1 else ''} per segment", with_elements(beams, each=n))
        for n in _ELEMENTS
        if n < min(elements, default=0)
    ]
    modes: dict[int | None, ModelLevel] = {}
    for n in _MODE_COUNTS:
        if 2 * n < unknowns:
            words, case_n = f"{n} modes with the static answers they miss", beams.with_fidelity({"modes": n})
            level = ModelLevel(f"modes {n}", words, case_n)
            # Among the static answers of one basis are the next modes of a short train.
            modes.setdefault(level.unknowns, level)
    chains = [
        ModelLevel("sdof", "one mass for the train", beams.with_fidelity({"model": "sdof"})),
        ModelLevel("chain 3", "three masses along the train", beams.with_fidelity({"model": "chain", "masses": 3})),
    ]
    return (
        ModelLevel("rigid", "rigid members", beams.with_fidelity({"model": "rigid"}).with_run({"engine": "auto"})),
        *(rung for rung in chains if rung.unknowns is not None),
        *modes.values(),
        *fewer,
        ModelLevel("beams", "the unchanged case", beams),
        ModelLevel("beams x2", "twice as many elements as the case", with_elements(beams, factor=2)),
    )


@dataclass(frozen=True, eq=False)
class Reference:
    """Converged reference run."""

    measured: Histories  #: histories of the run
    errors: dict[str, float]  #: its estimated error by quantity, SI: twice the distance from a coarser run
    size: dict[str, float]  #: maximum absolute value by quantity, SI; for the lift its range
    steps: int  #: steps per camshaft revolution
    #: norm of all errors; None for that of `flexcam.analysis.histories.select_norm` for each quantity
    norm: Norm | None = None


@dataclass(frozen=True)
class ModelEvaluation:
    """Cost and error of a model with a number of steps."""

    #: `rung`, `words`: name and description of the model
    rung: str
    words: str
    steps: int  #: steps per camshaft revolution
    unknowns: int  #: number of integrated degrees of freedom
    work: int  #: degrees of freedom times steps of the run
    seconds: float  #: processor time of the run, s, median of the repeats
    #: error by quantity in the norm of the reference, relative to its maximum (for the lift, its range)
    errors: dict[str, float]
    status: Status  #: status of the run
    #: whether no other model is both cheaper (by `work`, then by steps) and closer in its worst quantity; a model that
    #: computes more quantities counts as closer, regardless of its errors
    best: bool = False

    @property
    def maximum_error(self) -> float:
        """Maximum error; infinite for an incomplete run."""
        return max(self.errors.values(), default=math.inf)


def reference_run(case: Case, probe: str, until: float | None = None, *, work: int = 0) -> Reference:
    """Return a converged run of a case with its error; `work` is the steps per revolution of all planned runs."""
    if isinstance(case.record.run.start, ResultStartRecord):
        where, why = case.place(("run", "start")), "the result fits only one mesh, and flexcam tries others"
        raise refuse(where, "a start from a result", "another start", why, "give rest, equilibrium, periodic or values")
    steps, norm = steps_per_revolution_of(case), case.record.fidelity.norm
    work = max(work, total_work(case, ()))
    # The engine that was requested for the case may not suit the size of the reference; all engines agree to rounding.
    beams = with_beam_model(case).with_run({"engine": "auto"}).with_stable_method()
    cases = [with_steps(with_elements(beams, factor=elements), n * steps) for elements, n in _REFERENCES]
    try:
        finest, coarser = (run_histories(variant, probe, until, work) for variant in cases)
    except RunFailedError as failure:
        reraise_interrupt(failure.status)
        status = failure.status
        if status.cause is not Cause.TIME_LIMIT:
            status = replace(status, text=f"{_REFERENCE_NAME}: {status.text}")
        raise RunFailedError(status) from None
    except InputError as refusal:
        why = f"asked of {_REFERENCE_NAME}"  # faults of the case itself are reported before
        raise InputError(
            replace(fault, why="; ".join(filter(None, (why, fault.why)))) if fault.where.startswith("run.") else fault
            for fault in refusal.faults
        ) from None
    errors = {name: _SAFETY_FACTOR * value for name, value in distance(finest, coarser, norm=norm).items()}
    return Reference(finest, errors, {name: finest.size(name) for name in errors}, _REFERENCE_STEPS_RATIO * steps, norm)


def total_work(case: Case, rungs: Sequence[ModelLevel], repeats: int = 1) -> int:
    """Return the steps per revolution of all runs that compare models with the reference of a case."""
    return sum(n for _, n in _REFERENCES) * steps_per_revolution_of(case) + repeats * sum(
        steps_per_revolution_of(rung.case) for rung in rungs
    )


_REFERENCE_NAME = f"the reference, of {_FINER} times the elements and {_REFERENCE_STEPS_RATIO} times the steps"


def candidate_models(case: Case) -> list[ModelLevel]:
    """Return the models of a case with its own steps and fewer, in ascending order of work."""
    steps = steps_per_revolution_of(case)
    counts = [steps // n for n in (8, 4, 2, 1) if steps % n == 0 and (steps // n >= _MIN_STEPS or n == 1)]
    levels = [(level, n) for level in model_ladder(case) for n in counts]
    levels.sort(key=lambda pair: ((pair[0].unknowns or 0) * pair[1], pair[1]))
    return [replace(level, case=with_steps(level.case, n)) for level, n in levels]


def evaluate_model(
    rung: ModelLevel, probe: str, against: Reference, *, repeats: int = 1, until: float | None = None, work: int = 0
) -> ModelEvaluation:  # fmt: skip
    """Return cost and error of a model; `work` is the steps per revolution of all planned runs."""
    steps = steps_per_revolution_of(rung.case)
    try:
        ready = prepare(rung.case, until=until, runs=run_count(rung.case, work))
    except InputError as refusal:  # the method of the model does not accept its steps
        if not all(fault.where.startswith("run.") for fault in refusal.faults):
            raise
        problem = prepare(rung.case.with_stable_method()).problem
        unknowns, status = integrated_size(problem), Status(Cause.REFUSED, "; ".join(map(str, refusal.faults)))
        return ModelEvaluation(rung.name, rung.words, steps, unknowns, unknowns * problem.steps, 0.0, {}, status)
    response, first = _timed_run(ready, until)
    seconds = [first, *(_timed_run(ready, until)[1] for _ in range(repeats - 1))]
    errors: dict[str, float] = {}
    if response.status.ok:
        differences = distance(extract_histories(response, probe), against.measured, norm=against.norm)
        errors = {name: value / against.size[name] for name, value in differences.items() if against.size[name] > 0.0}
    unknowns = response.stats.unknowns
    return ModelEvaluation(
        rung.name, rung.words, steps, unknowns, unknowns * ready.problem.steps, statistics.median(seconds), errors,
        response.status,
    )  # fmt: skip


def _timed_run(ready: PreparedRun, until: float | None) -> tuple[Response, float]:
    start = time.process_time()
    response = solve(ready.problem, ready.scheme, save=ready.save, until=until)
    reraise_interrupt(response.status)
    return response, time.process_time() - start


def evaluate_ladder(
    case: Case, probe: str, *, repeats: int = 3, advance: ProgressCallback | None = None
) -> tuple[Reference, list[ModelEvaluation]]:
    """Return cost and error of every model on a case's ladder."""
    rungs = candidate_models(case)
    work = total_work(case, rungs, repeats)
    reference = reference_run(case, probe, work=work)
    evaluations = [
        evaluate_model(rung, probe, reference, repeats=repeats, work=work) for rung in track_progress(rungs, advance)
    ]
    return reference, mark_pareto_front(evaluations)


def mark_pareto_front(found: Sequence[ModelEvaluation]) -> list[ModelEvaluation]:
    """Return the models with the Pareto front in work and error marked."""
    total = len({name for model in found for name in model.errors})
    lowest = total, math.inf
    marked: list[ModelEvaluation] = []
    for model in sorted(found, key=lambda model: (model.work, model.steps, model.maximum_error)):
        error = total - len(model.errors), model.maximum_error  # a model without a quantity has an infinite error in it
        marked.append(replace(model, best=error < lowest))
        lowest = min(lowest, error)
    return marked


@dataclass(frozen=True, eq=False)
class Choice:
    """Model that meets a tolerance, or the closest one."""

    rung: ModelLevel  #: model: the cheapest that meets the tolerance, else the one with the smallest error
    evaluation: ModelEvaluation  #: its errors and cost
    #: closest of the cheaper models that do not meet the tolerance; None if there is none
    cheaper: ModelEvaluation | None
    reference: Reference  #: reference run
    is_met: bool  #: whether the tolerance is met, including the error of the reference
    count: int  #: number of models tried
    tolerance: Mapping[str, float]  #: tolerance by quantity

    @property
    def why(self) -> str:
        """Reason why no model meets the tolerance; empty if one does."""
        if self.is_met:
            return ""
        sizes, errors = self.reference.size, self.reference.errors
        errors_found = self.evaluation.errors.items()
        checked = {name: error for name, error in errors_found if name.partition(" ")[0] in self.tolerance}
        parts = [f"{name} {_percent(error)} (the reference {_percent(errors[name] / sizes[name])})"
                 for name, error in checked.items()]  # fmt: skip
        if not parts:
            return f"none of {self.count} models has all of {', '.join(self.tolerance)}"
        return f"the closest of {self.count} models is off by {', '.join(parts)}"


def choose_model(
    case: Case, probe: str, tolerance: Mapping[str, float], until: float | None = None
) -> Choice:  # fmt: skip
    """Return the cheapest model of a case with errors within a tolerance."""
    rungs = candidate_models(case)
    work = total_work(case, rungs)
    reference = reference_run(case, probe, until, work=work)
    known = list(dict.fromkeys(name.partition(" ")[0] for name in reference.errors))
    if missing := [name for name in tolerance if name not in known]:
        where, why = case.place(("fidelity", "tolerance")), "the case has no such quantity"
        raise refuse(where, ", ".join(missing), ", ".join(known), why, "leave it out")
    met: list[tuple[ModelLevel, ModelEvaluation]] = []
    missed: list[tuple[ModelLevel, ModelEvaluation]] = []
    for rung in rungs:
        evaluation = evaluate_model(rung, probe, reference, until=until, work=work)
        if evaluation.status.cause is Cause.TIME_LIMIT:
            raise RunFailedError(evaluation.status)
        if _error_ratio(evaluation, reference, tolerance) <= 1.0:
            met.append((rung, evaluation))
            break
        missed.append((rung, evaluation))
    missed.sort(key=lambda pair: _error_ratio(pair[1], reference, tolerance))
    rung, evaluation = (met or missed)[0]
    cheaper = missed[0][1] if met and missed else None
    return Choice(rung, evaluation, cheaper, reference, bool(met), len(met) + len(missed), tolerance)


def select_case(case: Case, until: float | None = None) -> tuple[Case, Choice | None]:
    """Return the case to run: the cheapest model within its tolerance, or the case itself without one."""
    fidelity = case.record.fidelity
    if not fidelity.tolerances:
        return case, None
    try:
        choice = choose_model(case, scalar_probe(prepare_without_periodic_search(case)), fidelity.tolerances, until)
    except RunFailedError as failure:
        if failure.status.cause is Cause.TIME_LIMIT:
            raise RunFailedError(_TIME_LIMIT_STATUS) from None
        raise
    return choice.rung.case.with_fidelity({"estimate": fidelity.estimate}), choice


_TIME_LIMIT_STATUS = Status(
    Cause.TIME_LIMIT, "the time limit was reached during the search for a model within fidelity.tolerance: "
    "nothing is kept", "allow more time, or run `flexcam trade` once and choose the model by hand",
)  # fmt: skip


def _percent(share: float) -> str:
    return f"{100.0 * share:.2g} %"


_MIN_TOLERANCE = 1e-300  # replaces a tolerance of zero, which no model meets, so that the closest model is still found


def _error_ratio(evaluation: ModelEvaluation, reference: Reference, tolerance: Mapping[str, float]) -> float:
    """Return the maximum ratio of error, including that of the reference, to tolerance; infinite for a failed run."""
    shares: list[float] = []
    for name, reference_error in reference.errors.items():
        allowed = tolerance.get(name.partition(" ")[0])
        if allowed is not None and reference.size[name] > 0.0:  # a model without a quantity has an infinite error in it
            error = evaluation.errors.get(name, math.inf) + reference_error / reference.size[name]
            shares.append(error / max(allowed, _MIN_TOLERANCE))
    return max(shares, default=math.inf)


_CONVERGENCE_RATIO = 0.75  # maximum ratio of the distances at the step and at twice the step for convergent runs
_ROUNDING = 1e-12  # distances below this fraction of a quantity's size are rounding


@dataclass(frozen=True)
class Error:
    """Value of a run with its estimated error."""

    quantity: str  #: name as in `Histories`
    unit: str  #: SI unit
    size: float  #: maximum absolute value; for the lift its range
    #: `time`, `space`, `model`: maximum estimated errors of the history due to steps, elements, and a model coarser
    #: than beams (its distance from the beam model)
    time: float
    space: float
    model: float
    holds: bool  #: whether runs with shorter steps converge; otherwise the estimate is invalid

    @property
    def total(self) -> float:
        """Sum of all errors."""
        return self.time + self.space + self.model


def estimate_errors(case: Case, probe: str, until: float | None = None) -> list[Error]:
    """Return the estimated errors of a case's run."""
    steps = steps_per_revolution_of(case)
    plain, finer = with_steps(case, steps), with_steps(with_elements(case, factor=2), steps)
    # An odd number of steps cannot be halved: convergence is then checked with shorter steps.
    counts = (steps // 2, steps, 2 * steps) if steps % 2 == 0 else (steps, 2 * steps, 4 * steps)
    fidelity = plain.record.fidelity
    coarse = fidelity.model != "beams" or fidelity.modes is not None
    work = sum(counts) + steps * (2 if coarse else 1)
    runs = {n: run_histories(with_steps(plain, n), probe, until, work, seatings=True) for n in counts}
    longer, shorter = (distance(runs[a], runs[b]) for a, b in pairwise(counts))
    base, better = runs[steps], runs[2 * steps]
    beams = run_histories(with_beam_model(plain), probe, until, work, seatings=True) if coarse else base
    model = distance(base, beams) if coarse else {}
    mesh = distance(base, run_histories(finer, probe, until, work, seatings=True))
    step = distance(base, better)
    errors: list[Error] = []
    for name in (name for name in step if name in longer.keys() & shorter.keys() & mesh.keys()):
        size = base.size(name)
        holds = shorter[name] <= max(_CONVERGENCE_RATIO * longer[name], _ROUNDING * size)
        parts = _SAFETY_FACTOR * step[name], _SAFETY_FACTOR * mesh[name], model.get(name, 0.0)
        errors.append(Error(name, base.unit(name), size, *parts, holds))
    return errors
