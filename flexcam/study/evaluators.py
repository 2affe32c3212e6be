"""Who evaluates the variants of a study: this process, or several that stay ready between generations."""

from __future__ import annotations

import multiprocessing
from collections.abc import Generator, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager

from flexcam.case import CaseFile
from flexcam.checks import refuse
from flexcam.limits import Search
from flexcam.response import Advance, Cause, RunFailedError, Status, counted
from flexcam.study.points import Runs, serial, variant_row
from flexcam.sweep import Row
from flexcam.sweep.workers import end_with_parent, ended, one_thread, pipes_may_break, undisturbed

Asked = tuple[CaseFile, tuple[str, ...], tuple[str, ...], Search | None, int]
"""Case file, values laid over it, names of quantities, where limits are looked for, and how many variants there are."""

_asked: list[Asked] = []
"""What a worker process was given, once."""

_LOST = Status(
    Cause.WORKER_LOST, "a process that evaluates variants was killed", "memory is the usual cause: take fewer --workers"
)


@contextmanager
def evaluators(
    file: CaseFile, fixed: Sequence[str], names: Sequence[str], search: Search | None = None,
    *, workers: int = 1, runs: int = 1, advance: Advance | None = None,
) -> Generator[Runs]:  # fmt: skip
    """Give what evaluates variants, for as long as a study goes on."""
    if workers < 1:
        raise refuse("--workers", workers, "a whole number from 1")
    if workers == 1:
        yield serial(file, fixed, names, search, runs=runs, advance=advance)
        return
    bare = CaseFile(file.path, file.text, file.raw)  # meshes do not travel; every process reads its own
    asked = bare, tuple(fixed), tuple(names), search, runs
    # spawn: threads and locks of this process stay out of the workers, on every system
    context = multiprocessing.get_context("spawn")
    before = {process.pid for process in multiprocessing.active_children()}
    with one_thread(), pipes_may_break():
        pool = ProcessPoolExecutor(workers, context, initializer=_begin, initargs=(asked,))

        def evaluated(variants: Sequence[tuple[str, ...]]) -> Iterator[Row]:
            try:
                with undisturbed():
                    rows = [pool.submit(_row, one) for one in variants]
                for row in counted(rows, advance):
                    yield row.result()
            except BrokenProcessPool:
                raise RunFailedError(_LOST) from None

        try:
            yield evaluated
        finally:
            ended(pool, before)


def _begin(asked: Asked) -> None:
    end_with_parent()
    _asked.append(asked)


def _row(overrides: tuple[str, ...]) -> Row:
    file, fixed, names, search, runs = _asked[-1]
    return variant_row(file, (*fixed, *overrides), names, search, runs)
