"""Command of many runs: sweep."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from flexcam import sweep as sweeps
from flexcam.checks import refuse, together
from flexcam.commands.app import AllowLarge, CaseFile, Folder, Json, Overwrite, app
from flexcam.console.sweep import sweep_json, sweep_status, sweep_table, sweep_words
from flexcam.io import named_as_folder
from flexcam.response import Status
from flexcam.terminal import counting, out, print_json

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
    limit: Annotated[int, Parameter(help="Most variants.")] = sweeps.LIMIT,
    allow_large: AllowLarge = False, overwrite: Overwrite = False, as_json: Json = False,
) -> Status | None:  # fmt: skip
    """Run many variants of a case and write one table: a row per variant, with its scalars and how it ended.

    What the case's table [sweep] says counts too; --set lays over it. See docs/sweeps.md.
    """
    kept = [name.strip() for words in scalars or [] for name in words.split(",")]
    asked = together(
        lambda: sweeps.study(case, settings or (), sampled=sample, seed=seed, scalars=kept, limit=limit),
        lambda: named_as_folder(folder),
        lambda: _workers(scheduler, workers),
    )
    target = sweeps.Target(folder, resume, overwrite, histories, parquet)
    runners = _workers(scheduler, workers)
    if not allow_large:
        at_once = 1 if scheduler or workers == 0 else workers or _cores()
        sweeps.afford(asked, folder if histories else None, together=at_once)
    with counting(len(asked.plan), "variants") as shown:
        table, files = sweeps.sweep_files(asked, target, runners, advance=shown)
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


def _workers(scheduler: str | None, count: int | None) -> sweeps.Workers:
    """Return who runs the variants."""
    if scheduler is not None and scheduler != sweeps.LOCAL:
        if count is not None:
            why = "a cluster has the workers it has"
            raise refuse("--workers", count, "nothing with --scheduler, but local", why, "remove one of them")
        return sweeps.Cluster(scheduler)
    number = _cores() if count is None else count
    if scheduler == sweeps.LOCAL:
        return sweeps.Cluster(sweeps.LOCAL, number)
    if number < 0:
        raise refuse("--workers", number, "a whole number from 0", "0 runs all in the process of the command")
    return sweeps.Processes(number) if number else sweeps.Here()


def _cores() -> int:
    """Return how many cores this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
