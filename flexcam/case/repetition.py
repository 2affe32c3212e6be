"""Copies of a valve train: parts whose names contain a mark such as ``{cylinder}``.

A mark in the name of a part repeats the part for every name in `[repeat.cylinder]`. In a list of names, consecutive
names with a mark are repeated together: ``["front", "bearing-{cylinder}", "lobe-{cylinder}"]`` becomes the front, then
the bearing and the lobe of each cylinder.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import groupby
from math import tau
from operator import methodcaller
from typing import Any, cast

from flexcam.case.fault_report import KeyLocations, Path
from flexcam.case.schema.parts import RepeatRecord
from flexcam.core.errors import Fault, InputError
from flexcam.core.units import parse

_MARK = re.compile(r"\{([^{}]*)\}")

# Cam angles of a part, and of the timing of a cam, which the phase of a copy delays.
_ANGLES = {"cams": ("phase", "centreline", "tdc"), "loads": ("phase",)}
_TIMING_ANGLES = ("opening", "closing", "centre")


def name_pattern(key: str) -> re.Pattern[str]:
    """Return the pattern of the keys that a key with marks stands for."""
    return re.compile("[^.]+".join(re.escape(part) for part in _MARK.split(key)[::2]))


@dataclass(frozen=True)
class Repetition:
    """Tables of a case with all copies."""

    tables: dict[str, Any]  #: raw tables without `repeat`
    repeats: Mapping[str, RepeatRecord]  #: copies by mark
    templates: dict[Path, Path] = field(default_factory=dict[Path, Path])  #: template by path of a part: table and name

    @classmethod
    def of(cls, raw: Mapping[str, Any], repeats: Mapping[str, RepeatRecord]) -> Repetition:
        """Return the tables of a case with all copies of its parts."""
        tables = {name: table for name, table in raw.items() if name != "repeat"}
        repetition = cls(tables, repeats)
        for kind, table in tables.items():
            if isinstance(table, dict):
                tables[kind] = dict[str, Any]()
                for name, part in cast("dict[str, Any]", table).items():
                    for new_name, value in repetition._copies(kind, name, part):
                        tables[kind][new_name] = repetition._expand_lists(value)
                        if new_name != name:
                            repetition.templates[kind, new_name] = (kind, name)
        return repetition

    def faults(self, places: KeyLocations) -> Iterator[Fault]:
        """Yield the marks that no part has in its name."""
        used = {mark for template in self.templates.values() for mark in _MARK.findall(template[-1])}
        for mark in self.repeats:
            if mark not in used:
                allowed = f'a part with {{{mark}}} in its name, such as "valve-{{{mark}}}"'
                yield Fault(places.place(("repeat", mark)), "no such part", allowed, "nothing is repeated", "")

    def _copies(self, kind: str, name: str, part: object) -> Iterator[tuple[str, object]]:
        mark = next((mark for mark in self.repeats if f"{{{mark}}}" in name), None)
        if mark is None:
            yield name, part
            return
        for copy, offset, phase in self.repeats[mark].copies():
            shifted = _shift(kind, map_texts(part, methodcaller("replace", f"{{{mark}}}", copy)), offset, phase)
            yield from self._copies(kind, name.replace(f"{{{mark}}}", copy), shifted)

    def _expand_lists(self, value: object) -> object:
        """Return a value with the marks in its lists of names expanded."""
        if isinstance(value, dict):
            return {name: self._expand_lists(item) for name, item in cast("dict[str, object]", value).items()}
        if isinstance(value, list):
            names = cast("list[object]", value)
            return self._expand_names(names) if all(isinstance(name, str) for name in names) else names
        return value

    def _expand_names(self, names: list[Any], marks: tuple[str, ...] | None = None) -> list[Any]:
        """Return names with every run of names that share a mark repeated; the first mark is outermost."""
        if not (remaining := tuple(self.repeats) if marks is None else marks):
            return names
        mark, *inner = remaining
        result: list[Any] = []
        for marked, run in groupby(names, lambda name: f"{{{mark}}}" in name):
            group = list(run)
            for copy in self.repeats[mark].copy_names if marked else ("",):
                copies = [name.replace(f"{{{mark}}}", copy) for name in group]
                result += self._expand_names(copies, tuple(inner))
        return result


def map_texts(value: object, change: Callable[[str], str]) -> object:
    """Return a value of raw tables with all its texts changed."""
    if isinstance(value, dict):
        return {name: map_texts(item, change) for name, item in cast("dict[str, object]", value).items()}
    if isinstance(value, list):
        return [map_texts(item, change) for item in cast("list[object]", value)]
    return change(value) if isinstance(value, str) else value


def _shift(kind: str, part: object, offset: Sequence[float], phase: float) -> object:
    """Return a part moved by an offset, m, and delayed by a cam angle, rad; invalid values stay for their own fault."""
    if kind == "nodes" and isinstance(part, list) and len(cast("list[object]", part)) == 3:
        return [_add(value, x, "length") for value, x in zip(cast("list[object]", part), offset, strict=True)]
    if kind not in _ANGLES or not phase or not isinstance(part, dict):
        return cast("object", part)
    table = dict(cast("dict[str, object]", part))
    if "table" in table if kind == "loads" else not {"centreline", "timing"} & table.keys():
        table.setdefault("phase", 0.0)
    for key in _ANGLES[kind]:
        if key in table:
            table[key] = _add(table[key], phase, "angle")
    timing = table.get("timing")
    if isinstance(timing, dict):
        inner = cast("dict[str, object]", timing)
        angles = {key: _add(inner[key], phase, "angle") for key in _TIMING_ANGLES if key in inner}
        table["timing"] = inner | angles
    return table


def _add(value: Any, change: float, dimension: str) -> object:  # noqa: ANN401 - any TOML value
    """Return the sum of a quantity of a case and a change, SI; an invalid quantity is returned unchanged."""
    try:
        total = parse(value, dimension, noise=True) + change
    except InputError:
        return value
    return total % tau if dimension == "angle" else total
