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


def sort_faults(faults: Iterable[Fault]) -> list[Fault]:
    """Return faults sorted by line; faults without a line come last."""

    def line(fault: Fault) -> float:
        found = re.search(r" \(line (\d+)\)", fault.where)
        return int(found[1]) if found else math.inf

    return sorted(faults, key=line)


def _parts(dotted: str) -> Path:
    return tuple(part.strip("\"'") for part in _PART.findall(dotted))


_MAX_DEPTH = 30
"""Maximum nesting depth of tables and lists; a case has five."""

_MAX_KEY_PARTS = 1000
"""Maximum parts of a dotted key: the memory of `tomllib` is quadratic in their number."""

_MAX_LENGTH = 1 << 26
"""Maximum length of a text, characters."""

_TOO_DEEP = f"tables or lists nested more than {_MAX_DEPTH} deep"

_TUPLE = re.compile(r"\(('[^']*',? ?)+\)")
"""Key in an error message of `tomllib`, such as ``('run', 'speed')``."""


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
        message = _TUPLE.sub(lambda found: ".".join(re.findall(r"'([^']*)'", found[0])), str(fault))
        raise tomllib.TOMLDecodeError(message) from None
    level: list[object] = [tables]
    for _ in range(_MAX_DEPTH):
        level = [inner for value in level for inner in _inner_values(value)]
        if not level:
            return tables
    raise ValueError(_TOO_DEEP)


def _inner_values(value: object) -> list[object]:
    if isinstance(value, dict):
        return [*cast("dict[str, object]", value).values()]
    return cast("list[object]", value) if isinstance(value, list) else []
