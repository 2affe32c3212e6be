"""Variables of a study, and the evaluation of its points by a function that evaluates variants."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from flexcam.case.case import Case, find_unit
from flexcam.case.variants import get_number, make_overrides, number_after_override
from flexcam.core import FloatArray
from flexcam.core.errors import Fault, parse_all, refuse
from flexcam.core.units import DIMENSIONS, input_unit
from flexcam.dynamics import Cause, Status
from flexcam.studies.plan import Axis, Row, parse_axis

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
    read = partial(_variable, case, option)
    return tuple(parse_all(read, settings, lambda found: duplicate_key_faults(option, [v.key for v in found])))


def interval_widths(case: Case, variables: Sequence[Variable]) -> FloatArray:
    """Return the widths of the intervals in SI units, shape (k,)."""
    ends = [[number_after_override(case, v.key, v.text(x), "--vary") for x in (v.low, v.high)] for v in variables]
    return np.diff(np.array(ends).reshape(-1, 2)).ravel()


def duplicate_key_faults(option: str, keys: Sequence[str]) -> list[Fault]:
    """Return a fault for every key given more than once."""
    repeated = dict.fromkeys(key for key in keys if keys.count(key) > 1)
    return [Fault(option, repr(key), "every key once", "it is given twice", "") for key in repeated]


def _variable(case: Case, option: str, setting: str) -> Variable:
    where = f"{option} {setting}"
    key, _, spec = (part.strip() for part in setting.partition("="))
    number = get_number(case, key, where)  # raises an error for an unknown key
    if not spec:
        factor, unit = input_unit(number.unit.removeprefix("SI"))
        around = factor * number.value or 1.0
        low, high = sorted((0.9 * around, 1.1 * around))
        raise refuse(where, "no interval", f"{key}=LOW:HIGHunit, such as {key}={low:.4g}:{high:.4g}{unit}")
    ends = parse_axis(key, spec, where=where)
    low, *_, high = ends.values[0], ends.values[-1]
    if not ends.interval or low.number is None or high.number is None:
        raise refuse(where, repr(spec), "an interval such as 30:60 kN/m", "the search uses any value inside it")
    require_units(case, [ends])
    first, last = (number_after_override(case, key, end.text, where) for end in (low, high))
    start = (number.value - first) / (last - first) if last != first else None
    return Variable(key, low.number, high.number, ends.unit or number.unit.removeprefix("SI"), start)


def require_units(case: Case, axes: Iterable[Axis]) -> None:
    """Raise an error if the numbers of a varied axis lack the unit of their key."""
    for axis in axes:
        unit = find_unit(case.record, axis.key.split(".")) if axis.is_varied else None
        if unit and axis.is_numeric and not axis.unit:
            example = next((kind.example for kind in DIMENSIONS.values() if kind.si == unit), f"1 {unit}")
            given, allowed = "numbers without a unit", f"numbers with a unit, as in {example!r}"
            raise refuse(axis.where, given, allowed, "", "write the unit after the last number")


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

    def at(self, parts: FloatArray) -> FloatArray:
        """Return points in the units of the variables from fractions of their intervals, shape (m, k)."""
        return self.ends[0] + parts * (self.ends[1] - self.ends[0])

    @property
    def ends(self) -> FloatArray:
        """Lower and upper ends of the intervals, shape (2, k)."""
        return np.array([(v.low, v.high) for v in self.variables]).T

    def overrides(self, point: FloatArray) -> tuple[str, ...]:
        """Return the overrides at a point, shape (k,), with values in the units of the variables."""
        pairs = zip(self.variables, np.asarray(point).tolist(), strict=True)
        return make_overrides(self.case, {variable.key: variable.text(value) for variable, value in pairs})

    def rows(self, points: FloatArray) -> Iterator[Row]:
        """Yield the rows of points of shape (m, k) as soon as they are finished; equal points are evaluated once."""
        variants = [self.overrides(point) for point in np.asarray(points)]
        known: dict[tuple[str, ...], Row] = {}
        new = iter(self.runs(list(dict.fromkeys(variants))))
        for variant in variants:
            if variant not in known:
                known[variant] = next(new)
            yield known[variant]


def column(rows: Sequence[Row], name: str) -> FloatArray:
    """Return one quantity of several rows, shape (rows,)."""
    return np.array([row.scalars.get(name, np.nan) for row in rows], dtype=float)


_NOT_RUN = Row(Status(Cause.INTERRUPTED, "the study was stopped before its turn", "run the study again"))


class InterruptibleRuns:
    """Evaluates variants; after Ctrl-C the remaining variants have a row with the status of an interrupted run."""

    def __init__(self, runs: Runs) -> None:
        self._runs = runs
        self.done = self.asked = 0

    def __call__(self, variants: Sequence[tuple[str, ...]]) -> Iterator[Row]:
        """Yield a row per variant; Ctrl-C before the first row is raised, as there are no results to keep."""
        self.asked += len(variants)
        remaining = len(variants)
        try:
            for row in self._runs(variants):
                self.done += 1
                remaining -= 1
                yield row
        except KeyboardInterrupt:
            if not self.done:
                raise
        yield from [_NOT_RUN] * remaining

    @property
    def is_interrupted(self) -> bool:
        """Return whether some requested variants are not finished."""
        return self.done < self.asked

    @property
    def status(self) -> Status:
        """Status of the study."""
        if not self.is_interrupted:
            return Status()
        text = f"stopped after {self.done} of {self.asked} variants; the results are of these alone"
        return Status(Cause.INTERRUPTED, text, "the same command evaluates all of them")


@dataclass(frozen=True)
class WorstCase:
    """Worst result of a variant under several conditions, such as the speeds of a band."""

    conditions: tuple[tuple[str, ...], ...]  #: overrides of each condition
    largest: Mapping[str, bool]  #: whether the largest value of a quantity is the worst, otherwise the smallest

    def over(self, runs: Runs, derive: Runs | None = None) -> Runs:
        """Return a function that evaluates variants under all conditions and yields a row for each variant.

        `derive` evaluates the derivatives of variants; only the worst conditions need them.
        """

        def worst(variants: Sequence[tuple[str, ...]]) -> Iterator[Row]:
            rows = iter(runs([(*variant, *condition) for variant in variants for condition in self.conditions]))
            for variant in variants:
                group = [next(rows) for _ in self.conditions]
                if derive is not None and all(row.status.ok for row in group):
                    indices = sorted(set(self._worst_indices(group).values()))
                    derived = derive([(*variant, *self.conditions[i]) for i in indices])
                    for i, row in zip(indices, derived, strict=True):  # without derivatives the values still count
                        status = Status(text=row.status.text)
                        group[i] = replace(group[i], status=status, derivatives=row.derivatives, extremes=row.extremes)
                yield self.combine(group)

        return worst

    def combine(self, rows: Sequence[Row]) -> Row:
        """Return the worst values of several rows; a row that failed is the worst of all."""
        for row in rows:
            if not row.status.ok:
                return row
        worst = {name: rows[i] for name, i in self._worst_indices(rows).items()}
        status = next((row.status for row in rows if row.status.text), rows[0].status)
        derived = worst if all(row.derivatives for row in worst.values()) else ()
        return replace(
            rows[0], status=status, scalars={name: row.scalars[name] for name, row in worst.items()},
            derivatives={name: worst[name].derivatives[name] for name in derived},
            extremes={name: tuple(self._other_extremes(name, worst[name], rows)) for name in derived},
        )  # fmt: skip

    def _worst_indices(self, rows: Sequence[Row]) -> dict[str, int]:
        """Return the index of the worst row for each quantity; of several, one that another quantity has."""
        candidates = dict[str, list[int]]()
        for name in rows[0].scalars:
            values = column(rows, name) * (1.0 if self.largest.get(name, True) else -1.0)
            if all(name in row.scalars for row in rows):
                worst = np.isnan(values) if np.isnan(values).any() else values == values.max()
                candidates[name] = np.flatnonzero(worst).tolist()
        chosen = {tied[0] for tied in candidates.values() if len(tied) == 1}
        return {name: next((i for i in tied if i in chosen), tied[0]) for name, tied in candidates.items()}

    def _other_extremes(self, name: str, worst: Row, rows: Sequence[Row]) -> Iterator[tuple[float, ...]]:
        """Yield the other extremes of a quantity: those of the worst condition, and all of others with derivatives.

        Only a maximum that must be small, or a minimum that must be large, is bounded by its other extremes.
        """
        for row in rows:
            offset = row.scalars[name] - worst.scalars[name]
            if row is not worst and row.derivatives:
                yield (offset, *row.derivatives[name])
            for difference, *slopes in row.extremes.get(name, ()):
                if (difference < 0.0) == self.largest.get(name, True):
                    yield (offset + difference, *slopes)
