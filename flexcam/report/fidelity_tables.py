"""Tables of error and cost of models, error estimates and model choice."""

from __future__ import annotations

import math
from collections.abc import Sequence

from rich.table import Table

from flexcam.analysis.model_choice import Choice, Error, ModelEvaluation, Reference
from flexcam.core.units import to_display_unit
from flexcam.dynamics import Cause
from flexcam.report.terminal import plain_table

# Error relative to its number below which it is rounding: the stiffness of many elements leaves about 1e-11
_ROUNDING = 1e-10
# Error of the reference relative to the quantity's size from which a warning is given
_REFERENCE_ERROR_TOLERANCE = 0.05
_DIGITS = 12  # maximum number of decimals


def trade_table(against: Reference, found: Sequence[ModelEvaluation]) -> Table:
    """Return the table of a case's model ladder."""
    kinds, ranks = list(against.errors), not _rough_quantities(against)
    rows = [
        ("*" if model.best and ranks else "", model.rung, str(model.steps), str(model.unknowns), f"{model.work:.3g}",
         f"{model.seconds:.3g}", *(_percent(model.errors.get(kind)) for kind in kinds),
         "" if model.status.ok else str(model.status.cause))
        for model in found
    ]  # fmt: skip
    ref = reference_errors(against)
    rows.append(("", "reference", str(against.steps), "", "", "", *map(_percent, ref.values()), "own error"))
    errors = (kind.replace("acceleration", "accel.") for kind in kinds)  # a longer word would be broken in a terminal
    heads = ("", "model", "steps per rev", "unknowns", "work", "cpu s", *errors, "")
    mixed = "rms error of motions and maximum error of forces"
    norm = {"max": "maximum error", "rms": "rms error", None: mixed}[against.norm]
    return plain_table(f"Cost and error of models ({norm}, in % of the maximum)", heads, rows)


def trade_legend(against: Reference) -> str:
    """Return the explanation of the table of a case's model ladder."""
    work = "work: number of unknowns times number of steps"
    if _rough_quantities(against):
        return work
    return f"* Pareto-optimal: no model with less work has a smaller error (the largest of its error columns); {work}"


def reference_errors(against: Reference) -> dict[str, float]:
    """Return the errors of the reference relative to the sizes of the quantities."""
    return {name: error / against.size[name] if against.size[name] else 0.0 for name, error in against.errors.items()}


def _percent(share: float | None) -> str:
    return "" if share is None else f"{float(f'{100.0 * share:.2g}'):g}"  # 110 instead of 1.1e+02


def _rough_quantities(against: Reference) -> list[str]:
    """Return the quantities in which the reference has a large error, with this error."""
    shares = reference_errors(against).items()
    return [f"{name} ({_percent(share)} %)" for name, share in shares if share > _REFERENCE_ERROR_TOLERANCE]


def trade_warnings(against: Reference, found: Sequence[ModelEvaluation]) -> list[str]:
    """Return warnings about a rough reference, and about models that were not run, with the first reason."""
    warnings: list[str] = []
    if rough := _rough_quantities(against):
        unsure = f"Warning: the reference itself has a large error in {', '.join(rough)}"
        why = "bounces, or motions that its steps do not resolve"
        warnings.append(f"{unsure}: {why}; models are not ranked by these errors; compare their other columns")
    refused = [model for model in found if model.status.cause is Cause.REFUSED]
    if refused:
        models = {model.rung: [str(other.steps) for other in refused if other.rung == model.rung] for model in refused}
        text = "; ".join(f"{name} at {', '.join(steps)}" for name, steps in models.items())
        warnings.append(f"Not run, as the method of the case does not allow such steps: {text}. "
                        f"The first: {refused[0].status.text}")  # fmt: skip
    return warnings


def evaluation_json(one: ModelEvaluation) -> dict[str, object]:
    """Return one model of the ladder for ``--json``."""
    return {
        "model": one.rung, "words": one.words, "steps_per_revolution": one.steps, "unknowns": one.unknowns,
        "work": one.work, "cpu_seconds": one.seconds, "errors": one.errors, "best": one.best,
        "status": one.status.cause,
    }  # fmt: skip


def error_table(errors: Sequence[Error]) -> Table:
    """Return the values of a run with their estimated errors."""
    rows = [
        (error.quantity, format_with_error(error),
         *(f"{100.0 * part / error.size:.2g} %" if error.size > 0.0 and error.holds else ""
           for part in (error.time, error.space, error.model)),
         "" if error.holds else "no convergence with shorter steps: use more")
        for error in errors
    ]  # fmt: skip
    heads = ("quantity", "max", "by the steps", "by the elements", "by the model", "")
    return plain_table("Estimated errors", heads, rows)


def format_with_error(one: Error) -> str:
    """Return a value with its error, such as ``10.43 ± 0.02 mm``, or alone if the estimate is invalid."""
    factor, unit = to_display_unit(one.unit)
    value, error = factor * one.size, factor * one.total
    if not one.holds:
        return f"{value:.4g} {unit}"
    if not error > _ROUNDING * value:
        return f"{value:.10g} {unit}"
    digits = max(1 - math.floor(math.log10(error)), 0)
    if digits > _DIGITS:
        return f"{value:.{_DIGITS}g} ± {error:.2g} {unit}"
    return f"{value:.{digits}f} ± {error:.{digits}f} {unit}"


def describe_choice(choice: Choice) -> list[str]:
    """Return sentences about the chosen model, the reason, and the cost of the next cheaper one."""
    model, cheaper = choice.evaluation, choice.cheaper
    text = f"{model.rung} ({model.words}), {model.steps} steps per revolution, {model.unknowns} unknowns"
    if not choice.is_met:
        closest = f"{text}; errors: {_errors(model)}"
        return [f"The tolerance is not met: {choice.why}. The run uses the closest model: {closest}"]
    words = [f"Chosen of {choice.count} models tried: {text}; errors: {_errors(model)}"]
    if cheaper is not None:
        saved = f"{100.0 * cheaper.work / model.work:.0f} % of the work" if model.work else "as much work"
        words.append(f"Next cheaper, outside the tolerance: {cheaper.rung}, {cheaper.steps} steps per revolution, "
                     f"{saved}; {_errors(cheaper)}")  # fmt: skip
    return words


def _errors(model: ModelEvaluation) -> str:
    return ", ".join(f"{kind} {_percent(error)} %" for kind, error in model.errors.items())


def choice_json(choice: Choice) -> dict[str, object]:
    """Return a model choice for ``--json``."""
    cheaper = choice.cheaper and evaluation_json(choice.cheaper)
    model = evaluation_json(choice.evaluation)
    return {"met": choice.is_met, "tried": choice.count, "why": choice.why, "model": model, "cheaper": cheaper}
