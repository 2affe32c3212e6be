"""One variant: a case run to its end, and what is kept of it; whatever happens, a row comes out."""

from __future__ import annotations

import time
import traceback
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path

from flexcam.case import Case
from flexcam.checks import InputError
from flexcam.fidelity import chosen
from flexcam.integrate import solve
from flexcam.response import Cause, Response, RunFailedError, SaveAt, Status
from flexcam.runner import Prepared, prepare, result_file
from flexcam.sweep.scalars import scalars_of
from flexcam.train import Model


@dataclass(frozen=True)
class Row:
    """What a sweep keeps of one variant.

    Parameters
    ----------
    status
        How its run ended; ``refused`` where it could not start.
    scalars
        Name to value, SI (`flexcam.sweep.scalars`); empty unless the run is complete.
    units
        SI unit of each scalar.
    seconds
        Time it took; it stays out of the tables, which are the same on every machine.
    """

    status: Status
    scalars: Mapping[str, float] = field(default_factory=dict[str, float])
    units: Mapping[str, str] = field(default_factory=dict[str, str])
    seconds: float = 0.0


def evaluate(
    case: Case, *, folder: Path | None = None, model: Model | None = None, runs: int = 1, channels: bool = True
) -> Row:
    """Run a case and return what a sweep keeps of it."""
    begun = time.perf_counter()
    row = _row(case, folder, model, runs, channels)
    return Row(row.status, row.scalars, row.units, time.perf_counter() - begun)


_SELDOM = SaveAt(field_every=4096)
"""Fields of one of many linear runs, which nobody keeps: blocks are long, and rows are those of one run to rounding."""


def _row(case: Case, folder: Path | None, model: Model | None, runs: int, channels: bool) -> Row:
    try:
        read, choice = chosen(case)
        ready = prepare(read, model=model)
        sinks = [] if folder is None else [result_file(ready, folder)]
        alone = sinks or runs == 1 or ready.problem.system.local_forces
        save = ready.save if alone else _SELDOM
        save = save if channels or sinks else replace(save, channels=False)
        response = solve(replace(ready.problem, runs=runs), ready.scheme, save=save, sinks=sinks)
        row = row_of(ready, response)
    except InputError as refusal:
        return refused(refusal)
    except RunFailedError as failure:
        return Row(failure.status)
    except Exception as fault:  # noqa: BLE001 - a fault in one variant must not cost the others
        return Row(_fault(fault))
    if choice is None or not row.status.ok:
        return row
    named = f"{choice.found.rung}, {choice.found.steps} steps per revolution"
    met = Status(text=f"chosen within the tolerance: {named}")
    missed = Status(Cause.TOLERANCE, f"the tolerance is not met: {choice.why}; that is {named}")
    return Row(met if choice.met else missed, row.scalars, row.units)


def row_of(ready: Prepared, response: Response) -> Row:
    """Return the row of a run that has been solved."""
    if not response.status.ok:
        return Row(response.status)
    figures = scalars_of(ready, response)
    values, units = {one.name: one.value for one in figures}, {one.name: one.unit for one in figures}
    return Row(response.status, values, units, response.stats.seconds)


def refused(refusal: InputError) -> Row:
    """Return the row of a variant that cannot start."""
    return Row(Status(Cause.REFUSED, " | ".join(map(str, refusal.faults))))


def _fault(fault: Exception) -> Status:
    """Return the status of a fault of flexcam itself, with the line it happened on."""
    last = traceback.extract_tb(fault.__traceback__)[-1]
    text = f"a fault of flexcam itself: {type(fault).__name__}: {fault} ({Path(last.filename).name}:{last.lineno})"
    return Status(Cause.FAULT, text, "please report it; flexcam run with the same keys shows more")
