"""pydantic's findings in flexcam's voice: where, given, allowed, why, what to do."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any, cast, get_args

from pydantic import BaseModel
from pydantic_core import ErrorDetails

from flexcam.case.lines import Path, place
from flexcam.case.records import CaseRecord
from flexcam.checks import Fault, did_you_mean

_TAGGED = (("sections", "*"), ("run", "integrator"))
"""Tables with variants: pydantic puts the variant's tag behind them in a path."""


def faults(errors: Iterable[ErrorDetails], lines: dict[Path, int]) -> list[Fault]:
    """Return pydantic's errors as faults, one per place.

    Parameters
    ----------
    errors
        From ``ValidationError.errors()``.
    lines
        Lines of the keys, from `flexcam.case.lines`.

    Returns
    -------
    list
        In the order of the file.
    """
    found: dict[str, Fault] = {}
    for error in errors:
        path = _path(error)
        where = place(path, lines)
        found.setdefault(where, _fault(error, path, where))
    return list(found.values())


def _path(error: ErrorDetails) -> Path:
    """Return the key path without pydantic's own steps (tags of unions, types of alternatives)."""
    steps = [str(step) for step in error["loc"]]
    path = [step for i, step in enumerate(steps) if not _inserted(steps, i)]
    return tuple(path)


def _inserted(steps: list[str], i: int) -> bool:
    tag = i == 2 and len(steps) > 2 and any(all(a in (b, "*") for a, b in zip(t, steps, strict=False)) for t in _TAGGED)
    return tag or steps[i].startswith(("function-", "nullable", "tuple[")) or steps[i] == "[key]"


def _fault(error: ErrorDetails, path: Path, where: str) -> Fault:
    context = cast("Mapping[str, Any]", error.get("ctx", {}))
    given = _shown(error["input"])
    match error["type"]:
        case "flexcam":
            return Fault(where, given, str(context["allowed"]), str(context["why"]), str(context["remedy"]))
        case "missing":
            about = _about(path)
            return Fault(where, "nothing", about or "a value", "the key is required", f"add {path[-1]!r}")
        case "extra_forbidden":
            known = _keys(path[:-1])
            hint = did_you_mean(path[-1], known) or "remove it"
            return Fault(where, f"key {path[-1]!r}", ", ".join(known), "there is no such key", hint)
        case "literal_error" | "union_tag_invalid":
            allowed = str(context.get("expected") or context.get("expected_tags"))
            value = str(context.get("tag", error["input"]))
            return Fault(
                where,
                repr(value),
                allowed,
                "",
                did_you_mean(value, [a.strip("' ") for a in allowed.replace(" or ", ",").split(",")]),
            )
        case "string_pattern_mismatch":
            return Fault(where, given, "a name of letters, digits, '_', '-' and spaces", "", "")
        case _:
            return Fault(where, given, error["msg"].replace("Input should be ", ""), "", "")


def _shown(value: object) -> str:
    text = repr(value)
    return text if len(text) <= 60 else text[:57] + "..."


def _records(path: Path) -> list[type[BaseModel]]:
    """Return the records that may stand at a key path (several where a table has variants)."""
    records: list[type[BaseModel]] = [CaseRecord]
    for step in path:
        found: list[type[BaseModel]] = []
        for record in records:
            by_key = {field.alias or name: field for name, field in record.model_fields.items()}
            field = by_key.get(step)
            found += _inside(field.annotation) if field else []
        # A step that is no field is a name chosen by the user, inside a table of such names.
        records = found or records
    return records


def _inside(annotation: object) -> list[type[BaseModel]]:
    """Return the records inside a type: in unions, tables of names and annotated types."""
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        return [annotation]
    parts: list[object] = [*get_args(annotation)]
    return [record for part in parts for record in _inside(part)]


def _keys(path: Path) -> list[str]:
    keys = [f.alias or name for record in _records(path) for name, f in record.model_fields.items()]
    return list(dict.fromkeys(keys))


def _about(path: Path) -> str:
    for record in _records(path[:-1]):
        for name, field in record.model_fields.items():
            if (field.alias or name) == path[-1]:
                return field.description or ""
    return ""
