"""Which line of a TOML text a key stands on; `tomllib` does not tell."""

from __future__ import annotations

import re

_TABLE = re.compile(r"\s*\[{1,2}\s*([^\]]+?)\s*\]{1,2}\s*(?:#.*)?$")
_KEY = re.compile(r"""\s*((?:[A-Za-z0-9_-]+|"[^"]*"|'[^']*')(?:\s*\.\s*(?:[A-Za-z0-9_-]+|"[^"]*"|'[^']*'))*)\s*=""")
_PART = re.compile(r"""[A-Za-z0-9_-]+|"[^"]*"|'[^']*'""")

Path = tuple[str, ...]


def line_numbers(text: str) -> dict[Path, int]:
    r"""Return the line of every table and key.

    Parameters
    ----------
    text
        A TOML document.

    Returns
    -------
    dict
        Key path to line, from 1; keys inside inline tables are not listed.

    Examples
    --------
    >>> line_numbers("[run]\nspeed = 3")
    {('run',): 1, ('run', 'speed'): 2}
    """
    lines: dict[Path, int] = {}
    table: Path = ()
    for number, line in enumerate(text.splitlines(), start=1):
        if header := _TABLE.match(line):
            table = _parts(header[1])
            lines.setdefault(table, number)
        elif key := _KEY.match(line):
            lines.setdefault(table + _parts(key[1]), number)
    return lines


def place(path: Path, lines: dict[Path, int]) -> str:
    """Return a key path with the line of its nearest listed ancestor.

    Parameters
    ----------
    path
        Key path.
    lines
        From `line_numbers`.

    Returns
    -------
    str
        Such as ``run.speed (line 12)``.

    Examples
    --------
    >>> place(("run", "speed", "x"), {("run", "speed"): 2})
    'run.speed.x (line 2)'
    """
    for end in range(len(path), 0, -1):
        if path[:end] in lines:
            return f"{'.'.join(path)} (line {lines[path[:end]]})"
    return ".".join(path) or "case file"


def _parts(dotted: str) -> Path:
    return tuple(part.strip("\"'") for part in _PART.findall(dotted))
