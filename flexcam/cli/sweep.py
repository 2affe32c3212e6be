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
from flexcam.core.errors import refuse, together
from flexcam.dynamics import Cause, Status
from flexcam.io import named_as_folder
from flexcam.report.terminal import counting, out, print_json, table
from flexcam.studies.axes import LIMIT
from flexcam.studies.executors import LOCAL, Cluster, Here, Processes, Workers
from flexcam.studies.sweep import Target, afford, study, sweep_files
from flexcam.studies.tables import Table

_NAMED = 3
"""Number of variants named in a sentence."""


def sweep_table(found: Table) -> RichTable:
    """Return the table of the range of every scalar; constant scalars are omitted."""
    rows: list[tuple[str, ...]] = []
    for name, values in found.scalars.items():
        if _differs(values):
            least, largest = int(np.nanargmin(values)), int(np.nanargmax(values))
            ends = (f"{values[least]:.5g}", _at(found, least), f"{values[largest]:.5g}", _at(found, largest))
            rows.append((name, found.units[name], *ends))
    title = f"{len(found)} variants over {', '.join(one.name for one in found.inputs)}"
    return table(title, ("scalar", "SI unit", "least", "at", "largest", "at"), rows)


def _differs(values: FloatArray) -> bool:
    """Return whether a scalar has a range to show: two different values, or a single one."""
    known = values[np.isfinite(values)]
    return len(known) == 1 or (len(known) > 0 and bool(np.ptp(known) > 0.0))


def _at(found: Table, i: int) -> str:
    """Return the inputs of a variant."""
    values = [one.values[i] for one in found.inputs]
    told = [value if isinstance(value, str) else f"{value:.6g}" for value in values]
    return ", ".join(f"{value} {one.unit}".rstrip() for value, one in zip(told, found.inputs, strict=True))


def sweep_words(found: Table) -> list[str]:
    """Return sentences about failed variants and about an empty table."""
    alike = found.scalars and not any(_differs(values) for values in found.scalars.values())
    words = ["every scalar is the same in all variants; the files have them"] if alike else list[str]()
    for cause, rows in _failures(found).items():
        named = ", ".join(str(i + 1) for i in rows[:_NAMED])
        more = f" and {len(rows) - _NAMED} more" if len(rows) > _NAMED else ""
        one, first = "variant" if len(rows) == 1 else "variants", found.statuses[rows[0]]
        words.append(f"{len(rows)} of {len(found)} failed ({cause}): {one} {named}{more}. The first: {first.text}")
    return words


def _failures(found: Table) -> dict[str, list[int]]:
    causes: dict[str, list[int]] = {}
    for i in found.failed:
        causes.setdefault(str(found.statuses[i].cause), []).append(i)
    return causes


def sweep_status(found: Table) -> Status | None:
    """Return the status of the command: a sweep fails if all variants fail."""
    if len(found.failed) < len(found):
        return None
    first = found.statuses[0]
    return Status(first.cause, f"none of {len(found)} variants was completed; the first: {first.text}", first.remedy)


def sweep_json(found: Table, ended: Status | None, files: Sequence[Path]) -> dict[str, object]:
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


def _range(found: Table, name: str) -> dict[str, object]:
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
    limit: Annotated[int, Parameter(help="Most variants.")] = LIMIT,
    allow_large: AllowLarge = False, overwrite: Overwrite = False, as_json: Json = False,
) -> Status | None:  # fmt: skip
    """Run many variants of a case and write one table: a row per variant, with its scalars and how it ended.

    What the case's table [sweep] says counts too; --set lays over it. See docs/sweeps.md.
    """
    kept = [name.strip() for words in scalars or [] for name in words.split(",")]
    asked = together(
        lambda: study(case, settings or (), sampled=sample, seed=seed, scalars=kept, limit=limit),
        lambda: named_as_folder(folder),
        lambda: _workers(scheduler, workers),
    )
    target = Target(folder, resume, overwrite, histories, parquet)
    runners = _workers(scheduler, workers)
    if not allow_large:
        at_once = 1 if scheduler or workers == 0 else workers or _cores()
        afford(asked, folder if histories else None, together=at_once)
    with counting(len(asked.plan), "variants") as shown:
        table, files = sweep_files(asked, target, runners, advance=shown)
    ended = sweep_status(table)
    if as_json:
        print_json(sweep_json(table, ended, files))
        return ended
    out().print(sweep_table(table))
    for sentence in sweep_words(table):
        out().print("\n" + sentence)
    for path in files:
        out().print(str(path))
    return ended


def _workers(scheduler: str | None, count: int | None) -> Workers:
    """Return the workers that run the variants."""
    if scheduler is not None and scheduler != LOCAL:
        if count is not None:
            why = "a cluster has the workers it has"
            raise refuse("--workers", count, "nothing with --scheduler, but local", why, "remove one of them")
        return Cluster(scheduler)
    number = _cores() if count is None else count
    if scheduler == LOCAL:
        return Cluster(LOCAL, number)
    if number < 0:
        raise refuse("--workers", number, "a whole number from 0", "0 runs all in the process of the command")
    return Processes(number) if number else Here()


def _cores() -> int:
    """Return the number of cores available to this process."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
