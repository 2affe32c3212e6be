"""TOML text to tables, with bounds: Python's own reader has none for numbers of many digits and nested brackets."""

from __future__ import annotations

import re
import tomllib
from typing import Any, cast

_DEPTH = 30
"""Tables in tables and lists in lists; a case has five."""

_LONGEST = 1 << 26
"""Characters of a text."""


def toml(text: str) -> dict[str, Any]:
    """Return the tables of a TOML text."""
    if len(text) > _LONGEST:
        raise ValueError(f"{len(text)} characters, more than {_LONGEST}")
    if any(map(_far_too_dotted, text.split("\n"))):
        raise ValueError(_TOO_DEEP)
    try:
        tables = tomllib.loads(text)
    except RecursionError:
        raise ValueError(_TOO_DEEP) from None
    except tomllib.TOMLDecodeError as fault:
        raise tomllib.TOMLDecodeError(_TUPLE.sub(lambda found: ".".join(_PART.findall(found[0])), str(fault))) from None
    level: list[object] = [tables]
    for _ in range(_DEPTH):
        level = [inner for one in level for inner in _inside(one)]
        if not level:
            return tables
    raise ValueError(_TOO_DEEP)


_TUPLE, _PART = re.compile(r"\(('[^']*',? ?)+\)"), re.compile(r"'([^']*)'")
"""A key as Python's reader tells it, such as ``('run', 'speed')``, and its parts."""

_TOO_DEEP = f"tables or lists nested more than {_DEPTH} deep"


def _far_too_dotted(line: str) -> bool:
    """Tell a key of thousands of parts: Python's reader takes memory by the square of their number."""
    key = line.partition("=")[0]
    return key.count(".") > _PARTS and "," not in key


_PARTS = 1000


def _inside(one: object) -> list[object]:
    if isinstance(one, dict):
        return [*cast("dict[str, object]", one).values()]
    return cast("list[object]", one) if isinstance(one, list) else []
