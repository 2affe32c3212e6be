"""Text tables of numbers, as programs and data loggers write them: lifts, loads and measurements.

Commas, semicolons, tabs or blanks separate the numbers of a row; ``#`` starts a comment. Beside semicolons or tabs a
comma may be the decimal sign. Any lines may precede the table; the last of them may name its columns.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from flexcam.core import FloatArray
from flexcam.core.errors import Fault, InputError, refuse
from flexcam.core.units import is_unit
from flexcam.io.files import ABSCISSAS, read_source

Row = tuple[int, str]
"""Line number, counted from 1, and text of a row."""

_MAX_FAULTS = 10
_LONGEST_LINE = 10_000  # characters: the time of the patterns below grows with the square of a line
_SEPARATOR = re.compile(r"\s*[,;]\s*|[^\S\t]*\t[^\S\t]*|\s+")
_DECIMAL_COMMA = re.compile(r"[;\t].*\d,\d|\d,\d.*[;\t]")
"""A row with semicolons or tabs between its columns and a comma within a number."""
_LETTER = re.compile(r"[^\W\d_eE]")
_UNIT = re.compile(r"(.+?)\s*(?:\[(?P<any>.*)\]|\((?P<known>[^()]*)\)|_(?P<suffix>[^_\s]+))$")
"""Name of a column with its unit: ``crank angle [deg]``, ``pressure (bar)``, ``crank_deg``."""


@dataclass(frozen=True, eq=False)
class NumberTable:
    """Rows of numbers in a file."""

    head: str  #: line before the first row; empty if there is none
    names: Sequence[str]  #: names of the columns by the head; empty if it does not name each
    rows: Sequence[Row]  #: lines of the table
    #: numbers of each row, NaN for empty cells, without columns that are empty; empty if a row has anything else
    numbers: Sequence[Sequence[float]]
    width: int  #: number of columns

    def faulty(self, columns: Sequence[int] = ()) -> list[Row]:
        """Return the rows without a finite number, or an empty cell, per column; those named have no empty cells."""
        return [
            row
            for row, numbers in zip(self.rows, self.numbers, strict=True)
            if len(numbers) != self.width or np.isinf(numbers).any() or np.isnan([numbers[i] for i in columns]).any()
        ]

    def select(self, path: Path, columns: Sequence[int], allowed: str, remedy: str) -> FloatArray:
        """Return columns without empty cells, shape (rows, columns); raise an error for the first faulty rows."""
        if bad := self.faulty(columns)[:_MAX_FAULTS]:
            raise InputError(Fault(f"{path.name}, line {n}", repr(line[:40]), allowed, "", remedy) for n, line in bad)
        return np.array(self.numbers)[:, columns]


def read_rows(path: Path, where: str, content: str, text: str | None = None) -> list[Row]:
    """Return the rows of a file, or of its known text, without comments and empty lines.

    Lines are those of a text editor: `str.splitlines` also splits at characters such as U+0085.
    """
    lines = read_source(path, where, text).split("\n")
    if (longest := max(map(len, lines))) > _LONGEST_LINE:
        raise refuse(where, f"{path.name}, with a line of {longest} characters", f"lines of up to {_LONGEST_LINE}")
    rows = [(number, _remove_comment(line)) for number, line in enumerate(lines, start=1)]
    rows = [(number, line) for number, line in rows if line.strip()]
    if not rows:
        raise refuse(where, f"{path.name}, which is empty", content)
    return rows


def _remove_comment(line: str) -> str:
    """Return a line without its comment and outer blanks; the # of ``push #1 [N]`` in a header line is none."""
    before, _, after = line.partition("#")
    in_name = before.strip() and after[:1].strip() and not _numbers(before)
    text = (line if in_name else before).lstrip()
    return re.sub(r"[^\S\t]+$", "", text)  # a tab at the end belongs to an empty cell


def find_table(rows: Sequence[Row]) -> NumberTable:
    """Return the table in the rows of a file: the first three successive rows of as many numbers, two or more."""
    plain = [line for _, line in rows if not _LETTER.search(line)]  # a preamble has dates and versions
    if any(map(_DECIMAL_COMMA.search, plain)) and not any(re.search(r"\d\.\d", line) for line in plain):
        rows = [(number, re.sub(r"(?<=\d),(?=\d)", ".", line)) for number, line in rows]
    numbers = [_numbers(line) for _, line in rows]
    counts = [len(row) for row in numbers]
    runs = zip(counts, counts[1:], counts[2:], strict=False)
    width = next((a for a, b, c in runs if a == b == c > 1), next(filter(None, counts), 0))
    start = counts.index(width)
    head = rows[start - 1][1] if start and not numbers[start - 1] else ""
    complete = [row for row in numbers[start:] if len(row) == width]
    columns = [i for i in range(width) if not all(np.isnan(row[i]) for row in complete)]
    values = [[row[i] for i in columns] if len(row) == width else [] for row in numbers[start:]]
    return NumberTable(head, _split_names(head, len(columns)), rows[start:], values, len(columns))


def _numbers(text: str) -> list[float]:
    """Return the numbers of a row, NaN for empty cells; empty if it has anything else."""
    parts = [part.strip('"') for part in _SEPARATOR.split(text)]
    try:
        return [float(part) if part else np.nan for part in parts] if any(parts) else []
    except ValueError:
        return []


def _split_names(head: str, width: int) -> list[str]:
    """Return the names of a number of columns; empty if the head has another number of them."""
    for separator in (r"[,;\t]", r"\s{2,}", r"\s+"):
        parts = [part.strip() for part in re.split(separator, head) if part.strip()]
        if len(parts) == width:
            return parts
    return []


def read_columns(path: Path, where: str, text: str | None = None) -> dict[str, tuple[str, FloatArray]]:
    """Read a table, or its known text, whose header line is such as ``time [s],valve displacement [mm]`` or ``time_s``.

    It returns unit and values by name. Empty cells are NaN.
    """
    allowed = "a header line with 'NAME [UNIT]' or NAME_UNIT per column, and rows of as many numbers"
    table = find_table(read_rows(path, where, allowed, text))
    if not table.width or not table.names:
        given = f"the header line {table.head!r}" if table.width else "without rows"
        raise refuse(where, f"{path.name}, {given}", allowed)
    for number, line in table.faulty():
        allowed = f"a finite number for each column: {', '.join(table.names)}"
        raise refuse(where, f"{path.name}, line {number}: {line[:40]!r}", allowed)
    columns = [_name_and_unit(name.strip('"')) for name in table.names]
    if len(dict(columns)) < len(columns):
        raise refuse(where, ", ".join(table.names), allowed, "a name is given twice")
    return {name: (unit, values) for (name, unit), values in zip(columns, np.array(table.numbers).T, strict=True)}


def _name_and_unit(text: str) -> tuple[str, str]:
    """Return the name of a column, that of an abscissa as in `ABSCISSAS`, and its unit; empty if it has none."""
    match = _UNIT.match(text)
    valid = match and (match["any"] is not None or is_unit(match["known"] or match["suffix"] or ""))
    name, unit = (match[1], match["any"] or match["known"] or match["suffix"] or "") if match and valid else (text, "")
    plain = name.lower().replace("_", " ")
    plain = {"cam": "cam angle", "crank": "crank angle"}.get(plain, plain)
    return plain if plain in ABSCISSAS else name, unit
