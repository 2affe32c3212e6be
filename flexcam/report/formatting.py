"""Numbers in words: units, and zeros without their rounding."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from rich.table import Table

_NOTHING = 1e-12
"""A length (m), an angle (rad), or a part of the largest number of a kind below this is the rounding of a zero."""

NOISE = 1e-9
"""Part of the largest lift below which the least one is not worth a word."""


def mm(value: float, digits: int = 6) -> str:
    """Return a length in millimetres; what is only the rounding of a zero is one."""
    return f"{0.0 if abs(value) < _NOTHING else 1e3 * value:.{digits}g}"


def clear(value: float, scale: float) -> float:
    """Return a number, or zero where it is the rounding of one."""
    return 0.0 if abs(value) < _NOTHING * scale else value


def fixed(value: float, decimals: int) -> str:
    """Return a number with the decimals of its column; a huge one, of a run that diverged, in few digits."""
    return f"{round(value, decimals) + 0.0:.{decimals}f}" if abs(value) < _HUGE else f"{value:.4g}"


def decimals(largest: float, usual: int) -> int:
    """Return how many decimals show four digits of the largest of some numbers."""
    return usual if largest < _NOTHING else max(usual, 3 - math.floor(math.log10(largest)))


_HUGE = 1e7
"""Size from which decimals say nothing."""


def degrees(angle: float) -> str:
    """Return an angle in degrees; what is only the rounding of a zero is one."""
    return f"{0.0 if abs(angle) < _NOTHING else math.degrees(angle):.4g}"


def told_apart(names: Sequence[str], beside: Sequence[str]) -> list[str]:
    """Return names that differ: as they are, with what stands beside them, or with a number."""
    if len(set(names)) == len(names):
        return list(names)
    longer = [f"{name}, {more}" if more else name for name, more in zip(names, beside, strict=True)]
    return longer if len(set(longer)) == len(names) else [f"{name} ({i})" for i, name in enumerate(longer, start=1)]


@dataclass(frozen=True)
class Told:
    """The answer of a study.

    Parameters
    ----------
    tables
        For rich.
    words
        Sentences below them.
    json
        The same as one object; null where there is no number.
    csv
        The same as a table of text.
    """

    tables: Sequence[Table]
    words: Sequence[str]
    json: Mapping[str, object]
    csv: str


def csv_of(head: Sequence[str], rows: Sequence[Sequence[object]]) -> str:
    r"""Return a table as CSV text; what has no number is left empty."""
    return "".join(",".join(map(_cell, row)) + "\n" for row in (head, *rows))


def _cell(value: object) -> str:
    number = or_none(value) if isinstance(value, float) else value
    text = "" if number is None else repr(number) if isinstance(number, float) else str(number)
    return '"' + text.replace('"', '""') + '"' if any(sign in text for sign in ',"\n') else text


def or_none(value: float) -> float | None:
    """Return a number for JSON: none where it is not finite."""
    return value if abs(value) < float("inf") else None


def shown(value: float, digits: int = 6) -> str:
    """Return a number for a table; a dash where there is none."""
    return "-" if or_none(value) is None else f"{value:.{digits}g}"
