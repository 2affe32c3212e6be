"""Command that runs a sweep: sweep, with a table of ranges and sentences."""

from __future__ import annotations

import os
from collections.abc import Sequence
from pathlib import Path
from typing import Annotated

import numpy as np
from cyclopts import Parameter
from rich.table import Table as RichTable

from flexcam.cli.app import AllowLarge, CaseFile, Folder, Json, Overwrite, app
from flexcam.core import FloatArray
from flexcam.core.errors import collect_errors, refuse
from flexcam.dynamics import Cause, Status
from flexcam.io import check_folder_name
from flexcam.report.terminal import plain_table, print_json, result_console, show_count
from flexcam.studies.executors import LOCAL, ClusterWorkers, ProcessWorkers, SerialWorkers, Workers
from flexcam.studies.plan import MAX_VARIANTS
from flexcam.studies.sweep import OutputTarget, check_sweep_resources, make_sweep, run_sweep_to_files
from flexcam.studies.tables import SweepTable

_MAX_LISTED = 3
"""Number of variants named in a sentence."""


def sweep_table(found: SweepTable) -> RichTable:
    """Return the table of the range of every scalar; constant scalars are omitted."""
    rows: list[tuple[str, ...]] = []
    for name, values in found.scalars.items():
        if _is_varying(values):
            least, largest = int(np.nanargmin(values)), int(np.nanargmax(values))
            ends = (
                f"{values[least]:.5g}",
                _format_inputs(found, least),
                f"{values[largest]:.5g}",
                _format_inputs(found, largest),
            )
            rows.append((name, found.units[name], *ends))
    title = f"{len(found)} variants over {', '.join(one.name for one in found.inputs)}"
    return plain_table(title, ("scalar", "SI unit", "least", "at", "largest", "at"), rows)


def _is_varying(values: FloatArray) -> bool:
    """Return whether a scalar has a range to show: two different values, or a single one."""
    known = values[np.isfinite(values)]
    return len(known) == 1 or (len(known) > 0 and bool(np.ptp(known) > 0.0))


def _format_inputs(found: SweepTable, i: int) -> str:
    """Return the inputs of a variant."""
    values = [one.values[i] for one in found.inputs]
    told = [value if isinstance(value, str) else f"{value:.6g}" for value in values]
    return ", ".join(f"{value} {one.unit}".rstrip() for value, one in zip(told, found.inputs, strict=True))


def describe_sweep(found: SweepTable) -> list[str]:
    """Return sentences about failed variants and about an empty table."""
    alike = found.scalars and not any(_is_varying(values) for values in found.scalars.values())
    words = ["every scalar is the same in all variants; the files have them"] if alike else list[str]()
    for cause, rows in _failures(found).items():
        named = ", ".join(str(i + 1) for i in rows[:_MAX_LISTED])
        more = f" and {len(rows) - _MAX_LISTED} more" if len(rows) > _MAX_LISTED else ""
        one, first = "variant" if len(rows) == 1 else "variants", found.statuses[rows[0]]
        words.append(f"{len(rows)} of {len(found)} failed ({cause}): {one} {named}{more}. The first: {first.text}")
    return words


def _failures(found: SweepTable) -> dict[str, list[int]]:
    causes: dict[str, list[int]] = {}
    for i in found.failed:
        causes.setdefault(str(found.statuses[i].cause), []).append(i)
    return causes


def sweep_status(found: SweepTable) -> Status | None:
    """Return the status of the command: a sweep fails if all variants fail."""
    if len(found.failed) < len(found):
        return None
    first = found.statuses[0]
    return Status(first.cause, f"none of {len(found)} variants was completed; the first: {first.text}", first.remedy)


def sweep_json(found: SweepTable, ended: Status | None, files: Sequence[Path]) -> dict[str, object]:
    """Return a sweep for ``--json``."""
    status = ended or Status(Cause.DONE, "the sweep is complete")
    return {
        "status": "ok" if ended is None else str(status.cause),
        "message": status.text,
        "variants": len(found),
        "failed": {cause: [i + 1 for i in rows] for cause, rows in _failures(found).items()},
        "inputs": {one.name: one.unit for one in found.inputs},
        "scalars": {name: _range(found, name) for name in found.scalars},
        "files": [str(path) for path in files],
    }


def _range(found: SweepTable, name: str) -> dict[str, object]:
    values = found.scalars[name]
    return {"unit": found.units[name], "least": float(np.nanmin(values)), "largest": float(np.nanmax(values))}


Axes = Annotated[
    list[str] | None,
    Parameter(
        "--set",
        negative=(),
        help="run.speed=1000:4000:50rpm, =1000:4000#61rpm, =3,4 kN/m, =3:6 kN/m (to sample), or one value.",
    ),
]


@app.command(
    help_prologue="""\
flexcam sweep case.toml --set run.crank_speed=1000:8000:50rpm
flexcam sweep case.toml --set run.crank_speed=1000:8000:500rpm --set springs.valve.stiffness=30:60:5kN/m --workers 8
flexcam sweep case.toml --set springs.valve.stiffness=30:60kN/m --sample sobol:512 --scalars deviation,contacts
flexcam sweep case.toml --resume
"""
)
def sweep(
    case: CaseFile, *,
    settings: Axes = None,
    sample: Annotated[
        str | None, Parameter(help="lhs:N or sobol:N points instead of every combination (grid).")
    ] = None,
    seed: Annotated[int | None, Parameter(help="Of the samples; 0 by default.")] = None,
    scalars: Annotated[
        list[str] | None, Parameter(negative=(), help="Keep only these, by name or beginning: deviation,contacts.seat.")
    ] = None,
    folder: Folder = Path("results"),
    workers: Annotated[
        int | None, Parameter(help="Processes, one per core by default; 0 runs all in this one.")
    ] = None,
    scheduler: Annotated[str | None, Parameter(help="Dask: tcp://HOST:PORT, or local for one of --workers.")] = None,
    resume: Annotated[bool, Parameter(negative=(), help="Do the rest of a sweep that was stopped.")] = False,
    histories: Annotated[bool, Parameter(negative=(), help="Also keep every variant's result file.")] = False,
    parquet: Annotated[bool, Parameter(negative=(), help="Also write a Parquet table.")] = False,
    limit: Annotated[int, Parameter(help="Most variants.")] = MAX_VARIANTS,
    allow_large: AllowLarge = False, overwrite: Overwrite = False, as_json: Json = False,
) -> Status | None:  # fmt: skip
    """Run many variants of a case and write one table: a row per variant, with its scalars and how it ended.

    What the case's table [sweep] says counts too; --set lays over it. See docs/sweeps.md.
    """
    kept = [name.strip() for words in scalars or [] for name in words.split(",")]
    asked = collect_errors(
        lambda: make_sweep(case, settings or (), sampled=sample, seed=seed, scalars=kept, limit=limit),
        lambda: check_folder_name(folder),
        lambda: _create_workers(scheduler, workers),
    )
    target = OutputTarget(folder, resume, overwrite, histories, parquet)
    runners = _create_workers(scheduler, workers)
    if not allow_large:
        at_once = 1 if scheduler or workers == 0 else workers or _count_cores()
        check_sweep_resources(asked, folder if histories else None, together=at_once)
    with show_count(len(asked.plan), "variants") as shown:
        table, files = run_sweep_to_files(asked, target, runners, advance=shown)
    ended = sweep_status(table)
    if as_json:
        print_json(sweep_json(table, ended, files))
        return ended
    result_console().print(sweep_table(table))
    for sentence in describe_sweep(table):
        result_console().print("\n" + sentence)
    for path in files:
        result_console().print(str(path))
    return ended


def _create_workers(scheduler: str | None, count: int | None) -> Workers:
    """Return the workers that run the variants."""
    if scheduler is not None and scheduler != LOCAL:
        if count is not None:
            why = "a cluster has the workers it has"
            raise refuse("--workers", count, "nothing with --scheduler, but local", why, "remove one of them")
        return ClusterWorkers(scheduler)
    number = _count_cores() if count is None else count
    if scheduler == LOCAL:
        return ClusterWorkers(LOCAL, number)
    if number < 0:
        raise refuse("--workers", number, "a whole number from 0", "0 runs all in the process of the command")
    return ProcessWorkers(number) if number else SerialWorkers()


def _count_cores() -> int:
    """Return the number of cores available to this process."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
