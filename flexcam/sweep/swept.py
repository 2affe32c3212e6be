"""A sweep run: in memory, or with a journal and tables that outlast every interruption."""

from __future__ import annotations

import os
from collections.abc import Callable, Generator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path

from flexcam.checks import InputError, refuse
from flexcam.io import free_to_write, made_folder
from flexcam.response import Cause, RunFailedError, Status
from flexcam.sweep.chunks import Chunk, Outcome
from flexcam.sweep.evaluate import Row
from flexcam.sweep.execute import executed
from flexcam.sweep.files import can_write_parquet, write_table
from flexcam.sweep.journal import Journal, begun_with
from flexcam.sweep.study import Study
from flexcam.sweep.table import Table, tabulated
from flexcam.sweep.workers import Here, Workers


@dataclass(frozen=True)
class Target:
    """Where the files of a sweep go, and what may be done to those that are there.

    Parameters
    ----------
    folder
        Made if it does not exist.
    resume, overwrite
        Whether to finish what is there, or to replace it.
    histories
        Whether every variant's result file is kept.
    parquet
        Whether a Parquet table is written too.
    """

    folder: Path
    resume: bool = False
    overwrite: bool = False
    histories: bool = False
    parquet: bool = False

    def tables(self, name: str) -> list[Path]:
        """Return the tables of a sweep of that name."""
        return [self.folder / f"{name}.sweep{end}" for end in (".h5", ".csv", *([".parquet"] if self.parquet else []))]

    def journal(self, name: str) -> Path:
        """Return the journal of a sweep of that name."""
        return self.folder / f"{name}.sweep.jsonl"

    def history(self, name: str, variant: int, ending: str) -> Path:
        """Return the result file of a variant, counted from 1."""
        return self.folder / f"{name}.sweep" / f"variant-{variant:05d}{ending}"

    def kept(self, name: str) -> list[Path]:
        """Return the result files of variants that are there, of this sweep or of an earlier one."""
        return sorted((self.folder / f"{name}.sweep").glob("variant-*.vtkhdf*"))


def swept(asked: Study, workers: Workers | None = None, *, advance: Callable[[int], None] | None = None) -> Table:
    """Run a sweep and return its table; nothing is written."""
    rows: dict[int, list[Row]] = {}
    for chunk, outcomes in executed(asked.bundle, asked.chunks, workers or Here()):
        rows[chunk.index] = [one.row for one in outcomes]
        if advance:
            advance(len(outcomes))
    return _tabulated(asked, rows)


def sweep_files(
    asked: Study, target: Target, workers: Workers | None = None, *, advance: Callable[[int], None] | None = None
) -> tuple[Table, list[Path]]:
    """Run a sweep with a journal and write its tables."""
    if target.parquet:
        can_write_parquet()
    asked = _complete(asked, target)
    try:
        with _opened(asked, target) as journal:
            table = _kept(_journaled(asked, target, journal, workers or Here(), advance or _silent), asked.scalars)
            return table, [write_table(table, path, overwrite=True) for path in target.tables(asked.name)]
    except KeyboardInterrupt:
        raise RunFailedError(_stopped(asked, target)) from None


def _complete(asked: Study, target: Target) -> Study:
    """Return a sweep that computes all scalars where its journal has them, or result files are kept."""
    begun = target.resume and begun_with(target.journal(asked.name), "channels")
    return replace(asked, bundle=replace(asked.bundle, channels=True)) if begun or target.histories else asked


def _journaled(asked: Study, target: Target, journal: Journal, workers: Workers, tell: Callable[[int], None]) -> Table:
    """Run what the journal does not have, and return the table of everything."""
    rows = dict(journal.rows)
    tell(sum(len(some) for some in rows.values()))
    left = [chunk for chunk in asked.chunks if chunk.index not in rows]
    stale = target.kept(asked.name) if target.histories and not rows else []
    for chunk, outcomes in executed(asked.bundle, left, workers, histories=target.histories):
        while stale:  # those of an earlier sweep would stand beside a table that does not have their variants
            stale.pop().unlink()
        _keep_histories(asked, target, chunk, outcomes)
        rows[chunk.index] = [one.row for one in outcomes]
        journal.add(chunk.index, rows[chunk.index])
        tell(len(outcomes))
    return _tabulated(asked, rows)


def _stopped(asked: Study, target: Target) -> Status:
    """Return how a sweep ends that was interrupted: what is kept is what the journal has."""
    path, kept = target.journal(asked.name), 0
    if path.exists():
        with _opened(asked, replace(target, resume=True)) as journal:
            kept = sum(len(some) for some in journal.rows.values())
    text = f"stopped by the user: {kept} of {len(asked.plan)} variants are kept in {path}"
    return Status(Cause.INTERRUPTED, text, "the same command with --resume does the rest")


def _kept(table: Table, names: Sequence[str]) -> Table:
    """Return a table with the scalars asked for."""
    try:
        return table.keeping(names) if names else table
    except InputError as refusal:
        remedy = "nothing is lost: --resume with other --scalars writes the tables at once"
        mended = [replace(one, remedy="; ".join(filter(None, (one.remedy, remedy)))) for one in refusal.faults]
        raise InputError(mended) from None


def _silent(count: int) -> None:
    del count


@contextmanager
def _opened(asked: Study, target: Target) -> Generator[Journal]:
    """Open the journal of a sweep whose tables may be written."""
    path, belongs = target.journal(asked.name), asked.belongs(histories=target.histories)
    ours = target.resume and path.exists()
    for table in target.tables(asked.name):
        free_to_write("table", table, overwrite=target.overwrite or ours)
    if target.histories and not (target.overwrite or ours) and (kept := target.kept(asked.name)):
        why, remedy = "nothing is written over", "--overwrite replaces them, -o names another folder"
        raise refuse("histories", f"{len(kept)} in {kept[0].parent}", "none from an earlier sweep", why, remedy)
    journal = Journal(path, belongs, resume=target.resume, overwrite=target.overwrite)
    try:
        yield journal
    finally:
        journal.close()


def _keep_histories(asked: Study, target: Target, chunk: Chunk, outcomes: Sequence[Outcome]) -> None:
    """Write the result files of a chunk, each complete or not there."""
    for i, outcome in enumerate(outcomes):
        if outcome.history is not None:
            ending, content = outcome.history
            path = target.history(asked.name, chunk.first + i + 1, ending)
            made_folder(path.parent)
            partial = path.with_name(f"{path.name}.part")
            partial.write_bytes(content)
            os.replace(partial, path)


def _tabulated(asked: Study, rows: dict[int, list[Row]]) -> Table:
    return tabulated(asked.plan, [row for _, some in sorted(rows.items()) for row in some], asked.about())
