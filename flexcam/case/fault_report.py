"""Convert pydantic errors to faults of a case, and find the SI unit of a key.

Some units depend on other keys of the table: a spring stiffness is N/m along a line and N m/rad about an axis; a lift
is m, or rad with a swinging follower. The table is then validated with the number in each possible unit: it accepts
only the right one.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from typing import Any, cast, get_args

from pydantic import BaseModel, ValidationError
from pydantic_core import ErrorDetails

from flexcam.case.records import CaseRecord
from flexcam.case.schema.base import Unit, describe_expected
from flexcam.case.toml_lines import KeyLocations, Path
from flexcam.core.errors import NAMES, Fault, InputError, format_value, suggest_name
from flexcam.core.units import DIMENSIONS

_TAGGED = (
    ("sections", "*"), ("cams", "*", "follower"), ("follower",), ("contacts", "*"), ("rockers", "*"),
    ("run", "integrator"), ("run", "start"),
)  # fmt: skip
"""Tables with variants: pydantic appends the tag of the variant to their path."""


def convert_errors(
    errors: Iterable[ErrorDetails], places: KeyLocations, root: type[BaseModel] = CaseRecord
) -> list[Fault]:
    """Return pydantic's errors as faults, one per key path."""
    found: dict[tuple[str, str], Fault] = {}
    told = [(_path(error), error) for error in errors]
    missing = Counter(path for path, error in told if error["type"] == "missing")
    for path, error in told:
        if error["type"] == "missing" and path[-1].isdigit() and missing[path] == missing[_next_element_path(path)]:
            continue  # of the elements missing in a row, only the last one is reported
        inside = any(len(one) > len(path) and one[: len(path)] == path for one, _ in told)
        if inside and isinstance(error["input"], dict):
            continue  # a table in the place of a number: only the faults of the table are reported
        fault = _fault(error, path, places, root)
        key = fault.where, fault.given
        found[key] = _merge_alternatives(found[key], fault) if key in found else fault
    return list(found.values())


def _next_element_path(path: Path) -> Path:
    """Return the path of the next element of an array."""
    return (*path[:-1], str(int(path[-1]) + 1))


def _merge_alternatives(first: Fault, second: Fault) -> Fault:
    """Merge the faults of a value with two allowed types, such as a word or a quantity, of which it matches neither."""
    if second.allowed in first.allowed:
        return first
    return replace(first, allowed=f"{first.allowed}, or {second.allowed}", why=first.why or second.why)


def _path(error: ErrorDetails) -> Path:
    """Return the key path without the parts added by pydantic (tags of unions, names of alternatives)."""
    steps = [str(step) for step in error["loc"]]
    path = [step for i, step in enumerate(steps) if not _is_pydantic_step(steps, i)]
    return tuple(path)


def _is_pydantic_step(steps: list[str], i: int) -> bool:
    heads = [t for t in _TAGGED if len(t) == i < len(steps)]
    tag = any(all(a in (b, "*") for a, b in zip(t, steps, strict=False)) for t in heads)
    return tag or steps[i].startswith(("function-", "literal[", "nullable", "tuple[")) or steps[i] == "[key]"


def _fault(error: ErrorDetails, path: Path, places: KeyLocations, root: type[BaseModel]) -> Fault:
    context = cast("Mapping[str, Any]", error.get("ctx", {}))
    where, given = places.place(path), _format_input(error["input"])
    match error["type"]:
        case "flexcam":
            where, given = _locate_fault(context, path, error["input"], places, root)
            return Fault(where, given, str(context["allowed"]), str(context["why"]), str(context["remedy"]))
        case "missing" if path[-1].isdigit():  # an element of a row
            return Fault(places.place(path[:-1]), given, f"{int(path[-1]) + 1} values", "", "")
        case "too_long" | "too_short":
            return Fault(where, given, f"{context.get('max_length', context.get('min_length'))} values", "", "")
        case "model_type" | "model_attributes_type" | "dict_type":
            return Fault(where, given, "a table", "", "write it as { key = value } or under a [header]")
        case "missing":
            return _missing_key_fault(path, _describe_field(path, root) or "a value", places)
        case "union_tag_not_found":
            key = str(context["discriminator"]).strip("'")
            return _missing_key_fault((*path, key), _allowed_tags(path, key, root), places)
        case "extra_forbidden":
            known = _keys(path[:-1], root)
            hint = (
                "remove it: another kind has it" if path[-1] in known else suggest_name(path[-1], known) or "remove it"
            )
            return Fault(where, f"key {path[-1]!r}", ", ".join(known), "there is no such key", hint)
        case "literal_error" | "union_tag_invalid":
            allowed = str(context.get("expected") or context.get("expected_tags"))
            value = _tag_value(context, error["input"])
            names = re.findall(r"'([^']*)'", allowed)
            if error["type"] == "union_tag_invalid":
                where = places.place((*path, str(context["discriminator"]).strip("'")))
            return Fault(where, format_value(value), allowed, "", suggest_name(str(value), names))
        case "int_type" | "int_parsing" | "int_from_float":
            return Fault(where, given, f"a whole number: {_describe_field(path, root)}", "", "")
        case "less_than_equal" | "greater_than_equal" if path == ("format",):
            return Fault(
                where, given, "1", "it is the version of the case format", "a newer flexcam may have written it"
            )
        case "string_pattern_mismatch":
            return Fault(where, given, NAMES, "", "")
        case _:
            return Fault(where, given, describe_expected(error), "", "")


def _tag_value(context: Mapping[str, Any], value: object) -> object:
    """Return the value in the place of a tag; pydantic converts it to text."""
    if "tag" not in context:
        return value
    key = str(context["discriminator"]).strip("'")
    return cast("dict[str, object]", value).get(key, context["tag"]) if isinstance(value, dict) else context["tag"]


def _locate_fault(
    context: Mapping[str, Any], path: Path, value: object, places: KeyLocations, root: type[BaseModel]
) -> tuple[str, str]:
    """Return path and value of a fault inside a table; the path includes the key if the fault concerns one."""
    inside, given = str(context["inside"]), str(context["given"])
    if not inside:
        return places.place(path), _format_input(value)
    key = inside.rpartition(".")[2]
    table = cast("dict[str, object]", value) if isinstance(value, dict) else dict[str, object]()
    if key in _keys(path, root):
        return places.place((*path, key)), _format_input(table[key]) if key in table else given
    return f"{places.place(path)}: {inside}", given


def _missing_key_fault(path: Path, allowed: str, places: KeyLocations) -> Fault:
    return Fault(places.place(path), "nothing", allowed, "the key is required", f"add {path[-1]!r}")


def _allowed_tags(path: Path, key: str, root: type[BaseModel]) -> str:
    """Return the allowed values of the tag of a table with variants."""
    choices = [record.model_fields[key].annotation for record in _records(path, root) if key in record.model_fields]
    return ", ".join(repr(value) for choice in choices for value in get_args(choice))


def _format_input(value: object) -> str:
    text = format_value(value)
    return text if len(text) <= 60 else text[:57] + "..."


def _records(path: Path, root: type[BaseModel]) -> list[type[BaseModel]]:
    """Return the records allowed at a key path (several for a table with variants)."""
    records: list[type[BaseModel]] = [root]
    for step in path:
        found: list[type[BaseModel]] = []
        for record in records:
            by_key = {field.alias or name: field for name, field in record.model_fields.items()}
            field = by_key.get(step)
            found += _records_in(field.annotation) if field else []
        # A path element that is not a field is a user-defined name in a table of names.
        records = found or records
    return records


def _records_in(annotation: object) -> list[type[BaseModel]]:
    """Return the records contained in a type: in unions, tables of names and annotated types."""
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        return [annotation]
    parts: list[object] = [*get_args(annotation)]
    return [record for part in parts for record in _records_in(part)]


def _keys(path: Path, root: type[BaseModel]) -> list[str]:
    keys = [f.alias or name for record in _records(path, root) for name, f in record.model_fields.items()]
    return list(dict.fromkeys(keys))


def _describe_field(path: Path, root: type[BaseModel]) -> str:
    for record in _records(path[:-1], root):
        for name, field in record.model_fields.items():
            if (field.alias or name) == path[-1]:
                return field.description or ""
    return ""


def si_unit(path: Path, root: type[BaseModel] = CaseRecord) -> str | None:
    """Return the SI unit of a key."""
    while path and path[-1].isdigit():
        path = path[:-1]
    for record in _records(path[:-1], root):
        for name, field in record.model_fields.items():
            if (field.alias or name) == path[-1]:
                units = [one for one in field.metadata if isinstance(one, Unit)] + _units_in(field.annotation)
                return DIMENSIONS[units[0].dimension].si if units else None
    parts = [unit for record in _records(path[:-2], root) for unit in _units_in_table(record, path)]
    return DIMENSIONS[parts[0].dimension].si if parts else None


def _units_in_table(record: type[BaseModel], path: Path) -> list[Unit]:
    """Return the units in a table of names, such as nodes, where the key is such a name."""
    named = {field.alias or name: field for name, field in record.model_fields.items()}
    return _units_in(named[path[-2]].annotation) if len(path) > 1 and path[-2] in named else []


def _units_in(annotation: object) -> list[Unit]:
    """Return the units contained in a type, without those of its records."""
    if isinstance(annotation, Unit):
        return [annotation]
    parts: list[object] = [*get_args(annotation)]
    return [unit for part in parts for unit in _units_in(part)]


def resolve_record(record: CaseRecord) -> dict[str, Any]:
    """Return a case with all defaults as tables that can be read again."""
    tables = record.model_dump(mode="json", by_alias=True, exclude_none=True)
    if record.mesh is not None:
        del tables["nodes"]
    return tables


def find_unit(record: CaseRecord, path: Sequence[str]) -> str | None:
    """Return the SI unit of a number of a case."""
    known = si_unit(tuple(path))
    if known is not None:
        return known
    table, rest = _enclosing_table(record, path)
    # Moments may omit the radian, so rotational stiffness is tried first.
    kinds = sorted(DIMENSIONS.values(), key=lambda kind: path[-1] not in kind.name)
    units = [*(kind.si for kind in kinds if kind.si), ""]
    return next((unit for unit in units if _accepts_unit(table, rest, unit)), None)


def _enclosing_table(record: BaseModel, path: Sequence[str]) -> tuple[BaseModel, Sequence[str]]:
    """Return the innermost table of a key and the remaining path."""
    found, value = (record, path), cast("object", record)
    for i, step in enumerate(path):
        if isinstance(value, BaseModel):
            found = value, path[i:]
            names = {field.alias or name: name for name, field in type(value).model_fields.items()}
            value = getattr(value, names.get(step, step), None)
        elif isinstance(value, dict):
            value = cast("dict[str, object]", value).get(step)
    return found


def _accepts_unit(table: BaseModel, path: Sequence[str], unit: str) -> bool:
    """Return whether a table keeps its values with a number in a given unit."""
    try:
        given = _set_unit(table.model_dump(mode="json", by_alias=True), path, unit)
        return type(table).model_validate(given) == table
    except (ValidationError, InputError, KeyError, IndexError):
        return False


def _set_unit(value: object, path: Sequence[str], unit: str) -> object:
    """Return the raw value with a unit appended to the number at a path."""
    if not path:
        return f"{value!r} {unit}" if unit else value
    step, *rest = path
    if isinstance(value, list):
        row = [*cast("list[object]", value)]
        row[int(step)] = _set_unit(row[int(step)], rest, unit)
        return row
    named = cast("dict[str, object]", value)
    return {**named, step: _set_unit(named[step], rest, unit)}
