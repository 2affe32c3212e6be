"""Measured lift tables: text files with two columns of angle and lift, with units in the header or as arguments."""

from __future__ import annotations

import math
import re
import unicodedata
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import numpy as np

from flexcam.core import FloatArray
from flexcam.core.errors import Fault, InputError, refuse, system_message
from flexcam.io.atomic_write import atomic_write_path
from flexcam.io.paths import check_writable, create_folder, read_lines

AngleKind = Literal["cam", "crank"]

_LENGTHS = {"um": 1e-6, "μm": 1e-6, "mm": 1e-3, "cm": 1e-2, "m": 1.0, "in": 0.0254, "inch": 0.0254, '"': 0.0254}
_DEGREE = math.pi / 180.0
_ANGLES = {"deg": _DEGREE, "°": _DEGREE, "degree": _DEGREE, "degrees": _DEGREE, "rad": 1.0}
_SEPARATOR = re.compile(r"[,;\t]|\s+")
_MAX_FAULTS = 10
_DECIMAL_COMMA = re.compile(r"\d,\d+\s*[;\t]")


@dataclass(frozen=True, eq=False)
class LiftColumns:
    """Content of a lift file in SI units.

    Parameters
    ----------
    angle
        Cam angle, rad, shape (n,).
    lift
        Lift, m, shape (n,).
    lines
        Line numbers in the file, counted from 1, length n.
    """

    angle: FloatArray
    lift: FloatArray
    lines: tuple[int, ...]


def read_lift(path: Path, *, angle: AngleKind | None = None, unit: str | None = None) -> LiftColumns:
    """Read a table of angle and lift.

    Rows of two numbers, divided by commas, semicolons, tabs or blanks; ``#`` begins a comment. A first row of names may
    Rows contain two numbers separated by commas, semicolons, tabs or blanks; ``#`` starts a comment. An optional header
    names the columns, such as ``crank_deg, lift_mm``: an angle of ``cam`` or ``crank`` in ``deg`` or ``rad``, a lift in
    ``mm``, ``um``, ``m`` or ``in``. Without a header, both units must be given as arguments; there is no default.
    """
    lines = _lines(path)
    if not lines:
        raise refuse("lift table", f"{path.name}, which is empty", "rows of angle and lift")
    head = lines[0][1] if not _numbers(lines[0][1]) else ""
    rows = lines[1:] if head else lines
    of_angle, of_lift = _columns(head, path)
    kind, to_rad = _angle(of_angle, angle, head, path)
    scale = _length(of_lift, unit, head, path)
    bad = [(number, text) for number, text in rows if not _numbers(text)]
    if bad:
        raise InputError(
            Fault(f"{path.name}, line {number}", repr(text[:40]), "an angle and a lift", "", _suggest_remedy(text))
            for number, text in bad[:_MAX_FAULTS]
        )
    values = np.array([_numbers(text) for _, text in rows], dtype=float).reshape(-1, 2)
    return LiftColumns(values[:, 0] * to_rad * (0.5 if kind == "crank" else 1.0), values[:, 1] * scale,
                       tuple(number for number, _ in rows))  # fmt: skip


def write_lift_table(path: Path, angle: FloatArray, lift: FloatArray, *, overwrite: bool = False) -> Path:
    """Write a table of angle and lift that `read_lift` reads."""
    if path.suffix != ".csv":
        raise refuse("output", str(path), "a name that ends in .csv", "a case tells a table by it")
    check_writable("output", path, overwrite=overwrite)
    create_folder(path.parent)
    rows = np.column_stack([np.degrees(angle), 1e3 * lift])
    with atomic_write_path(path) as draft:
        np.savetxt(draft, rows, fmt="%.12g", delimiter=",", header="cam_deg,lift_mm", comments="")
    return path


def _lines(path: Path) -> list[tuple[int, str]]:
    """Return the non-empty rows with their line numbers."""
    try:
        lines = read_lines(path)
    except (OSError, UnicodeDecodeError) as fault:
        raise refuse("lift table", str(path), "a readable text file", system_message(fault)) from None
    rows = [(number, line.partition("#")[0].strip()) for number, line in enumerate(lines, start=1)]
    return [(number, line) for number, line in rows if line]


def _suggest_remedy(row: str) -> str:
    if _DECIMAL_COMMA.search(row):
        return "write decimal points: 90.5; 1.25"
    return "correct or remove the row"


def _numbers(text: str) -> tuple[float, float] | None:
    parts = [part for part in _SEPARATOR.split(text) if part]
    try:
        first, second = (float(part) for part in parts)
    except ValueError:
        return None
    return first, second


def _columns(head: str, path: Path) -> tuple[str, str]:
    """Return the headers of both columns; empty strings without a header."""
    parts = [part.strip() for part in re.split(r"[,;\t]", head) if part.strip()]
    parts = parts if len(parts) == 2 else head.split()
    if not head:
        return "", ""
    if len(parts) != 2:
        raise refuse(f"{path.name}, head", repr(head), "two names, such as cam_deg, lift_mm", "there are two columns")
    if _header_words(parts[1])[:1] in (["cam"], ["crank"], ["angle"]) or "lift" in _header_words(parts[0]):
        raise refuse(f"{path.name}, head", repr(head), "the angle first, then the lift", "", "swap the columns")
    return parts[0], parts[1]


def _header_words(head: str) -> list[str]:
    plain = unicodedata.normalize("NFKC", head).lower()  # Unicode has two micro signs
    return [word for word in re.split(r"[^a-zμ°\"]+", plain) if word]


def _angle(column: str, given: AngleKind | None, head: str, path: Path) -> tuple[AngleKind, float]:
    words = _header_words(column)
    named: list[AngleKind] = [kind for kind in ("cam", "crank") if any(word.startswith(kind) for word in words)]
    kind = given or (named[0] if len(named) == 1 else None)
    if kind is None:
        remedy = 'add angle = "cam" or angle = "crank", or a first row such as cam_deg, lift_mm'
        why = "a crank turns twice as fast"
        raise refuse(f"{path.name}, angle", head or "no head", "cam or crank angles", why, remedy)
    strange = [word for word in words if word in ("grad", "gon", "rev", "revs", "turn", "turns", "min")]
    if strange:
        raise refuse(f"{path.name}, angle", repr(head), "degrees (deg) or radians (rad)", "", "convert the column")
    return kind, next((_ANGLES[word] for word in words if word in _ANGLES), _DEGREE)


def _length(column: str, given: str | None, head: str, path: Path) -> float:
    named = [word for word in _header_words(column) if word in _LENGTHS]
    unit = given or (named[-1] if named else None)
    if unit not in _LENGTHS:
        remedy = 'add unit = "mm" or unit = "in", or a first row such as cam_deg, lift_mm'
        raise refuse(f"{path.name}, unit of the lift", unit or head or "no head", ", ".join(_LENGTHS), "", remedy)
    return _LENGTHS[unit]
