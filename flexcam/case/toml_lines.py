"""Source lines of the keys of a case, which `tomllib` does not report."""

from __future__ import annotations

import math
import re
import tomllib
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any, cast

from flexcam.core.errors import Fault

_TABLE = re.compile(r"\s*\[{1,2}\s*([^\]]+?)\s*\]{1,2}\s*(?:#.*)?$")
_KEY = re.compile(r"""\s*((?:[A-Za-z0-9_-]+|"[^"]*"|'[^']*')(?:\s*\.\s*(?:[A-Za-z0-9_-]+|"[^"]*"|'[^']*'))*)\s*=""")
_PART = re.compile(r"""[A-Za-z0-9_-]+|"[^"]*"|'[^']*'""")

Path = tuple[str, ...]


@dataclass(frozen=True)
class KeyLocations:
    r"""Source of every key of a case: a line of the file or an override.

    Parameters
    ----------
    notes
        Source by key path, such as ``line 12`` or ``--set run.speed=4000rpm``.
    """

    notes: Mapping[Path, str]

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

    def with_override(self, path: Path, override: str) -> KeyLocations:
        """Return the sources with one key given by an override."""
        return KeyLocations({**self.notes, path: f"--set {override}"})

    def place(self, path: Path) -> str:
        """Return a key path with the source of its nearest listed ancestor."""
        for end in range(len(path), 0, -1):
            if path[:end] in self.notes:
                return f"{'.'.join(path)} ({self.notes[path[:end]]})"
        return ".".join(path) or "case file"


_LINE = re.compile(r" \(line (\d+)\)")


def sort_faults(faults: Iterable[Fault]) -> list[Fault]:
    """Return faults sorted by line; faults without a line come last."""

    def line(fault: Fault) -> float:
        told = _LINE.search(fault.where)
        return int(told[1]) if told else math.inf

    return sorted(faults, key=line)


def _parts(dotted: str) -> Path:
    return tuple(part.strip("\"'") for part in _PART.findall(dotted))


_MAX_DEPTH = 30
"""Maximum nesting depth of tables and lists; a case has five."""

_MAX_LENGTH = 1 << 26
"""Maximum length of a text, characters."""


def parse_toml(text: str) -> dict[str, Any]:
    """Parse a TOML text."""
    if len(text) > _MAX_LENGTH:
        raise ValueError(f"{len(text)} characters, more than {_MAX_LENGTH}")
    if any(map(_has_too_many_parts, text.split("\n"))):
        raise ValueError(_TOO_DEEP)
    try:
        tables = tomllib.loads(text)
    except RecursionError:
        raise ValueError(_TOO_DEEP) from None
    except tomllib.TOMLDecodeError as fault:
        raise tomllib.TOMLDecodeError(
            _TUPLE.sub(lambda found: ".".join(_PART_TOML.findall(found[0])), str(fault))
        ) from None
    level: list[object] = [tables]
    for _ in range(_MAX_DEPTH):
        level = [inner for one in level for inner in _child_values(one)]
        if not level:
            return tables
    raise ValueError(_TOO_DEEP)


_TUPLE, _PART_TOML = re.compile(r"\(('[^']*',? ?)+\)"), re.compile(r"'([^']*)'")
"""Key in an error message of `tomllib`, such as ``('run', 'speed')``, and its parts."""

_TOO_DEEP = f"tables or lists nested more than {_MAX_DEPTH} deep"


def _has_too_many_parts(line: str) -> bool:
    """Return whether a line has a key of thousands of parts: the memory of `tomllib` is quadratic in their number."""
    key = line.partition("=")[0]
    return key.count(".") > _PARTS and "," not in key


_PARTS = 1000


def _child_values(one: object) -> list[object]:
    if isinstance(one, dict):
        return [*cast("dict[str, object]", one).values()]
    return cast("list[object]", one) if isinstance(one, list) else []
