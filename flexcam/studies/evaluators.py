"""Evaluation of the variants of a study: its variables, its points, and maps of limits over two numbers."""

from __future__ import annotations

import os
import re
import tomllib
from collections.abc import Callable, Generator, Iterable, Iterator, Mapping, Sequence
from concurrent.futures import Future
from contextlib import contextmanager, suppress
from dataclasses import dataclass, replace
from functools import partial, reduce
from operator import getitem
from pathlib import Path
from typing import Any, cast

import numpy as np

from flexcam.analysis.limits import ConditionResults, Search, SpeedRuns, evaluate_speed
from flexcam.case.case import Case
from flexcam.case.reader import CaseFile, case_tables
from flexcam.case.records import find_unit
from flexcam.core import FloatArray
from flexcam.core.errors import Fault, InputError, parse_all, refuse
from flexcam.core.units import DIMENSIONS
from flexcam.dynamics import Cause, ProgressCallback, RunFailedError, Status, track_progress
from flexcam.io import find_referenced_file, format_toml
from flexcam.studies.evaluation import Row, rejected_row, restore_file_names
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
from flexcam.studies.plan import Axis, Bundle, Plan, Value, make_bundle, make_plan, open_case, parse_axis
from flexcam.studies.quantities import get_number, make_overrides, quantity_row, require_complete

_DIGITS = 15


@dataclass(frozen=True)
class Variable:
    """Number of a case varied by a study."""

    key: str  #: key of the case
    low: float  #: limits in its unit
    high: float
    unit: str = ""  #: unit as given, else the SI unit; empty for a dimensionless number
    start: float | None = None  #: value of the case as a fraction of the interval; None if not known

    def text(self, value: float) -> str:
        """Return a value as text for an override."""
        return f"{value:.{_DIGITS}g}{self.unit}"


def variables_of(case: Case, settings: Sequence[str], option: str) -> tuple[Variable, ...]:
    """Return the variables of ``KEY=LOW:HIGHunit`` texts."""
    found, faults = parse_all(lambda setting: _variable(case, setting, f"{option} {setting}"), settings)
    faults += duplicate_key_faults(option, [one.key for one in found])
    if faults:
        raise InputError(faults)
    return tuple(found)


def duplicate_key_faults(option: str, keys: Sequence[str]) -> list[Fault]:
    """Return a fault for every key given more than once."""
    twice = dict.fromkeys(key for key in keys if keys.count(key) > 1)
    return [Fault(option, repr(key), "every key once", "it is given twice", "") for key in twice]


def _variable(case: Case, setting: str, where: str) -> Variable:
    key, _, spec = (part.strip() for part in setting.partition("="))
    number = get_number(case, key, where)  # raises an error for an unknown key
    if not spec:
        raise refuse(where, "no interval", f"{key}=LOW:HIGHunit, such as {key}=0.9:1.1{number.unit.removeprefix('SI')}")
    ends = parse_axis(key, spec, where=where)
    low, *_, high = ends.values[0], ends.values[-1]
    if not ends.interval or low.number is None or high.number is None:
        raise refuse(where, repr(spec), "an interval such as 30:60 kN/m", "the search takes any value inside it")
    require_unit(case, ends)
    first, last = (number_after_override(case, key, end.text, where) for end in (low, high))
    start = (number.value - first) / (last - first) if last != first else None
    return Variable(key, low.number, high.number, ends.unit or number.unit.removeprefix("SI"), start)


def require_unit(case: Case, axis: Axis) -> None:
    """Raise an error if the numbers of an axis lack the unit of their key."""
    unit = find_unit(case.record, axis.key.split("."))
    if unit and axis.is_numeric and not axis.unit:
        example = next((kind.example for kind in DIMENSIONS.values() if kind.si == unit), f"1 {unit}")
        given, allowed = "numbers without a unit", f"numbers with a unit, such as that of {example!r}"
        raise refuse(axis.where, given, allowed, "", "write the unit after the last number")


def require_units(case: Case, axes: Iterable[Axis]) -> None:
    """Raise an error if the numbers of a varied axis lack the unit of their key."""
    for one in axes:
        if one.is_varied:
            require_unit(case, one)


def number_after_override(case: Case, key: str, text: str, where: str) -> float:
    """Return the number of a case after replacing it by a text."""
    try:
        there = CaseFile.of(case).read((*case.overrides, *make_overrides(case, {key: text})))
    except InputError as refusal:
        raise InputError(replace(fault, where=where) for fault in refusal.faults) from None
    return get_number(there, key, where).value


Runs = Callable[[Sequence[tuple[str, ...]]], Iterator[Row]]
"""Function that evaluates variants given by their overrides, serially or in parallel. It yields rows in the order of
the variants as soon as they are finished, so that an interrupted study keeps the finished ones.
"""


@dataclass(frozen=True, eq=False)
class PointEvaluator:
    """Evaluates points of the variables of a study."""

    case: Case  #: unchanged case
    variables: tuple[Variable, ...]  #: variables of the study
    runs: Runs  #: function that evaluates variants

    def overrides(self, point: FloatArray) -> tuple[str, ...]:
        """Return the overrides at a point, shape (k,), with values in the units of the variables."""
        pairs = zip(self.variables, np.asarray(point).tolist(), strict=True)
        return make_overrides(self.case, {one.key: one.text(value) for one, value in pairs})

    def iterate_rows(self, points: FloatArray) -> Iterator[Row]:
        """Yield the rows of points of shape (m, k) as soon as they are finished; equal points are evaluated once."""
        variants = [self.overrides(point) for point in np.asarray(points)]
        known: dict[tuple[str, ...], Row] = {}
        new = iter(self.runs(list(dict.fromkeys(variants))))
        for variant in variants:
            if variant not in known:
                known[variant] = next(new)
            yield known[variant]

    def rows(self, points: FloatArray) -> list[Row]:
        """Return the rows of points of shape (m, k)."""
        return list(self.iterate_rows(points))


def evaluate_variant(
    file: CaseFile, overrides: Sequence[str], names: Sequence[str], search: Search | None = None, runs: int = 1
) -> Row:
    """Return the row of one variant of a case."""
    try:
        case = file.read(overrides)
    except InputError as refusal:
        return rejected_row(refusal)
    return quantity_row(case, names, search, runs)


def column(rows: Sequence[Row], name: str) -> FloatArray:
    """Return one quantity of several rows, shape (rows,)."""
    return np.array([row.scalars.get(name, np.nan) for row in rows], dtype=float)


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


_NOT_RUN = Row(Status(Cause.INTERRUPTED, "the study was stopped before its turn", "run the study again"))


class InterruptibleRuns:
    """Evaluates variants; after Ctrl-C the remaining variants have a row with the status of an interrupted run."""

    def __init__(self, runs: Runs) -> None:
        self._runs = runs
        self.done = self.asked = 0

    def __call__(self, variants: Sequence[tuple[str, ...]]) -> Iterator[Row]:
        """Yield a row per variant; Ctrl-C before the first row is raised, as there are no results to keep."""
        self.asked += len(variants)
        left = len(variants)
        try:
            for row in self._runs(variants):
                self.done += 1
                left -= 1
                yield row
        except KeyboardInterrupt:
            if not self.done:
                raise
        yield from [_NOT_RUN] * left

    @property
    def is_interrupted(self) -> bool:
        """Return whether some requested variants are not finished."""
        return self.done < self.asked

    @property
    def status(self) -> Status:
        """Status of the study."""
        if not self.is_interrupted:
            return Status()
        text = f"stopped by the user after {self.done} of {self.asked} variants; the results are of these alone"
        return Status(Cause.INTERRUPTED, text, "the same command evaluates all of them")


@dataclass(frozen=True)
class WorstCase:
    """Worst result of a variant under several conditions, such as the speeds of a band."""

    conditions: tuple[tuple[str, ...], ...]  #: overrides of each condition
    largest: Mapping[str, bool]  #: whether the largest value of a quantity is the worst, otherwise the smallest

    def over(self, runs: Runs) -> Runs:
        """Return a function that evaluates variants under all conditions and yields a row for each variant."""

        def worst(variants: Sequence[tuple[str, ...]]) -> Iterator[Row]:
            rows = iter(runs([(*variant, *one) for variant in variants for one in self.conditions]))
            for _ in variants:
                yield self.combine([next(rows) for _ in self.conditions])

        return worst

    def combine(self, rows: Sequence[Row]) -> Row:
        """Return the worst values of several rows; a row that failed is the worst of all."""
        for row in rows:
            if not row.status.ok:
                return row
        return replace(rows[0], scalars={
            name: rows[self.worst(name, [row.scalars.get(name, np.nan) for row in rows])].scalars[name]
            for name in rows[0].scalars
            if all(name in row.scalars for row in rows)
        })  # fmt: skip

    def worst(self, name: str, values: Sequence[float]) -> int:
        """Return the position of the worst of the values of a quantity, the first missing one if there is any."""
        array = np.array(values)
        return int(np.argmax(array) if self.largest.get(name, True) else np.argmin(array))


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


def case_text(case: Case, target: Path, comments: Sequence[str] = ()) -> str:
    """Return a case with its overrides as TOML for another folder, with the comments of the case file."""
    record = cast("dict[str, Any]", _relocate_file_names(case_tables(case), case.path, target.parent))
    head = "".join(f"# {line}\n" for line in comments)
    return head + (_edit_text(case.text, record) or format_toml(record))


_VALUE = r"""("[^"\n]*"|'[^'\n]*'|\[[^\]\n]*\]|[^\s,#"'\[\]{}]+)"""
"""Value on one line in a TOML file."""


def _edit_text(text: str, wanted: Mapping[str, Any]) -> str | None:
    """Return the text of a case with given tables, edited by value; None if this needs more than single values."""
    left = list(_changed_keys(tomllib.loads(text), wanted))
    while left:
        keys, left = left[0], left[1:]
        value = reduce(getitem, keys, cast("Any", wanted)) if keys else None
        texts = () if value is None or isinstance(value, dict) else _edits(text, keys[-1], value)
        found = next((one for one in texts if list(_changed_keys(tomllib.loads(one), wanted)) == left), None)
        if found is None:
            return None
        text = found
    return text


def _changed_keys(old: Mapping[str, Any], new: Mapping[str, Any]) -> Iterator[tuple[str, ...]]:
    """Yield the paths of changed and new values; an empty one for a removed value."""
    for key in {**old, **new}:
        if key not in new:
            yield ()
        elif isinstance(old.get(key), dict) and isinstance(new[key], dict):
            yield from ((key, *inner) if inner else () for inner in _changed_keys(old[key], new[key]))
        elif key not in old or old[key] != new[key]:
            yield (key,)


def _edits(text: str, key: str, value: object) -> Iterator[str]:
    """Yield valid texts with one value of a key replaced, then with the key added to a table."""
    entry = format_toml({key: value}).strip()
    name, _, new = entry.partition(" = ")
    values = re.finditer(rf"(?:^|[\s{{,.]){re.escape(name)}\s*=\s*{_VALUE}", text, re.MULTILINE)
    heads = re.finditer(r"^\[[^\n]*\n", text, re.MULTILINE)
    changes = [(*one.span(1), new) for one in values] + [(one.end(), one.end(), entry + "\n") for one in heads]
    for start, end, inserted in changes:
        edited = text[:start] + inserted + text[end:]
        with suppress(ValueError):  # a table that already has the key
            tomllib.loads(edited)
            yield edited


def _relocate_file_names(value: object, case: Path, new: Path) -> object:
    """Adapt the relative file names in raw tables to another folder."""
    if isinstance(value, dict):
        return {name: _relocate_file_names(one, case, new) for name, one in cast("dict[str, object]", value).items()}
    if isinstance(value, list):
        return [_relocate_file_names(one, case, new) for one in cast("list[object]", value)]
    if isinstance(value, str) and Path(value).suffix and not os.path.isabs(value):
        old = find_referenced_file(case, value)
        return value if old is None else Path(os.path.relpath(old, new)).as_posix()
    return value
