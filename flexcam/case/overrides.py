"""Raw tables of a TOML file, and overrides applied to them."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from pathlib import Path
from typing import Any, cast

from flexcam.case.records import CaseRecord
from flexcam.case.toml_lines import Path as KeyPath
from flexcam.case.toml_lines import Places, toml
from flexcam.core.errors import Fault, did_you_mean, refuse, said
from flexcam.io import text_of


def parsed(source: Path) -> tuple[str, dict[str, Any]]:
    """Return the text and the raw tables of a file."""
    text = _text(source)
    return text, tables_of(source, text)


def tables_of(source: Path, text: str) -> dict[str, Any]:
    """Return the raw tables of a TOML text."""
    try:
        return toml(text)
    except ValueError as fault:
        remedy = "strings need quotes, tables need [brackets]"
        raise refuse(str(source), str(fault), "a TOML document", "", remedy) from None


def overridden(raw: dict[str, Any], text: str, overrides: Sequence[str]) -> tuple[Places, list[Fault]]:
    """Apply overrides to raw tables."""
    places, found = Places.of_text(text), list[Fault]()
    for override in overrides:
        found += _lay_over(raw, override)
        places = places.overridden(_key(override), override)
    _give_way(raw, {_key(override) for override in overrides})
    return places, found


_INSTEAD = {
    "speed": "crank_speed",
    "crank_speed": "speed",
    "steps_per_revolution": "step",
    "step": "steps_per_revolution",
}
"""Keys of ``[run]`` and the keys they replace."""


def _give_way(raw: dict[str, Any], given: Collection[KeyPath]) -> None:
    """Remove the keys that an override replaces; two overrides that exclude each other remain."""
    for key, other in _INSTEAD.items():
        if ("run", key) in given and ("run", other) not in given and isinstance(raw.get("run"), dict):
            raw["run"].pop(other, None)


def _text(path: Path) -> str:
    try:
        return text_of(path)
    except FileNotFoundError:
        near = did_you_mean(path.name, [p.name for p in path.parent.glob("*.toml")] if path.parent.is_dir() else [])
        raise refuse("case file", str(path), "an existing file", "", near) from None
    except (OSError, UnicodeDecodeError) as fault:
        why, remedy = _unreadable(path, fault)
        raise refuse("case file", str(path), "a readable UTF-8 text file", why, remedy) from None


def _unreadable(path: Path, fault: OSError | UnicodeDecodeError) -> tuple[str, str]:
    """Return why a file is not a case, and a remedy: users often pass a result file instead."""
    if path.suffix == ".vtkhdf":
        return "it is a result", "give the case; flexcam info, plot, report, view and export take results"
    return said(fault), ""


def _key(override: str) -> KeyPath:
    return tuple(step.strip() for step in override.partition("=")[0].split("."))


def _lay_over(raw: dict[str, Any], override: str) -> list[Fault]:
    """Apply one override ``a.b.c=value`` to the tables; return its faults."""
    path, (_, equals, value) = _key(override), override.partition("=")
    where = f"--set {override}"
    if not equals or not all(path):
        return [Fault(where, repr(override), "key=value, such as run.speed=4000rpm", "", "")]
    table: dict[str, Any] = raw
    for depth, step in enumerate(path[:-1]):
        new = depth == 1 and path[0] != "run" and not did_you_mean(step, table)
        known = list(CaseRecord.model_fields) if depth == 0 else [*table, *_OPTIONAL_TABLES]
        inner = table.setdefault(step, {}) if step in known or new else None
        if isinstance(inner, list) and depth == len(path) - 2:
            return _lay_into(cast("list[Any]", inner), path[-1], value, where)
        if not isinstance(inner, dict):
            return [Fault(where, repr(step), f"a table: {', '.join(table)}", "", did_you_mean(step, known))]
        table = cast("dict[str, Any]", inner)
    table[path[-1]] = _toml_value(value.strip())
    return []


def _lay_into(values: list[Any], position: str, value: str, where: str) -> list[Fault]:
    """Set an element of a list, at an index counted from 0."""
    if not position.isdecimal() or int(position) >= len(values):
        return [Fault(where, repr(position), f"a position in the list, 0 to {len(values) - 1}", "", "")]
    values[int(position)] = _toml_value(value.strip())
    return []


_OPTIONAL_TABLES = {"adaptive", "damping", "fluctuation", "free_running", "integrator"}
"""Optional nested tables."""


def _toml_value(text: str) -> object:
    try:
        made = toml(f"value = {text}")
    except ValueError:
        return text
    return made["value"] if len(made) == 1 else text  # text with further lines is invalid
