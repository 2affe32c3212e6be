"""What runs of a case add to a report, where they are asked for: errors, limits, what cheaper models cost."""

from __future__ import annotations

from dataclasses import dataclass

from flexcam import fidelity
from flexcam.case import Case
from flexcam.checks import InputError
from flexcam.console.fidelity import TRADE_LEGEND, error_table, plus_minus, trade_table, trade_words
from flexcam.console.limits import limits_table
from flexcam.limits import Limits, find_limits
from flexcam.report.content import Picture, Sheet
from flexcam.report.sheets import sheet

_BRACKET = 0.01
"""Part of the speed within which limits are found."""


@dataclass(frozen=True)
class Asked:
    """What a report says beside what a result tells by itself; each costs runs of the case.

    Parameters
    ----------
    errors
        How far the numbers may be off.
    limits
        The speeds at which the train gives way.
    trade
        What cheaper models cost in error.
    """

    errors: bool = False
    limits: bool = False
    trade: bool = False


@dataclass(frozen=True)
class Extra:
    """What was found.

    Parameters
    ----------
    sentences, sheets, pictures
        For a chapter.
    """

    sentences: tuple[str, ...] = ()
    sheets: tuple[Sheet, ...] = ()
    pictures: tuple[Picture, ...] = ()


def extras(case: Case, probe: str, asked: Asked) -> list[Extra]:
    """Return what runs of a case tell."""
    found: list[Extra] = []
    if asked.errors or case.record.fidelity.estimate:
        found.append(_errors(case, probe))
    if asked.limits:
        found.append(_limits(case))
    if asked.trade:
        found.append(_trade(case, probe))
    return found


def _errors(case: Case, probe: str) -> Extra:
    errors = fidelity.estimate(case, probe)
    told = "; ".join(f"{one.quantity} {plus_minus(one)}" for one in errors if one.holds)
    unknown = ", ".join(one.quantity for one in errors if not one.holds)
    said = [f"Largest values of {probe} and the contacts with their errors: {told}."] if told else []
    if unknown:
        said.append(f"No estimate of the error holds for {unknown}: shorter steps do not bring the runs together.")
    return Extra(tuple(said), (sheet(error_table(errors)),))


def _limits(case: Case) -> Extra:
    scale = case.turns
    try:
        limits = find_limits(case, lowest=0.5 * case.speed, highest=2.0 * case.speed, tolerance=_BRACKET * case.speed)
    except InputError as refusal:  # the rest of the page does not suffer from it
        return Extra(tuple(f"Limits were not looked for: {fault.why or fault.given}." for fault in refusal.faults), ())
    return Extra((_first(limits, scale),), (sheet(limits_table(limits, scale)),))


def _first(limits: Limits, scale: float) -> str:
    if limits.first is None:
        return "Nothing gives way up to twice the speed."
    one = limits.limits[limits.first]
    speed = f"{scale * (one.rpm or 0.0):.4g} rpm of the {'crankshaft' if scale == 2.0 else 'camshaft'}"
    return f"What gives way first is {limits.first.replace('_', ' ')}, from {speed}: {one.words}."


def _trade(case: Case, probe: str) -> Extra:
    from flexcam.view import png_of, work_precision_figure

    against, rungs = fidelity.trade(case, probe, repeats=1)
    table = sheet(trade_table(against, rungs))
    best = ", ".join(f"{one.rung} at {one.steps} steps" for one in rungs if one.best)
    words = (
        f"Error over work, both logarithmic. No other model beats, in both: {best}. "
        f"The table has the numbers ({TRADE_LEGEND})."
    )
    title = "What a cheaper model costs in error"
    return Extra(
        tuple(trade_words(against, rungs)), (table,), (Picture(title, png_of(work_precision_figure(rungs)), words),)
    )
