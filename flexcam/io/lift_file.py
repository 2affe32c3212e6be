"""Measured lift as text: two columns of angle and lift, with units in the head or given."""

from __future__ import annotations

import math
import re
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import numpy as np

from flexcam.checks import Fault, InputError, refuse
from flexcam.linalg import FloatArray

AngleKind = Literal["cam", "crank"]

_LENGTHS = {"um": 1e-6, "µm": 1e-6, "mm": 1e-3, "cm": 1e-2, "m": 1.0, "in": 0.0254, "inch": 0.0254, '"': 0.0254}
_DEGREE = math.pi / 180.0
_ANGLES = {"deg": _DEGREE, "°": _DEGREE, "degree": _DEGREE, "degrees": _DEGREE, "rad": 1.0}
_SEPARATOR = re.compile(r"[,;\t]|\s+")
_MOST_FAULTS = 5


@dataclass(frozen=True, eq=False)
class LiftColumns:
    """What a lift file holds, in SI.

    Parameters
    ----------
    angle
        Cam angle, rad, shape (n,).
    lift
        m, shape (n,).
    """

    angle: FloatArray
    lift: FloatArray


def read_lift(path: Path, *, angle: AngleKind | None = None, unit: str | None = None) -> LiftColumns:
    """Read a table of angle and lift.

    Rows of two numbers, divided by commas, semicolons, tabs or blanks; ``#`` begins a comment. A first row of names may
    say what they are, such as ``crank_deg, lift_mm``: an angle of ``cam`` or ``crank`` in ``deg`` or ``rad``, a lift in
    ``mm``, ``um``, ``m`` or ``in``. Without it, cam degrees and millimetres are not assumed: they must be given.

    Parameters
    ----------
    path
        The file.
    angle
        Of which shaft the angles are, where the head does not say so or is wrong; a crank turns twice as fast.
    unit
        Of the lift, where the head does not say so or is wrong.

    Returns
    -------
    LiftColumns
        Cam angles and lift.

    Raises
    ------
    InputError
        If the file cannot be read, a row is no pair of numbers, or angle or unit are not said.
    """
    lines = _lines(path)
    head = lines[0][1] if lines and not _numbers(lines[0][1]) else ""
    rows = lines[1:] if head else lines
    kind, to_rad = _angle(head, angle, path)
    scale = _length(head, unit, path)
    bad = [(number, text) for number, text in rows if not _numbers(text)]
    if bad:
        raise InputError(
            Fault(
                f"{path.name}, line {number}", repr(text[:40]), "an angle and a lift", "", "correct or remove the row"
            )
            for number, text in bad[:_MOST_FAULTS]
        )
    values = np.array([_numbers(text) for _, text in rows], dtype=float).reshape(-1, 2)
    return LiftColumns(values[:, 0] * to_rad * (0.5 if kind == "crank" else 1.0), values[:, 1] * scale)


def _lines(path: Path) -> list[tuple[int, str]]:
    """Return the rows that hold something, with their numbers."""
    try:
        text = path.read_text(encoding="utf-8-sig")
    except (OSError, UnicodeDecodeError) as fault:
        raise refuse("lift table", str(path), "a readable text file", str(fault)) from None
    rows = [(number, line.partition("#")[0].strip()) for number, line in enumerate(text.splitlines(), start=1)]
    return [(number, line) for number, line in rows if line]


def _numbers(text: str) -> tuple[float, float] | None:
    parts = [part for part in _SEPARATOR.split(text) if part]
    try:
        first, second = (float(part) for part in parts)
    except ValueError:
        return None
    return first, second


def _words(head: str) -> list[str]:
    return [word for word in re.split(r"[^a-zµ°\"]+", head.lower()) if word]


def _angle(head: str, given: AngleKind | None, path: Path) -> tuple[AngleKind, float]:
    words = _words(head)
    named: list[AngleKind] = [kind for kind in ("cam", "crank") if any(word.startswith(kind) for word in words)]
    kind = given or (named[0] if len(named) == 1 else None)
    if kind is None:
        remedy = 'add angle = "cam" or angle = "crank", or a first row such as cam_deg, lift_mm'
        why = "a crank turns twice as fast"
        raise refuse(f"{path.name}, angle", head or "no head", "cam or crank angles", why, remedy)
    return kind, next((_ANGLES[word] for word in words if word in _ANGLES), _DEGREE)


def _length(head: str, given: str | None, path: Path) -> float:
    named = [word for word in _words(head) if word in _LENGTHS]
    unit = given or (named[-1] if named else None)
    if unit not in _LENGTHS:
        remedy = 'add unit = "mm" or unit = "in", or a first row such as cam_deg, lift_mm'
        raise refuse(f"{path.name}, unit of the lift", unit or head or "no head", ", ".join(_LENGTHS), "", remedy)
    return _LENGTHS[unit]
