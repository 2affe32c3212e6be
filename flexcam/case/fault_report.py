"""Source lines of the keys of a case, which `tomllib` does not report."""

from __future__ import annotations

import math
import re
import tomllib
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from copy import deepcopy
from dataclasses import dataclass, field, replace
from difflib import SequenceMatcher
from pathlib import PurePath
from typing import Any, TypeVar, cast, get_args, get_origin

from pydantic import BaseModel, ValidationError
from pydantic.fields import FieldInfo
from pydantic_core import ErrorDetails

from flexcam.case.schema.base import Record, describe_type_error, fields_at, keys_of, records_at, records_in, units_in
from flexcam.core.errors import NAMES, Fault, format_value, similar_name, suggest_name
from flexcam.core.units import DIMENSIONS, NUMBER, is_convertible

_TABLE = re.compile(r"\s*\[{1,2}([^\]]+)\]{1,2}\s*(?:#.*)?$")
_KEY = re.compile(r"""\s*((?:[A-Za-z0-9_-]+|"[^"]*"|'[^']*')(?:\s*\.\s*(?:[A-Za-z0-9_-]+|"[^"]*"|'[^']*'))*)\s*=""")
_PART = re.compile(r"""[A-Za-z0-9_-]+|"[^"]*"|'[^']*'""")

Path = tuple[str, ...]
AnyRecord = TypeVar("AnyRecord", bound=Record)


@dataclass(frozen=True)
class KeyLocations:
    r"""Source of every key of a case: a line of the file or an override."""

    #: source by key path, such as ``line 12``, ``--set run.speed=4000rpm`` or ``created by --set run.adaptive...``
    notes: Mapping[Path, str]
    #: template by path of a copy, such as ``springs.valve-{cylinder}`` of ``springs.valve-1``
    templates: Mapping[Path, Path] = field(default_factory=dict[Path, Path])
    #: tables of the case, in which a path with an index, which counts from 0, names an entry of a list
    raw: Mapping[str, Any] = field(default_factory=dict[str, Any])

    @classmethod
    def of_text(cls, text: str) -> KeyLocations:
        """Return the lines of every table and key of a TOML document, without keys inside inline tables."""
        notes: dict[Path, str] = {}
        table: Path = ()
        for number, line in enumerate(text.split("\n"), start=1):  # TOML has no other line ending
            if header := _TABLE.match(line):
                table = _parts(header[1])
                notes.setdefault(table, f"line {number}")
            elif key := _KEY.match(line):
                notes.setdefault(table + _parts(key[1]), f"line {number}")
        return cls(notes)

    def place(self, path: Path) -> str:
        """Return a key path with the source of its nearest listed ancestor; a copy has the source of its template.

        A table without a line has that of its first key.
        """
        for end in range(len(path), 0, -1):
            if path[:end] in self.notes:
                return f"{'.'.join(path)} ({self.notes[path[:end]]}{self._entry(path)})"
            if path[:end] in self.templates:
                return self.place(self.templates[path[:end]] + path[end:])
        below = next((note for key, note in self.notes.items() if path and key[: len(path)] == path), "")
        return f"{'.'.join(path)} ({below})" if below else ".".join(path) or "case file"

    def _entry(self, path: Path) -> str:
        """Return the entry of a list at a key path, such as ``, entry 2 of coils``; empty if there is none."""
        words = ""
        for i, step in enumerate(path):
            if step.isdigit() and isinstance(value_at(self.raw, path[:i]), list):
                words = f"entry {int(step) + 1} of {words or path[i - 1]}"
        return words and f", {words}"

    def locate(self, fault: Fault) -> Fault:
        """Return a fault at a key path with the source of the key added."""
        path, colon, inside = fault.where.partition(":")
        return fault if " (" in path else replace(fault, where=self.place(tuple(path.split("."))) + colon + inside)


def sort_faults(faults: Iterable[Fault]) -> list[Fault]:
    """Return faults sorted by line; faults without a line come last."""

    def line(fault: Fault) -> float:
        match = re.search(r" \(line (\d+)", fault.where)
        return int(match[1]) if match else math.inf

    return sorted(faults, key=line)


def _parts(dotted: str) -> Path:
    return tuple(part.strip("\"'") for part in _PART.findall(dotted))


_MAX_DEPTH = 30  # maximum nesting depth of tables and lists; a case has five
_MAX_KEY_PARTS = 1000  # maximum parts of a dotted key: the memory of `tomllib` is quadratic in their number
_MAX_LENGTH = 1 << 26  # maximum length of a text, characters

_TOO_DEEP = f"tables or lists nested more than {_MAX_DEPTH} deep"

_TUPLE = re.compile(r"\(('[^']*',? ?)+\)")  # key in an error message of `tomllib`, such as `('run', 'speed')`


def parse_toml(text: str) -> dict[str, Any]:
    """Parse a TOML text."""
    if len(text) > _MAX_LENGTH:
        raise ValueError(f"{len(text)} characters, more than {_MAX_LENGTH}")
    keys = (line.partition("=")[0] for line in text.split("\n"))
    if any(key.count(".") > _MAX_KEY_PARTS and "," not in key for key in keys):
        raise ValueError(_TOO_DEEP)
    try:
        tables = tomllib.loads(text)
    except RecursionError:
        raise ValueError(_TOO_DEEP) from None
    except tomllib.TOMLDecodeError as fault:
        message = _TUPLE.sub(lambda match: ".".join(re.findall(r"'([^']*)'", match[0])), str(fault))
        raise tomllib.TOMLDecodeError(message) from None
    level: list[object] = [tables]
    for _ in range(_MAX_DEPTH):
        rows = [cast("dict[str, object]", item).values() for item in level if isinstance(item, dict)]
        rows += [cast("list[object]", item) for item in level if isinstance(item, list)]
        level = [inner for row in rows for inner in row]
        if not level:
            return tables
    raise ValueError(_TOO_DEEP)


def value_at(table: object, path: Sequence[str]) -> object:
    """Return the value at a key path in nested tables and lists; None if there is none."""
    value: object = table
    for step in path:
        if isinstance(value, list) and step.isdigit():
            value = dict(enumerate(cast("list[object]", value))).get(int(step))
        else:
            value = cast("dict[str, object]", value).get(step) if isinstance(value, dict) else None
    return value


def check_record(
    kind: type[AnyRecord], raw: Mapping[str, Any], places: KeyLocations, context: Mapping[str, Any]
) -> tuple[AnyRecord | None, list[Fault], dict[str, Any], KeyLocations]:
    """Return the record of some tables, their faults, the tables without unknown keys, and the sources of these.

    A misspelt key counts as the one that is meant, so that one mistake does not cause further faults. The context has
    the file of the `case`, to whose folder file names refer, and the `texts` of these files, which reading adds.
    """
    raw, faults = dict(raw), list[Fault]()
    while True:
        record, errors = None, list[ErrorDetails]()
        try:
            record = kind.model_validate(raw, context=context)
        except ValidationError as refusal:
            errors = refusal.errors(include_url=False)
        raw, places, unknown_faults = _correct_keys(errors, raw, places, kind)
        if not unknown_faults:
            return record, [*faults, *_convert_errors(errors, raw, places, kind)], raw, places
        faults += unknown_faults


def _correct_keys(
    errors: Iterable[ErrorDetails], raw: Mapping[str, Any], places: KeyLocations, root: type[BaseModel]
) -> tuple[dict[str, Any], KeyLocations, list[Fault]]:
    """Return tables whose unknown keys are replaced by those that are meant, or removed; and sources and faults."""
    faults, written = list[Fault](), dict[Path, Path]()
    unknown = [(_path(error, raw), error) for error in errors if error["type"] == "extra_forbidden"]
    tables = deepcopy(dict(raw)) if unknown else dict(raw)
    for path, error in unknown:
        table, key = value_at(tables, path[:-1]), path[-1]
        if not isinstance(table, dict) or key not in table:  # another alternative of the table does not have it either
            continue
        table = cast("dict[str, Any]", table)
        value, known = table.pop(key), _fields(path, root, error["loc"])
        meant, variant = SYNONYMS.get(key, ""), _variant_with(path, root)
        meant = meant if meant in known or variant else similar_name(key, known)
        overridden = places.notes.get(path, "").startswith("--set")  # an override may replace a given key
        hint = "remove it"
        if f"{key}s" in root.model_fields and not isinstance(value, str | float):
            hint = f"did you mean the table [{key}s]?"
        elif len(path) == 1 and (tables_with := _tables_with(key, root)):
            hint = f"did you mean {tables_with[0]}.{key}?"
        hint = "give the diameter, twice the radius" if key == "radius" and "diameter" in known else hint
        is_misspelt = SequenceMatcher(None, key, meant).ratio() > _MISSPELT
        if meant in known and (is_misspelt or _fits(value, known[meant])) and (overridden or meant not in table):
            hint = f"did you mean {meant!r}?"
            if table.keys().isdisjoint([meant, *REPLACED_KEYS.get(meant, ())]):
                table[meant], written[(*path[:-1], meant)] = value, path
        hint = "did you mean 'crank_speed', or 'speed' of the camshaft?" if key == "rpm" and "speed" in known else hint
        allowed = f"one of the keys {', '.join(name for name in known if name != key)}"
        why = "there is no such key"
        if key in known:  # of a table whose variants its keys distinguish
            why = "it excludes another key of the table"
        elif variant:
            why = f"it is a key of {variant}"
            hint = hint if hint.startswith("did") else f"remove it, or change {variant.partition(' ')[0]}"
        faults.append(Fault(places.place(path), f"key {key!r}", allowed, why, hint))
    return tables, replace(places, templates={**places.templates, **written}), faults


_MISSPELT = 0.9  # similarity of two keys above which one is the other misspelt, whatever its value


def _tables_with(key: str, root: type[BaseModel]) -> list[str]:
    """Return the tables of a case, without tables of named parts, that have a key."""
    return [
        name for name, field in root.model_fields.items()
        if dict not in map(get_origin, (field.annotation, *get_args(field.annotation)))
        and any(key in dict(keys_of(record)) for record in records_in(field.annotation))
    ]  # fmt: skip


def _convert_errors(
    errors: Iterable[ErrorDetails], raw: Mapping[str, Any], places: KeyLocations, root: type[BaseModel]
) -> list[Fault]:
    """Return pydantic's errors on some tables as faults, one per key path."""
    faults: dict[tuple[str, str], Fault] = {}
    located = [(_path(error, raw), error) for error in errors]
    tables = {path[:depth] for path, _ in located for depth in range(len(path))}
    for path, error in located:
        if isinstance(error["input"], dict) and path in tables:
            continue  # a table in the place of a number: only the faults of the table are reported
        fault = _fault(error, path, places, root)
        key = fault.where, fault.given
        first = faults.setdefault(key, fault)
        if error["type"] == "missing" and path[-1].isdigit():  # only the last element that a row lacks is reported
            faults[key] = fault
        elif fault.allowed not in first.allowed:  # the value matches neither of two allowed types
            both = "" if fault.allowed.startswith(first.allowed) else f"{first.allowed}, or "
            faults[key] = replace(first, allowed=f"{both}{fault.allowed}", why=first.why or fault.why)
    return list(faults.values())


def _path(error: ErrorDetails, raw: Mapping[str, Any]) -> Path:
    """Return the key path without the steps added by pydantic, such as tags of variants and names of alternatives."""
    path, value = list[str](), cast("Any", raw)
    for place, step in enumerate(error["loc"], start=1):
        if isinstance(step, int) and isinstance(value, list) and step < len(cast("list[Any]", value)):
            value = cast("list[Any]", value)[step]
        elif isinstance(value, dict) and step in value:
            value = cast("dict[Any, Any]", value)[step]
        elif place < len(error["loc"]) or error["type"] != "missing":
            continue
        path.append(str(step))
    return tuple(path)


def iterate_values(table: object, path: Path = ()) -> Iterator[tuple[Path, object]]:
    """Yield path and value of all values in nested tables and lists."""
    if isinstance(table, list):
        table = {str(i): item for i, item in enumerate(cast("list[object]", table))}
    if isinstance(table, dict):
        for name, item in cast("dict[str, object]", table).items():
            yield from iterate_values(item, (*path, name))
    else:
        yield path, table


SYNONYMS = {
    "rate": "stiffness", "preload": "installed_force", "clearance": "gap", "lash": "gap", "damping": "dissipation",
    "step_size": "step", "time_step": "step", "steps": "steps_per_revolution", "rpm": "speed", "zeta": "modal",
    "node": "at",
}  # fmt: skip
"""Other words of engineers for keys."""


_EXCLUSIVE = (("speed", "crank_speed"), ("steps_per_revolution", "step"), ("phase", "centreline", "timing"))
# Keys of `[run]` and of cams, and the keys they replace.
REPLACED_KEYS = {key: [other for other in keys if other != key] for keys in _EXCLUSIVE for key in keys}


def _fits(value: object, key: FieldInfo) -> bool:
    """Return whether a value may be that of a key: a quantity in a unit of the key, and no number for a table."""
    units, quantity = units_in(key), NUMBER.match(value) if isinstance(value, str) else None
    if units and quantity:
        kinds = {kind for unit in units for kind in (unit.dimension, unit.axis) if kind}
        return any(is_convertible(quantity[2], DIMENSIONS[kind].si) for kind in kinds)
    return bool(units) or not isinstance(value, int | float) or not records_in(key.annotation)


def _variant_with(path: Path, root: type[BaseModel], value: str = "") -> str:
    """Return the variants of its table that have a key, such as ``model = 'unilateral'``; empty if there are none.

    With a value, only those count in which the key may be this word.
    """
    for tag in ("model", "type", "shape", "method"):
        words = list[str]()
        for fields in (record.model_fields for record in records_at(path[:-1], root)):
            if tag in fields and path[-1] in fields:
                known = [word for part in get_args(fields[path[-1]].annotation) for word in get_args(part)]
                words += map(repr, get_args(fields[tag].annotation)) if not value or value in known else ()
        if words:
            return f"{tag} = {' or '.join(words)}"
    return ""


def _fields(path: Path, root: type[BaseModel], steps: Sequence[int | str]) -> dict[str, FieldInfo]:
    """Return the keys of the table of a key, in the variant that the steps of pydantic name, with their fields."""
    records, tags = records_at(path[:-1], root), [*(Counter(map(str, steps)) - Counter(path))]
    own = [r for r in records if any(x in tags for key in r.model_fields.values() for x in get_args(key.annotation))]
    fields: dict[str, FieldInfo] = {}
    for record in own or records:
        for name, key in record.model_fields.items():
            fields.setdefault(key.alias or name, key)
    return fields


def _fault(error: ErrorDetails, path: Path, places: KeyLocations, root: type[BaseModel]) -> Fault:
    context, value = cast("Mapping[str, Any]", error.get("ctx", {})), cast("object", error["input"])
    where, given = places.place(path), _shorten(value)
    tag = str(context.get("discriminator", "")).strip("'")
    match error["type"]:
        case "flexcam":
            where, given = _locate_fault(context, path, value, places, root)
            if isinstance(value, str) and value and path and (variant := _variant_with(path, root, value)):
                return Fault(where, given, str(context["allowed"]), f"{value!r} is available only with {variant}", "")
            return Fault(where, given, str(context["allowed"]), str(context["why"]), str(context["remedy"]))
        case "missing" if path[-1].isdigit():  # an element of a row
            return Fault(places.place(path[:-1]), given, f"{int(path[-1]) + 1} values", "", "")
        case "too_long" | "too_short":
            minimum, maximum = context.get("min_length"), context.get("max_length")
            entries = cast("Sequence[object]", value)
            what = "rows" if any(isinstance(entry, list) for entry in entries) else "values"
            return Fault(where, given, f"{maximum} {what}" if maximum else f"at least {minimum} {what}", "", "")
        case "model_type" | "model_attributes_type" | "dict_type":
            keyed = len(path) > 1 and records_at(path, root) != records_at(path[:-1], root)  # no table of named parts
            variants = [dict(keys_of(record)) for record in records_at(path, root)] if keyed else []
            names = dict.fromkeys(name for keys in variants for name in keys)
            required = {name for name in names if all(name in keys and keys[name].is_required() for keys in variants)}
            listed = ", ".join(f"{name} (required)" if name in required else name for name in names)
            allowed = f"a table with keys among {listed}" if names else "a table"
            place = ".".join(path)
            remedy = (
                f"write {place.rpartition('.')[2]} = {{ KEY = ... }} with one of these keys, or the header [{place}]"
            )
            if not names:
                remedy = "write it as { key = value } or under a [header]"
            if any("type" in keys and value in get_args(keys["type"].annotation) for keys in variants):
                remedy = f"write it as {{ type = {format_value(value)} }}"
            return Fault(where, given, allowed, "", remedy)
        case "missing":
            kind = "a value" if records_at(path, root) == records_at(path[:-1], root) else f"a table [{'.'.join(path)}]"
            return _missing_key_fault(path, _describe_field(path, root, error["loc"]) or kind, places)
        case "union_tag_not_found":
            fields = [record.model_fields[tag] for record in records_at(path, root) if tag in record.model_fields]
            allowed = ", ".join(repr(value) for field in fields for value in get_args(field.annotation))
            return _missing_key_fault((*path, tag), allowed, places)
        case "literal_error" | "union_tag_invalid":
            allowed = str(context.get("expected") or context.get("expected_tags"))
            if tag:  # pydantic converts the value of a tag to text
                where, value = places.place((*path, tag)), value_at(value, [tag])
            near = suggest_name(str(value), re.findall(r"'([^']*)'", allowed))
            return Fault(where, format_value(value), allowed, "", near)
        case "int_type" | "int_parsing" | "int_from_float":
            return Fault(where, given, f"a whole number ({_describe_field(path, root, error['loc'])})", "", "")
        case "less_than_equal" | "greater_than_equal" if path == ("format",):
            why, remedy = "it is the version of the case format", "a newer flexcam may have written it"
            return Fault(where, given, "1", why, remedy)
        case "string_pattern_mismatch":
            if path[:2] == ("output", "probes") and "." in str(value):
                why, point = "flexcam saves every component of a point", str(value).partition(".")[0]
                return Fault(where, given, "a point of the case", why, f"write {point!r}")
            mark = re.search(r"\{([^{}]*)\}", path[-1] if path else "")
            return Fault(where, given, NAMES, f"there is no [repeat.{mark[1]}]" if mark else "", "")
        case "list_type" | "tuple_type" if description := _describe_field(path, root, error["loc"]):
            allowed, _, why = description.partition("; ")
            allowed = allowed if "in brackets" in description else f"{describe_type_error(error)}: {allowed}"
            return Fault(where, given, allowed, why, "")
        case _:
            return Fault(where, given, describe_type_error(error), "", "")


def _locate_fault(
    context: Mapping[str, Any], path: Path, value: object, places: KeyLocations, root: type[BaseModel]
) -> tuple[str, str]:
    """Return path and value of a fault inside a table; the path includes the key if the fault concerns one."""
    inside, given = str(context["inside"]), str(context["given"])
    allowed = re.findall(r"\w+", str(context["allowed"]))
    if not inside:
        return places.place(path), given or _shorten(value, allowed)
    steps = inside.split(".")
    known = {name for name, _ in fields_at(path, root)}
    first = next((i for i, step in enumerate(steps) if step in known), None)
    # A fault in a file begins with the name of the file, which may look like a key.
    if first is None or inside.startswith(PurePath(str(value_at(value, ["file"]) or value)).name):
        return f"{places.place(path)}: {inside}", given
    inner = value_at(value, steps[first:])
    place = places.place((*path, *steps[first:]))
    if inner is None or (given and hasattr(inner, "keys")):  # the fault concerns several keys of the table
        return place, given
    return place, _shorten(inner, allowed)


def _missing_key_fault(path: Path, allowed: str, places: KeyLocations) -> Fault:
    entry = "format = 1" if path == ("format",) else repr(path[-1])
    return Fault(places.place(path), "nothing", allowed, "the key is required", f"add {entry}")


def _shorten(value: object, words: Sequence[str] = ()) -> str:
    """Return a value as text; of a table, the keys among the words of a message if there are any."""
    text = format_value(value)
    if isinstance(value, dict):
        table = {key: format_value(item) for key, item in cast("dict[str, object]", value).items()}
        named = {key: table[key] for key in words if key in table}
        if named:
            return ", ".join(f"{key} = {entry}" if len(entry) <= 40 else key for key, entry in named.items())
        if len(text) > 60:
            return f"the keys {', '.join(table)}"
    return text if len(text) <= 60 else text[:57] + "..."


def _describe_field(path: Path, root: type[BaseModel], steps: Sequence[int | str]) -> str:
    """Return the quantity or the description of a key."""
    key = _fields(path, root, steps).get(path[-1])
    if key is None:
        return ""
    units = [unit for unit in units_in(key) if not unit.axis]
    kinds, parts = [unit.description for unit in units[:1]], get_args(key.annotation)
    if kinds and get_origin(key.annotation) is tuple and Ellipsis not in parts:
        kinds = [f"{len(parts)} values in brackets, each {kinds[0]}"]
    return ": ".join(filter(None, (*kinds, key.description)))
