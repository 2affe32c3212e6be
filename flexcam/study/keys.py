"""Numbers of a case by their key, and variants of the case with others in their place."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any, cast

from flexcam.case import Case
from flexcam.case.own_unit import own_unit
from flexcam.checks import did_you_mean, refuse


@dataclass(frozen=True)
class Number:
    """A number of a case.

    Parameters
    ----------
    key
        Such as ``springs.valve.stiffness``; of a number in a list with its position: ``rockers.rocker.arms.1``.
    value
        SI.
    unit
        SI unit; empty for a plain number, ``SI`` where it cannot be told.
    """

    key: str
    value: float
    unit: str


def number_of(case: Case, key: str, where: str) -> Number:
    """Return a number of a case."""
    known = dict(_leaves(case.record.model_dump(mode="json", by_alias=True), ""))
    numbers = [name for name, value in known.items() if isinstance(value, float)]
    if key not in known:
        near = did_you_mean(key, numbers) or did_you_mean(
            key.rpartition(".")[2], [n.rpartition(".")[2] for n in numbers]
        )
        allowed = f"the key of a number of the case, such as {', '.join(numbers[:6])}"
        raise refuse(where, repr(key), allowed, "there is no such key", near or "flexcam check --echo prints them all")
    value = known[key]
    if not isinstance(value, float):
        given = f"{key} = {value!r}" if value is not None else f"{key}, which is not given"
        why = "only a number that may be a little larger can be varied"
        raise refuse(
            where, given, "the key of a number with a fraction", why, "give it a number" if value is None else ""
        )
    unit = own_unit(case.record, key.split("."))
    return Number(key, value, "SI" if unit is None else unit)


def _leaves(value: object, path: str) -> Iterator[tuple[str, object]]:
    """Yield what stands in nested tables and lists, by its dotted key."""
    if isinstance(value, dict):
        inner = cast("dict[str, object]", value)
    elif isinstance(value, list):
        inner = {str(i): one for i, one in enumerate(cast("list[object]", value))}
    else:
        yield path, value
        return
    for name, one in inner.items():
        yield from _leaves(one, f"{path}.{name}" if path else name)


def overrides_of(case: Case, values: Mapping[str, str]) -> tuple[str, ...]:
    """Return the overrides that put values into a case; a list is written as a whole, with its other numbers."""
    record = case.record.model_dump(mode="json", by_alias=True)
    lists: dict[str, list[Any]] = {}
    found: dict[str, str] = {}
    for key, text in values.items():
        parent, _, last = key.rpartition(".")
        if not (last.isdigit() and isinstance(there := _at(record, parent), list)):
            found[key] = text
            continue
        changed = lists.setdefault(parent, [*cast("list[Any]", there)])
        changed[int(last)] = _number_or_text(text)
        found[parent] = json.dumps(changed, ensure_ascii=False)
    return tuple(f"{key}={text}" for key, text in found.items())


def _at(record: Mapping[str, Any], path: str) -> object:
    value: object = record
    for step in path.split("."):
        value = cast("dict[str, object]", value).get(step) if isinstance(value, dict) else None
    return value


def _number_or_text(text: str) -> float | str:
    try:
        return float(text)
    except ValueError:
        return text
