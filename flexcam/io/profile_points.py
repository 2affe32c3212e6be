"""Read the points of a cam profile: two columns, or x and y among those of a profile that flexcam wrote."""

from __future__ import annotations

import math
import re
from pathlib import Path

import numpy as np

from flexcam.checks import Fault, InputError, refuse, said
from flexcam.io.regular import lines_of
from flexcam.linalg import FloatArray

_LENGTHS = {"um": 1e-6, "mm": 1e-3, "cm": 1e-2, "m": 1.0, "in": 0.0254}
_MOST_FAULTS = 10


def read_profile(path: Path, *, unit: str | None = None) -> FloatArray:
    """Read the points of a profile."""
    try:
        lines = lines_of(path)
    except (OSError, UnicodeDecodeError) as fault:
        raise refuse("profile", str(path), "a readable text file", said(fault)) from None
    rows = [(number, _parts(line)) for number, line in enumerate(lines, start=1) if line.partition("#")[0].strip()]
    if not rows:
        raise refuse("profile", f"{path.name}, which is empty", "rows of x and y")
    head = [] if _numbers(rows[0][1], (0, 1)) else rows.pop(0)[1]
    columns = _columns(head, path)
    scale = _scale([head[column] for column in columns] if head else [], unit, path)
    bad = [Fault(f"{path.name}, line {number}", repr(",".join(parts)[:40]), "numbers", "", "correct or remove the row")
           for number, parts in rows if not _numbers(parts, columns)]  # fmt: skip
    if bad:
        raise InputError(bad[:_MOST_FAULTS])
    points = scale * np.array([_numbers(parts, columns) for _, parts in rows], dtype=float).reshape(-1, 2)
    closed = len(points) > 1 and bool(np.abs(points[0] - points[-1]).max() < 1e-9 * np.abs(points).max())
    return points[:-1] if closed else points


def _parts(line: str) -> list[str]:
    return [part.strip() for part in re.split(r"[,;\t]", line.partition("#")[0])]


def _numbers(parts: list[str], columns: tuple[int, int]) -> list[float]:
    """Return the two numbers of a row, or nothing."""
    try:
        found = [float(parts[column]) for column in columns]
    except (ValueError, IndexError):
        return []
    return found if all(map(math.isfinite, found)) else []


def _words(name: str) -> list[str]:
    return re.findall(r"[a-z]+", name.lower())


def _columns(head: list[str], path: Path) -> tuple[int, int]:
    if not head:
        return 0, 1
    found: list[int] = []
    for axis in "xy":
        named = [i for i, name in enumerate(head) if axis in _words(name)]
        own = [i for i in named if head[i].lower().startswith("profile")]
        if len(own or named) != 1:
            given = ", ".join(head)[:60]
            raise refuse(f"{path.name}, head", given, "one column x and one y, such as x [mm], y [mm]", "", "name them")
        found += own or named
    return found[0], found[1]


def _scale(head: list[str], given: str | None, path: Path) -> float:
    """Return the unit that the heads of both columns say, each by its last word that is one, or that is given."""
    words = [[word for word in _words(name) if word in _LENGTHS] for name in head]
    named = [given or "", *(word[-1] for word in words if word)]
    units = list(dict.fromkeys(unit for unit in named if unit))
    where = f"{path.name}, unit"
    if len(units) > 1:
        why, remedy = "x, y and --unit contradict each other", "leave --unit out, or correct the head"
        raise refuse(where, " and ".join(units), "one unit", why, remedy)
    if not units or units[0] not in _LENGTHS:
        remedy = "add --unit mm, or a first row such as x [mm], y [mm]"
        raise refuse(where, given or ", ".join(head)[:60] or "no head", ", ".join(_LENGTHS), "", remedy)
    return _LENGTHS[units[0]]
