"""Points of a study: numbers of a case varied within intervals, each point evaluated once."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from flexcam.case import Case, CaseFile, read_case
from flexcam.checks import Fault, InputError, gathered, refuse
from flexcam.limits import Search
from flexcam.linalg import FloatArray
from flexcam.response import Advance, counted
from flexcam.study.keys import number_of, overrides_of
from flexcam.study.quantities import quantities
from flexcam.sweep import Row, axis
from flexcam.sweep.evaluate import refused

_DIGITS = 15


@dataclass(frozen=True)
class Variable:
    """A number of a case that a study varies.

    Parameters
    ----------
    key
        Of the case.
    low, high
        Its ends, in its unit.
    unit
        As written, else that of SI; empty for a plain number.
    stands
        Where the case stands, as a part of the interval; None where that is not known.
    """

    key: str
    low: float
    high: float
    unit: str = ""
    stands: float | None = None

    def text(self, value: float) -> str:
        """Return the value as it is laid over a case."""
        return f"{value:.{_DIGITS}g}{self.unit}"


def variables_of(case: Case, settings: Sequence[str], option: str) -> tuple[Variable, ...]:
    """Return the variables of several ``KEY=LOW:HIGHunit``."""
    found, faults = gathered(lambda setting: _variable(case, setting, f"{option} {setting}"), settings)
    faults += given_twice(option, [one.key for one in found])
    if faults:
        raise InputError(faults)
    return tuple(found)


def given_twice(option: str, keys: Sequence[str]) -> list[Fault]:
    """Return a fault for every key that stands more than once: a variant has one value of it."""
    twice = dict.fromkeys(key for key in keys if keys.count(key) > 1)
    return [Fault(option, repr(key), "every key once", "it is given twice", "") for key in twice]


def _variable(case: Case, setting: str, where: str) -> Variable:
    key, _, spec = (part.strip() for part in setting.partition("="))
    number = number_of(case, key, where)  # or there is no such key
    if not spec:
        raise refuse(where, "no interval", f"{key}=LOW:HIGHunit, such as {key}=0.9:1.1{number.unit.removeprefix('SI')}")
    ends = axis(key, spec, where=where)
    low, *_, high = ends.values[0], ends.values[-1]
    if not ends.interval or low.number is None or high.number is None:
        raise refuse(where, repr(spec), "an interval such as 30:60 kN/m", "anything between may be taken")
    first, last = (number_at(case, key, end.text, where) for end in (low, high))
    stands = (number.value - first) / (last - first) if last != first else None
    return Variable(key, low.number, high.number, ends.unit or number.unit.removeprefix("SI"), stands)


def number_at(case: Case, key: str, text: str, where: str) -> float:
    """Return the number that a case has with a text in its place."""
    try:
        there = read_case(case.path, (*case.overrides, *overrides_of(case, {key: text})))
    except InputError as refusal:
        raise InputError(replace(fault, where=where) for fault in refusal.faults) from None
    return number_of(there, key, where).value


Runs = Callable[[Sequence[tuple[str, ...]]], Iterator[Row]]
"""Evaluates variants, given by the values laid over a case: one after the other, or on many processors. Rows come in
the order of the variants, each once it is finished, so that a study that is stopped keeps those it has."""


@dataclass(frozen=True, eq=False)
class Points:
    """What a study evaluates: points of its variables, each once.

    Parameters
    ----------
    case
        The case as it stands.
    variables
        What is varied.
    runs
        Evaluates variants.
    """

    case: Case
    variables: tuple[Variable, ...]
    runs: Runs
    _known: dict[tuple[str, ...], Row] = field(default_factory=dict[tuple[str, ...], Row], init=False)

    def overrides(self, point: FloatArray) -> tuple[str, ...]:
        """Return what is laid over the case at a point, shape (k,), each value in the unit of its variable."""
        pairs = zip(self.variables, np.asarray(point).tolist(), strict=True)
        return overrides_of(self.case, {one.key: one.text(value) for one, value in pairs})

    def rows(self, points: FloatArray) -> list[Row]:
        """Return the rows of some points, shape (m, k)."""
        asked = [self.overrides(point) for point in np.asarray(points)]
        new = list(dict.fromkeys(one for one in asked if one not in self._known))
        for one, row in zip(new, self.runs(new) if new else (), strict=True):
            self._known[one] = row
        return [self._known[one] for one in asked]

    def knows(self, point: FloatArray) -> bool:
        """Tell whether a point, shape (k,), has been evaluated."""
        return self.overrides(point) in self._known

    @property
    def evaluated(self) -> int:
        """How many points have been evaluated so far."""
        return len(self._known)


def serial(
    file: CaseFile, fixed: Sequence[str], names: Sequence[str], search: Search | None = None,
    *, runs: int = 1, advance: Advance | None = None,
) -> Runs:  # fmt: skip
    """Return what evaluates variants one after the other."""

    def run(variants: Sequence[tuple[str, ...]]) -> Iterator[Row]:
        for one in counted(variants, advance):
            yield variant_row(file, (*fixed, *one), names, search, runs)

    return run


def variant_row(
    file: CaseFile, overrides: Sequence[str], names: Sequence[str], search: Search | None = None, runs: int = 1
) -> Row:
    """Return what is asked of one variant of a case."""
    try:
        case = file.read(overrides)
    except InputError as refusal:
        return refused(refusal)
    return quantities(case, names, search, runs)


def column(rows: Sequence[Row], name: str) -> FloatArray:
    """Return one quantity of several rows."""
    return np.array([row.scalars.get(name, np.nan) for row in rows], dtype=float)
