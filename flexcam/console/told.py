"""What a study says, in every form a command may be asked for."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from rich.table import Table


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
