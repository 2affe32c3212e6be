"""Choice of the cheapest sufficient model: models are compared with a converged run in ascending order of work."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

from flexcam.analysis.model_ladder import ModelLevel
from flexcam.analysis.preparation import prepare_without_periodic_search, scalar_probe
from flexcam.analysis.trade import (
    ModelEvaluation,
    Reference,
    candidate_models,
    evaluate_model,
    reference_run,
    total_work,
)
from flexcam.case.case import Case
from flexcam.case.schema.run import ResultStartRecord
from flexcam.core.errors import refuse
from flexcam.dynamics import Cause, RunFailedError, Status


@dataclass(frozen=True, eq=False)
class Choice:
    """Model that meets a tolerance, or the closest one.

    Parameters
    ----------
    rung
        Model: the cheapest that meets the tolerance, else the one with the smallest error.
    found
        Its errors and cost.
    cheaper
        Closest of the cheaper models that do not meet the tolerance; None if there is none.
    against
        Reference run.
    met
        Whether the tolerance is met, including the error of the reference.
    tried
        Number of models tried.
    tolerance
        Tolerance by quantity.
    """

    rung: ModelLevel
    found: ModelEvaluation
    cheaper: ModelEvaluation | None
    against: Reference
    met: bool
    tried: int
    tolerance: Mapping[str, float]

    @property
    def why(self) -> str:
        """Reason why no model meets the tolerance; empty if one does."""
        if self.met:
            return ""
        sizes, own = self.against.size, self.against.errors
        asked = {name: error for name, error in self.found.errors.items() if name.partition(" ")[0] in self.tolerance}
        said = [f"{name} {_percent(error)} (the reference {_percent(own[name] / sizes[name])})"
                for name, error in asked.items()]  # fmt: skip
        if not said:
            return f"none of {self.tried} models has all of {', '.join(self.tolerance)}"
        return f"the closest of {self.tried} models is off by {', '.join(said)}"


def choose_model(
    case: Case, probe: str, tolerance: Mapping[str, float], until: float | None = None
) -> Choice:  # fmt: skip
    """Return the cheapest model of a case with errors within a tolerance."""
    rungs = candidate_models(case)
    work = total_work(case, rungs)
    against = reference_run(case, probe, until, work=work)
    known = list(dict.fromkeys(name.partition(" ")[0] for name in against.errors))
    if missing := [name for name in tolerance if name not in known]:
        where, why = case.place(("fidelity", "tolerance")), "no other quantity is in the case"
        raise refuse(where, ", ".join(missing), ", ".join(known), why, "leave it out")
    met: list[tuple[ModelLevel, ModelEvaluation]] = []
    missed: list[tuple[ModelLevel, ModelEvaluation]] = []
    for rung in rungs:
        found = evaluate_model(rung, probe, against, until=until, work=work)
        if found.status.cause is Cause.TIME_LIMIT:
            raise RunFailedError(found.status)
        if _error_ratio(found, against, tolerance) <= 1.0:
            met.append((rung, found))
            break
        missed.append((rung, found))
    missed.sort(key=lambda one: _error_ratio(one[1], against, tolerance))
    rung, found = (met or missed)[0]
    cheaper = missed[0][1] if met and missed else None
    return Choice(rung, found, cheaper, against, bool(met), len(met) + len(missed), tolerance)


def select_case(case: Case, until: float | None = None) -> tuple[Case, Choice | None]:
    """Return the case to run: the cheapest model within its tolerance, or the case itself without one."""
    asked = case.record.fidelity
    if not asked.tolerances:
        return case, None
    if isinstance(case.record.run.start, ResultStartRecord):
        why, remedy = "a result fits one mesh, and others are tried", "leave one of them out"
        raise refuse(case.place(("fidelity", "tolerance")), "a start from a result", "another start", why, remedy)
    try:
        choice = choose_model(case, scalar_probe(prepare_without_periodic_search(case)), asked.tolerances, until)
    except RunFailedError as failure:
        if failure.status.cause is Cause.TIME_LIMIT:
            raise RunFailedError(_TIME_LIMIT_STATUS) from None
        raise
    return choice.rung.case.with_fidelity({"estimate": asked.estimate}), choice


_TIME_LIMIT_STATUS = Status(
    Cause.TIME_LIMIT, "the time given to the command was over while a model within fidelity.tolerance was sought: "
    "nothing is kept", "allow more time, or run `flexcam trade` once and choose the model by hand",
)  # fmt: skip


def _percent(share: float) -> str:
    return f"{100.0 * share:.2g} %"


_MIN_TOLERANCE = 1e-300
"""Replaces a tolerance of zero, which no model meets, so that the closest model is still found."""


def _error_ratio(found: ModelEvaluation, against: Reference, tolerance: Mapping[str, float]) -> float:
    """Return the maximum ratio of error, including that of the reference, to tolerance; infinite for a failed run."""
    shares: list[float] = []
    for name, own in against.errors.items():
        allowed = tolerance.get(name.partition(" ")[0])
        if allowed is not None and against.size[name] > 0.0:  # a model without a quantity has an infinite error in it
            error = found.errors.get(name, math.inf) + own / against.size[name]
            shares.append(error / max(allowed, _MIN_TOLERANCE))
    return max(shares, default=math.inf)
