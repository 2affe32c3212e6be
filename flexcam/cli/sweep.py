"""Command that runs many variants of a case: sweep."""

from __future__ import annotations

from dataclasses import replace
from itertools import chain
from pathlib import Path
from typing import Annotated

import numpy as np
from cyclopts import Group, Parameter
from rich.table import Table as RichTable

from flexcam.cli import app as cli
from flexcam.core import FloatArray
from flexcam.core.errors import collect_errors, refuse
from flexcam.core.units import to_display_unit
from flexcam.dynamics import Status
from flexcam.io import check_folder_name
from flexcam.io.sweep_table import SweepTable
from flexcam.report.terminal import plain_table, show_count
from flexcam.studies.executors import LOCAL, ClusterWorkers, ProcessWorkers, SerialWorkers, Workers, count_cores
from flexcam.studies.plan import MAX_VARIANTS, open_case
from flexcam.studies.sweep import OutputTarget, check_sweep_resources, make_sweep, run_sweep_to_files

_WORKERS = Group("Workers and limits", sort_key=1)
_MAX_LISTED = 3  # number of variants named in a sentence


def _sweep_table(table: SweepTable) -> RichTable:
    rows: list[tuple[str, ...]] = []
    for name, values in table.scalars.items():
        if _is_varying(values):
            low, high = int(np.nanargmin(values)), int(np.nanargmax(values))
            scale, unit = to_display_unit(table.units[name])
            inputs = {i: ", ".join(column.format(i) for column in table.inputs) for i in (low, high)}
            ends = ((f"{scale * values[i]:.5g}", inputs[i]) for i in (low, high))
            rows.append((name, unit, *chain.from_iterable(ends)))
    title = f"{len(table)} variants over {', '.join(column.name for column in table.inputs)}"
    return plain_table(title, ("result", "unit", "min", "at", "max", "at"), rows)


def _is_varying(values: FloatArray) -> bool:
    """Return whether a scalar has a range to show: two different values, or a single one."""
    finite = values[np.isfinite(values)]
    return len(finite) == 1 or (len(finite) > 0 and bool(np.ptp(finite) > 0.0))


def _describe_sweep(table: SweepTable) -> list[str]:
    alike = table.scalars and not any(_is_varying(values) for values in table.scalars.values())
    words = ["every result has the same value in all variants; the files list them"] if alike else list[str]()
    endings = {f"failed ({cause})": rows for cause, rows in _failures(table).items()}
    for ending, rows in {**endings, "ran with warnings": table.warned}.items():
        numbers = ", ".join(str(i + 1) for i in rows[:_MAX_LISTED])
        rest = f" and {len(rows) - _MAX_LISTED} more" if len(rows) > _MAX_LISTED else ""
        noun = "variant" if len(rows) == 1 else "variants"
        if rows:
            first = table.statuses[rows[0]].text
            words.append(f"{len(rows)} of {len(table)} {ending}: {noun} {numbers}{rest}. The first: {first}")
    return words


def _failures(table: SweepTable) -> dict[str, list[int]]:
    causes: dict[str, list[int]] = {}
    for i in table.failed:
        causes.setdefault(str(table.statuses[i].cause), []).append(i)
    return causes


def _sweep_json(table: SweepTable, status: Status) -> dict[str, object]:
    return {
        "message": "the sweep is complete" if status.ok else status.text,
        "variants": len(table),
        "failed": {cause: [i + 1 for i in rows] for cause, rows in _failures(table).items()},
        "warned": len(table.warned),
        "inputs": {column.name: column.unit for column in table.inputs},
        "scalars": {
            name: {"unit": table.units[name], "least": float(np.nanmin(values)), "largest": float(np.nanmax(values))}
            for name, values in table.scalars.items()
        },
    }


@cli.command("""\
flexcam sweep case.toml --set run.crank_speed=1000:8000:50rpm
flexcam sweep case.toml --set run.crank_speed=1000:8000:500rpm --set springs.valve.stiffness=30:60:5kN/m --workers 8
flexcam sweep case.toml --set springs.valve.stiffness=30:60kN/m --sample sobol:512 --scalars deviation,contacts
flexcam sweep case.toml --resume
""")
def sweep(
    case: cli.CaseFile, *,
    settings: Annotated[list[str] | None, Parameter(
        "--set", help="Value, list or range: KEY=4kN/m, KEY=3,4kN/m, KEY=3:6:0.5kN/m (step), KEY=3:6#7kN/m "
        "(count), KEY=3:6kN/m (with --sample). Repeatable.")] = None,
    sample: Annotated[str | None, Parameter(
        help="Sample ranges with lhs:N or sobol:N points instead of a full grid.")] = None,
    seed: Annotated[int | None, Parameter(help="Random seed of the samples; 0 by default.")] = None,
    scalars: Annotated[list[str] | None, Parameter(
        help="Write only the results whose names begin with one of these, such as deviation,contacts.seat.")] = None,
    folder: cli.Folder = Path("results"),
    histories: Annotated[bool, Parameter(help="Also keep the result file of every variant.")] = False,
    parquet: Annotated[bool, Parameter(help="Also write a Parquet table.")] = False,
    resume: Annotated[bool, Parameter(help="Continue a sweep that was stopped.")] = False,
    workers: Annotated[int | None, Parameter(
        group=_WORKERS, help="Number of processes; one per core by default, 0 for only this process.")] = None,
    scheduler: Annotated[str | None, Parameter(
        group=_WORKERS, help="Address of a Dask scheduler, tcp://HOST:PORT; or the word local, which starts one with "
        "--workers processes.")] = None,
    limit: Annotated[int, Parameter(group=_WORKERS, help="Maximum number of variants.")] = MAX_VARIANTS,
    time_limit: Annotated[str | None, Parameter(
        group=_WORKERS, help="Maximum time per variant, such as 5min; a variant that takes longer counts as "
        "failed.")] = None,
    allow_large: cli.AllowLarge = False, overwrite: cli.Overwrite = False, as_json: cli.Json = False,
) -> cli.CommandOutput:  # fmt: skip
    """Run many variants of a case and write one table with a row per variant.

    Ranges come from the case's [sweep] table and from --set, which replaces the range of the same key or adds one. The
    output table has a column per varied key and per result value (peak, mean, ...), and the status of each run.
    """
    prefixes = [name.strip() for words in scalars or [] for name in words.split(",")]
    study, (runners, seconds) = collect_errors(
        lambda: make_sweep(case, settings or (), sampled=sample, seed=seed, scalars=prefixes, limit=limit),
        lambda: collect_errors(
            lambda: _create_workers(scheduler, workers),
            lambda: None if time_limit is None else cli.parse_duration("--time-limit", time_limit),
        ),
        lambda: check_folder_name(folder),
    )
    study = replace(study, time_limit=seconds)
    target = OutputTarget(folder, resume, overwrite, histories, parquet)
    if not allow_large:
        at_once = 1 if scheduler or workers == 0 else workers or count_cores()
        check_sweep_resources(study, folder if histories else None, together=at_once)
    file, variants = open_case(study.bundle), study.plan.variants
    cli.warn_input(file.read(variants[0]), *(file.read(last) for last in variants[1:][-1:]))
    with show_count(len(study.plan), "variants") as advance:
        table, files = run_sweep_to_files(study, target, runners, advance=advance)
    status = cli.joint_status(table.statuses, "variants")
    parts = [_sweep_table(table), *_describe_sweep(table)]
    return cli.CommandOutput(parts, _sweep_json(table, status), files=files, status=status)


def _create_workers(scheduler: str | None, count: int | None) -> Workers:
    if scheduler is not None and scheduler != LOCAL:
        if count is not None:
            why = "a cluster sets its own number of workers"
            raise refuse("--workers", count, "--workers only with --scheduler local", why, "leave one out")
        return ClusterWorkers(scheduler)
    number = count_cores() if count is None else count
    if scheduler == LOCAL:
        return ClusterWorkers(LOCAL, number)
    cli.check_number("--workers", number, 0, why="0 runs all variants in this process")
    return ProcessWorkers(number) if number else SerialWorkers()
