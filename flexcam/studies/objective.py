"""What a design is to be: the least or most of something, subject to bounds."""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from flexcam.core import FloatArray
from flexcam.core.errors import InputError, gathered, refuse
from flexcam.core.units import DIMENSIONS, RPM, parse
from flexcam.studies.evaluation import Row

_CONSTRAINT = re.compile(r"\s*([^<>=]+?)\s*(<=|>=)\s*([^<>=]+?)\s*$")
_FAILED = 1e6
"""Violation of every bound where there is no number: worse than any that has one."""

_SAME = {"1": "", "Hz": "1/s"}
"""Units as scalars and dimensions call them."""

_ROUNDING = 1e-9
"""Part of a bound by which a value may miss it."""

_ACTIVE = 0.01
"""Part of a bound within which a value lies at it."""


@dataclass(frozen=True)
class Goal:
    """Something that is to be as small or as large as can be.

    Parameters
    ----------
    name
        Of the quantity (`flexcam.studies.quantities`), or a key of the case.
    most
        Whether it is to be large.
    """

    name: str
    most: bool = False

    @property
    def words(self) -> str:
        """Such as ``least springs.valve.force.largest``."""
        return f"{'most' if self.most else 'least'} {self.name}"


@dataclass(frozen=True)
class Constraint:
    """A bound of something.

    Parameters
    ----------
    name
        Of the quantity.
    relation
        Whether the bound is the largest or the least value allowed.
    text
        The bound as written; a bare number is in the quantity's own unit.
    """

    name: str
    relation: Literal["<=", ">="]
    text: str

    @property
    def words(self) -> str:
        """As it was written."""
        return f"{self.name} {self.relation} {self.text}"

    def bound(self, unit: str) -> float:
        """Return the bound in the unit of its quantity."""
        values = _by_unit(self.text)
        if unit.endswith("rpm") and "rad/s" in values:
            return values["rad/s"] / RPM
        if "bare" in values:
            return values["bare"]
        wanted = _SAME.get(unit, unit)
        if wanted not in values:
            raise refuse("--subject", self.words, f"a bound in {unit or 'no unit'}, or a bare number", "units differ")
        return values[wanted]

    def violation(self, value: float, unit: str) -> float:
        """Return by how much a value passes the bound, as a part of it; below zero inside."""
        bound = self.bound(unit)
        size = abs(bound) or 1.0
        return (value - bound if self.relation == "<=" else bound - value) / size


def constraint(text: str) -> Constraint:
    """Return the constraint of a text."""
    found = _CONSTRAINT.match(text)
    if found is None:
        raise refuse(
            "--subject", repr(text), "NAME <= VALUE or NAME >= VALUE, in quotes", "", "such as 'frequency.1 >= 900 Hz'"
        )
    _by_unit(found[3], text)
    return Constraint(found[1], "<=" if found[2] == "<=" else ">=", found[3])


def constraints_of(texts: Sequence[str]) -> tuple[Constraint, ...]:
    """Return the constraints of several texts."""
    found, faults = gathered(constraint, texts)
    if faults:
        raise InputError(faults)
    return tuple(found)


def _by_unit(text: str, where: str = "") -> dict[str, float]:
    """Return what a bound is in every SI unit it may have; ``bare`` for a number without."""
    try:
        return {"bare": float(text)}
    except ValueError:
        pass
    found: dict[str, float] = {}
    for name, kind in DIMENSIONS.items():
        try:
            found[kind.si] = parse(text, name)
        except InputError:
            continue
    if not found:
        raise refuse("--subject", repr(where or text), "NAME <= a number with a unit", "this is no quantity")
    return found


def value_of(row: Row, name: str) -> float:
    """Return a quantity of a row; a limit that is not met lies beyond every speed, other gaps are NaN."""
    missing = math.inf if name.startswith("limits.") and row.status.ok else math.nan
    return row.scalars.get(name, missing)


def costs(rows: Sequence[Row], goals: Sequence[Goal]) -> FloatArray:
    """Return what is to be small of several variants."""
    values = np.array([[value_of(row, goal.name) for goal in goals] for row in rows], dtype=float)
    signed = values * np.array([-1.0 if goal.most else 1.0 for goal in goals])
    return np.where(np.isnan(signed), math.inf, signed)


def violations(rows: Sequence[Row], bounds: Sequence[Constraint], goals: Sequence[Goal]) -> FloatArray:
    """Return by how much variants pass bounds, as parts of them."""
    found = np.full((len(rows), len(bounds) + 1), _FAILED)
    for i, row in enumerate(rows):
        values = [value_of(row, one.name) for one in bounds]
        if row.status.ok and not any(math.isnan(x) for x in [*values, *(value_of(row, one.name) for one in goals)]):
            units = [row.units.get(one.name, "rpm") for one in bounds]
            pairs = zip(bounds, values, units, strict=True)
            found[i] = [*(min(one.violation(value, unit), _FAILED) for one, value, unit in pairs), 0.0]
    return np.maximum(found, -_FAILED)


def feasible(passed: FloatArray) -> NDArray[np.bool_]:
    """Return which variants are within all bounds."""
    return np.asarray((passed <= _ROUNDING).all(axis=1))


def active(passed: float) -> bool:
    """Tell whether a bound decides: a value lies at it within a hundredth."""
    return passed >= -_ACTIVE
