"""Objectives and constraints of an optimization."""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from flexcam.core import FloatArray
from flexcam.core.errors import InputError, parse_all, refuse
from flexcam.core.units import DIMENSIONS, RPM, parse
from flexcam.studies.evaluation import Row

_CONSTRAINT = re.compile(r"\s*([^<>=]+?)\s*(<=|>=)\s*([^<>=]+?)\s*$")
_FAILED_VIOLATION = 1e6
"""Violation of every constraint if a variant has no value: larger than any regular one."""

_UNIT_NAMES = {"1": "", "Hz": "1/s"}
"""Units of scalars and the corresponding units of dimensions."""

_ROUNDING = 1e-9
"""Tolerance of a bound for rounding, relative to the bound."""

_ACTIVE_TOLERANCE = 0.01
"""Distance from a bound, relative to the bound, within which a constraint is active."""


@dataclass(frozen=True)
class Goal:
    """Quantity to be minimized or maximized.

    Parameters
    ----------
    name
        Name of the quantity (`flexcam.studies.quantities`), or a key of the case.
    most
        Whether to maximize it.
    """

    name: str
    most: bool = False

    @property
    def words(self) -> str:
        """Description, such as ``least springs.valve.force.largest``."""
        return f"{'most' if self.most else 'least'} {self.name}"


@dataclass(frozen=True)
class Constraint:
    """Bound of a quantity.

    Parameters
    ----------
    name
        Name of the quantity.
    relation
        Whether the bound is an upper or a lower limit.
    text
        Bound as given; a number without unit is in the unit of the quantity.
    """

    name: str
    relation: Literal["<=", ">="]
    text: str

    @property
    def words(self) -> str:
        """Text of the constraint as given."""
        return f"{self.name} {self.relation} {self.text}"

    def bound(self, unit: str) -> float:
        """Return the bound in the unit of its quantity."""
        values = _bound_by_unit(self.text)
        if unit.endswith("rpm") and "rad/s" in values:
            return values["rad/s"] / RPM
        if "bare" in values:
            return values["bare"]
        wanted = _UNIT_NAMES.get(unit, unit)
        if wanted not in values:
            raise refuse("--subject", self.words, f"a bound in {unit or 'no unit'}, or a bare number", "units differ")
        return values[wanted]

    def violation(self, value: float, unit: str) -> float:
        """Return the violation of the bound by a value, relative to the bound; negative if it is satisfied."""
        bound = self.bound(unit)
        size = abs(bound) or 1.0
        return (value - bound if self.relation == "<=" else bound - value) / size


def parse_constraint(text: str) -> Constraint:
    """Parse a constraint."""
    found = _CONSTRAINT.match(text)
    if found is None:
        raise refuse(
            "--subject", repr(text), "NAME <= VALUE or NAME >= VALUE, in quotes", "", "such as 'frequency.1 >= 900 Hz'"
        )
    _bound_by_unit(found[3], text)
    return Constraint(found[1], "<=" if found[2] == "<=" else ">=", found[3])


def parse_constraints(texts: Sequence[str]) -> tuple[Constraint, ...]:
    """Parse several constraints."""
    found, faults = parse_all(parse_constraint, texts)
    if faults:
        raise InputError(faults)
    return tuple(found)


def _bound_by_unit(text: str, where: str = "") -> dict[str, float]:
    """Return the bound in every possible SI unit; ``bare`` for a number without unit."""
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


def row_value(row: Row, name: str) -> float:
    """Return a quantity of a row; infinite for a limit that is not met, otherwise NaN if missing."""
    missing = math.inf if name.startswith("limits.") and row.status.ok else math.nan
    return row.scalars.get(name, missing)


def compute_costs(rows: Sequence[Row], goals: Sequence[Goal]) -> FloatArray:
    """Return the quantities to be minimized, shape (variants, goals)."""
    values = np.array([[row_value(row, goal.name) for goal in goals] for row in rows], dtype=float)
    signed = values * np.array([-1.0 if goal.most else 1.0 for goal in goals])
    return np.where(np.isnan(signed), math.inf, signed)


def compute_violations(rows: Sequence[Row], bounds: Sequence[Constraint], goals: Sequence[Goal]) -> FloatArray:
    """Return the relative violations of the constraints, shape (variants, bounds + 1)."""
    found = np.full((len(rows), len(bounds) + 1), _FAILED_VIOLATION)
    for i, row in enumerate(rows):
        values = [row_value(row, one.name) for one in bounds]
        if row.status.ok and not any(math.isnan(x) for x in [*values, *(row_value(row, one.name) for one in goals)]):
            units = [row.units.get(one.name, "rpm") for one in bounds]
            pairs = zip(bounds, values, units, strict=True)
            found[i] = [*(min(one.violation(value, unit), _FAILED_VIOLATION) for one, value, unit in pairs), 0.0]
    return np.maximum(found, -_FAILED_VIOLATION)


def is_feasible(passed: FloatArray) -> NDArray[np.bool_]:
    """Return which variants satisfy all constraints."""
    return np.asarray((passed <= _ROUNDING).all(axis=1))


def is_active(passed: float) -> bool:
    """Return whether a constraint is active: the value is within a hundredth of the bound."""
    return passed >= -_ACTIVE_TOLERANCE
