"""Evaluation of the variants of a study by workers, and maps of limits over two numbers."""

from __future__ import annotations

from collections.abc import Generator, Iterator, Mapping, Sequence
from concurrent.futures import Future
from contextlib import contextmanager
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

from flexcam.analysis.limits import ConditionResults, Search, SpeedRuns, evaluate_speed
from flexcam.case.case import Case
from flexcam.case.reader import CaseFile
from flexcam.case.records import find_unit
from flexcam.core import FloatArray
from flexcam.core.errors import InputError, refuse
from flexcam.dynamics import Cause, ProgressCallback, RunFailedError, Status, track_progress
from flexcam.studies.executors import (
    KILLED_STATUS,
    BrokenProcessPool,
    Evaluate,
    ProcessWorkers,
    SerialWorkers,
    Variants,
    divide_variants,
    open_processes,
    open_runner,
)
from flexcam.studies.plan import (
    Axis,
    Bundle,
    Plan,
    Row,
    Value,
    make_bundle,
    make_plan,
    open_case,
    rejected_row,
    restore_file_names,
)
from flexcam.studies.quantities import quantity_row, require_complete
from flexcam.studies.variables import Runs, column


def evaluate_variant(
    file: CaseFile, overrides: Sequence[str], names: Sequence[str], search: Search | None = None, runs: int = 1
) -> Row:
    """Return the row of one variant of a case."""
    try:
        case = file.read(overrides)
    except InputError as refusal:
        return rejected_row(refusal)
    return quantity_row(case, names, search, runs)


def evaluate_variants(
    source: Bundle | Path, variants: Variants, *, fixed: tuple[str, ...], names: tuple[str, ...],
    search: Search | None, runs: int,
) -> list[Row]:  # fmt: skip
    """Return the rows of variants with the requested quantities, in a worker."""
    file = open_case(source)
    rows = (evaluate_variant(file, (*fixed, *overrides), names, search, runs) for overrides in variants)
    return [restore_file_names(row, file.path.parent) for row in rows]


@contextmanager
def create_evaluator(
    file: CaseFile, fixed: Sequence[str], names: Sequence[str], search: Search | None = None,
    *, plan: Plan | None = None, workers: int = 1, runs: int = 1, advance: ProgressCallback | None = None,
) -> Generator[Runs]:  # fmt: skip
    """Yield a function that evaluates variants of the file as it is now, with workers that end with the context."""
    evaluate = partial(evaluate_variants, fixed=tuple(fixed), names=tuple(names), search=search, runs=runs)
    with open_evaluator(make_bundle(file, plan, fixed), evaluate, workers=workers, advance=advance) as run:
        yield run


@contextmanager
def open_evaluator(
    source: Bundle, evaluate: Evaluate, *, workers: int = 1, advance: ProgressCallback | None = None
) -> Generator[Runs]:
    """Yield a function that distributes variants to workers, which end with the context."""
    with open_runner(SerialWorkers() if workers == 1 else ProcessWorkers(workers), source, evaluate) as run_chunks:

        def run(variants: Variants) -> Iterator[Row]:
            finished, count = dict[int, Row](), 0
            for chunk, rows in track_progress(run_chunks(divide_variants(variants, 1)), advance):
                finished[chunk.index] = rows[0]
                while count in finished:
                    yield finished.pop(count)
                    count += 1

        yield run


@dataclass(frozen=True, eq=False)
class LimitMap:
    """Speed limits over two numbers."""

    axes: tuple[Axis, Axis]  #: axes of the rows and of the columns
    #: speed by limit, such as ``loss_of_contact``, shape (rows, columns), of the crankshaft if the case gives
    #: ``crank_speed``, else of the camshaft; NaN if the limit is not met in the search range, or a run failed
    rpm: Mapping[str, FloatArray]
    statuses: tuple[Status, ...]  #: status of every variant, row by row

    def with_units(self, case: Case) -> LimitMap:
        """Return the same map with units for numbers given without one: those of the case."""
        units = [one.unit or find_unit(case.record, one.key.split(".")) or "" for one in self.axes]
        first, second = (replace(one, unit=unit) for one, unit in zip(self.axes, units, strict=True))
        return replace(self, axes=(first, second))


def grid_plan(first: Axis, second: Axis, fixed: Sequence[str] = ()) -> Plan:
    """Return the grid plan of two axes."""
    for one in (first, second):
        if not one.is_varied or not one.is_numeric:
            raise refuse(one.where, f"{len(one.values)} values", "several numbers", "the map needs a grid of values")
    if first.key == second.key:
        raise refuse("--and", second.key, "another key than that of --over", "the map needs two different values")
    pairs = [one.partition("=") for one in fixed]
    laid = [Axis(key.strip(), f"--set {key}={text}", (Value(text.strip(), None),)) for key, _, text in pairs]
    return make_plan([*laid, first, second])


def limit_map(plan: Plan, names: Sequence[str], runs: Runs) -> LimitMap:
    """Return the map of limits over a grid."""
    rows = list(runs(plan.variants))
    if all(row.status.cause is Cause.REFUSED for row in rows):
        require_complete(rows[0])
    first, second = plan.varied_axes
    rpm = {name: column(rows, f"limits.{name}").reshape(plan.shape) for name in names}
    return LimitMap((first, second), rpm, tuple(row.status for row in rows))


@contextmanager
def open_speed_runs(case: Case, search: Search, workers: int) -> Generator[SpeedRuns | None]:
    """Yield a function that begins runs of a case at several speeds of a search for limits; None for one worker."""
    if workers < 2:
        yield None
        return
    with open_processes(workers) as submit:

        def wait(future: Future[ConditionResults]) -> ConditionResults:
            try:
                return future.result()
            except BrokenProcessPool:
                raise RunFailedError(KILLED_STATUS) from None

        yield lambda speeds: [partial(wait, submit(evaluate_speed, case, search, None, speed)) for speed in speeds]
