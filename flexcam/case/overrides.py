"""Raw tables of a TOML file, and overrides applied to them."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from pathlib import Path
from typing import Any, cast

from flexcam.case.records import CaseRecord
from flexcam.case.toml_lines import KeyLocations, parse_toml
from flexcam.case.toml_lines import Path as KeyPath
from flexcam.core.errors import Fault, refuse, suggest_name, system_message
from flexcam.io import read_text


def read_tables(source: Path) -> tuple[str, dict[str, Any]]:
    """Return the text and the raw tables of a file."""
    text = _text(source)
    return text, parse_tables(source, text)


def parse_tables(source: Path, text: str) -> dict[str, Any]:
    """Return the raw tables of a TOML text."""
    try:
        return parse_toml(text)
    except ValueError as fault:
        remedy = "strings need quotes, tables need [brackets]"
        raise refuse(str(source), str(fault), "a TOML document", "", remedy) from None


def apply_overrides(raw: dict[str, Any], text: str, overrides: Sequence[str]) -> tuple[KeyLocations, list[Fault]]:
    """Apply overrides to raw tables."""
    places, found = KeyLocations.of_text(text), list[Fault]()
    for override in overrides:
        found += _apply_override(raw, override)
        places = places.with_override(_key(override), override)
    _remove_replaced_keys(raw, {_key(override) for override in overrides})
    return places, found


_REPLACED_KEYS = {
    "speed": "crank_speed",
    "crank_speed": "speed",
    "steps_per_revolution": "step",
    "step": "steps_per_revolution",
}
"""Keys of ``[run]`` and the keys they replace."""


def _remove_replaced_keys(raw: dict[str, Any], given: Collection[KeyPath]) -> None:
    """Remove the keys that an override replaces; two overrides that exclude each other remain."""
    for key, other in _REPLACED_KEYS.items():
        if ("run", key) in given and ("run", other) not in given and isinstance(raw.get("run"), dict):
            raw["run"].pop(other, None)


def _text(path: Path) -> str:
    try:
        return read_text(path)
    except FileNotFoundError:
        near = suggest_name(path.name, [p.name for p in path.parent.glob("*.toml")] if path.parent.is_dir() else [])
        raise refuse("case file", str(path), "an existing file", "", near) from None
    except (OSError, UnicodeDecodeError) as fault:
        why, remedy = _describe_read_error(path, fault)
        raise refuse("case file", str(path), "a readable UTF-8 text file", why, remedy) from None


def _describe_read_error(path: Path, fault: OSError | UnicodeDecodeError) -> tuple[str, str]:
    """Return why a file is not a case, and a remedy: users often pass a result file instead."""
    if path.suffix == ".vtkhdf":
        return "it is a result", "give the case; flexcam info, plot, report, view and export take results"
    return system_message(fault), ""


def _key(override: str) -> KeyPath:
    return tuple(step.strip() for step in override.partition("=")[0].split("."))


def _apply_override(raw: dict[str, Any], override: str) -> list[Fault]:
    """Apply one override ``a.b.c=value`` to the tables; return its faults."""
    path, (_, equals, value) = _key(override), override.partition("=")
    where = f"--set {override}"
    if not equals or not all(path):
        return [Fault(where, repr(override), "key=value, such as run.speed=4000rpm", "", "")]
    table: dict[str, Any] = raw
    for depth, step in enumerate(path[:-1]):
        new = depth == 1 and path[0] != "run" and not suggest_name(step, table)
        known = list(CaseRecord.model_fields) if depth == 0 else [*table, *_OPTIONAL_TABLES]
        inner = table.setdefault(step, {}) if step in known or new else None
        if isinstance(inner, list) and depth == len(path) - 2:
            return _set_list_element(cast("list[Any]", inner), path[-1], value, where)
        if not isinstance(inner, dict):
            return [Fault(where, repr(step), f"a table: {', '.join(table)}", "", suggest_name(step, known))]
        table = cast("dict[str, Any]", inner)
    table[path[-1]] = _toml_value(value.strip())
    return []


def _set_list_element(values: list[Any], position: str, value: str, where: str) -> list[Fault]:
    """Set an element of a list, at an index counted from 0."""
    if not position.isdecimal() or int(position) >= len(values):
        return [Fault(where, repr(position), f"a position in the list, 0 to {len(values) - 1}", "", "")]
    values[int(position)] = _toml_value(value.strip())
    return []


_OPTIONAL_TABLES = {"adaptive", "damping", "fluctuation", "free_running", "integrator"}
"""Optional nested tables."""


def _toml_value(text: str) -> object:
    try:
        made = parse_toml(f"value = {text}")
    except ValueError:
        return text
    return made["value"] if len(made) == 1 else text  # text with further lines is invalid
