"""The unit of a number of a case where it depends on what else stands there: its table is asked.

A spring's stiffness is N/m along a line and N m/rad about an axis; a lift is m, or rad where the follower swings. The
table around the number is read again with the same number in one unit after the other: it takes only its own.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import cast

from pydantic import BaseModel, ValidationError

from flexcam.case.records import CaseRecord
from flexcam.case.report import si_unit
from flexcam.checks import InputError
from flexcam.units import DIMENSIONS


def own_unit(record: CaseRecord, path: Sequence[str]) -> str | None:
    """Return the SI unit of a number of a case."""
    known = si_unit(tuple(path))
    if known is not None:
        return known
    table, rest = _around(record, path)
    # Moments may leave the radian out, so a stiffness about an axis is looked for among stiffnesses first.
    kinds = sorted(DIMENSIONS.values(), key=lambda kind: path[-1] not in kind.name)
    units = [*(kind.si for kind in kinds if kind.si), ""]
    return next((unit for unit in units if _takes(table, rest, unit)), None)


def _around(record: BaseModel, path: Sequence[str]) -> tuple[BaseModel, Sequence[str]]:
    """Return the innermost table around a key, and the rest of the way to it."""
    found, value = (record, path), cast("object", record)
    for i, step in enumerate(path):
        if isinstance(value, BaseModel):
            found = value, path[i:]
            names = {field.alias or name: name for name, field in type(value).model_fields.items()}
            value = getattr(value, names.get(step, step), None)
        elif isinstance(value, dict):
            value = cast("dict[str, object]", value).get(step)
    return found


def _takes(table: BaseModel, path: Sequence[str], unit: str) -> bool:
    """Tell whether a table is the same with a number in a unit."""
    try:
        given = _with_unit(table.model_dump(mode="json", by_alias=True), path, unit)
        return type(table).model_validate(given) == table
    except (ValidationError, InputError, KeyError, IndexError):
        return False


def _with_unit(value: object, path: Sequence[str], unit: str) -> object:
    """Return what stands in a file, with a unit behind the number at the end of a path."""
    if not path:
        return f"{value!r} {unit}" if unit else value
    step, *rest = path
    if isinstance(value, list):
        row = [*cast("list[object]", value)]
        row[int(step)] = _with_unit(row[int(step)], rest, unit)
        return row
    named = cast("dict[str, object]", value)
    return {**named, step: _with_unit(named[step], rest, unit)}
