"""Format numbers: units, and zeros without rounding noise."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from rich.table import Table

_ROUNDING = 1e-12
"""Length (m), angle (rad) or fraction of the largest value of a kind below which a value is a rounded zero."""

NOISE = 1e-9
"""Negative lift relative to the maximum lift below which it is not reported."""


def format_mm(value: float, digits: int = 6) -> str:
    """Return a length in millimetres; rounding noise gives zero."""
    return f"{0.0 if abs(value) < _ROUNDING else 1e3 * value:.{digits}g}"


def remove_noise(value: float, scale: float) -> float:
    """Return a number; rounding noise relative to a scale gives zero."""
    return 0.0 if abs(value) < _ROUNDING * scale else value


def format_decimals(value: float, decimals: int) -> str:
    """Format a number with the decimals of its column; a huge one, of a diverged run, with few digits."""
    return f"{round(value, decimals) + 0.0:.{decimals}f}" if abs(value) < _HUGE else f"{value:.4g}"


def count_decimals(largest: float, usual: int) -> int:
    """Return the number of decimals that show four digits of the largest value."""
    return usual if largest < _ROUNDING else max(usual, 3 - math.floor(math.log10(largest)))


_HUGE = 1e7
"""Value above which decimals are omitted."""


def format_degrees(angle: float) -> str:
    """Return an angle in degrees; rounding noise gives zero."""
    return f"{0.0 if abs(angle) < _ROUNDING else math.degrees(angle):.4g}"


def make_unique(names: Sequence[str], beside: Sequence[str]) -> list[str]:
    """Make names unique: unchanged, with an additional text, or with a number."""
    if len(set(names)) == len(names):
        return list(names)
    longer = [f"{name}, {more}" if more else name for name, more in zip(names, beside, strict=True)]
    return longer if len(set(longer)) == len(names) else [f"{name} ({i})" for i, name in enumerate(longer, start=1)]


@dataclass(frozen=True)
class StudyOutput:
    """Output of a study command."""

    tables: Sequence[Table]  # tables for rich
    words: Sequence[str]  # sentences below the tables
    json: Mapping[str, object]  # content as one JSON object; null for missing numbers
    csv: str  # content as CSV text


def format_csv(head: Sequence[str], rows: Sequence[Sequence[object]]) -> str:
    r"""Return a table as CSV text with empty cells for missing numbers."""
    return "".join(",".join(map(_cell, row)) + "\n" for row in (head, *rows))


def _cell(value: object) -> str:
    number = finite_or_none(value) if isinstance(value, float) else value
    text = "" if number is None else repr(number) if isinstance(number, float) else str(number)
    return '"' + text.replace('"', '""') + '"' if any(sign in text for sign in ',"\n') else text


def finite_or_none(value: float) -> float | None:
    """Return a number for JSON; None if it is not finite."""
    return value if abs(value) < float("inf") else None


def format_number(value: float, digits: int = 6) -> str:
    """Format a number for a table; a dash if it is missing."""
    return "-" if finite_or_none(value) is None else f"{value:.{digits}g}"
