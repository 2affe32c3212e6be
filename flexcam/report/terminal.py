"""Format numbers and tables for the terminal, CSV and JSON."""

from __future__ import annotations

import csv
import io
import json
import math
import os
import sys
from collections.abc import Callable, Generator, Iterable, Sequence
from contextlib import contextmanager, suppress
from dataclasses import asdict, dataclass, is_dataclass
from pathlib import Path
from textwrap import fill
from typing import Any, cast

import numpy as np
from rich.console import Console
from rich.table import Table
from rich.text import Text

from flexcam.core.errors import printable
from flexcam.core.units import ROUNDING
from flexcam.dynamics import Block, Sink, Stats, Status

_HUGE = 1e7  # value above which decimals are omitted
_NUMBER = 14  # maximum length of a cell that counts as a number, with its unit, characters; longer ones may wrap
_WORDS = 40  # width that a column of words needs at least, characters
_GAP = 3  # between columns
NOISE = 1e-9  # negative lift relative to the maximum lift below which it is not reported


def remove_noise(value: float, scale: float) -> float:
    """Return a number; rounding noise relative to a scale gives zero."""
    return 0.0 if abs(value) < ROUNDING * scale else value


def format_decimals(value: float, decimals: int) -> str:
    """Format a number with the decimals of its column; a huge one, of a diverged run, with few digits."""
    return f"{round(value, decimals) + 0.0:.{decimals}f}" if abs(value) < _HUGE else f"{value:.4g}"


def count_decimals(largest: float, usual: int) -> int:
    """Return the number of decimals that show four digits of the largest value."""
    return usual if largest < ROUNDING else max(usual, 3 - math.floor(math.log10(largest)))


def make_unique(names: Sequence[str], beside: Sequence[str]) -> list[str]:
    """Make names unique: unchanged, with an additional text, or with a number."""
    if len(set(names)) == len(names):
        return list(names)
    longer = [f"{name}, {extra}" if extra else name for name, extra in zip(names, beside, strict=True)]
    return longer if len(set(longer)) == len(names) else [f"{name} ({i})" for i, name in enumerate(longer, start=1)]


def format_csv(head: Sequence[str], rows: Iterable[Sequence[object]]) -> str:
    """Return a table as CSV text with empty cells for missing numbers."""
    text = io.StringIO()
    csv.writer(text, lineterminator="\n").writerows([head, *(map(json_value, row) for row in rows)])
    return text.getvalue()


def format_number(value: float, digits: int = 6) -> str:
    """Format a number for a table; a dash if it is missing."""
    return f"{value:.{digits}g}" if math.isfinite(value) else "-"


def with_unit(name: str, unit: str) -> str:
    """Return a name with its unit, such as ``masses.valve.mass, kg``."""
    return f"{name}, {unit}" if unit else name


def result_console() -> Console:
    """Return the console for results; redirected tables have a fixed width, and brackets are not markup."""
    width = None if sys.stdout.isatty() or "COLUMNS" in os.environ else 100
    return _ResultConsole(file=sys.stdout, width=width, highlight=False, markup=False, emoji=False, soft_wrap=False)


class _ResultConsole(Console):
    """Console that removes control sequences from texts of files, and leaves a broken pipe to the command line."""

    def render_str(self, text: str, **style: Any) -> Text:  # noqa: ANN401 - as rich has them
        """Return a text without control sequences."""
        return super().render_str(printable(text), **style)

    def on_broken_pipe(self) -> None:
        """Raise the error, which rich would hide."""
        raise BrokenPipeError


def print_message(sentence: str) -> None:
    """Print a message on standard error."""
    with suppress(OSError):  # full or closed stream; the exit code remains
        sys.stderr.write(printable(f"{sentence}\n"))


def print_json(content: object) -> None:
    """Print one JSON object to standard output."""
    sys.stdout.write(json.dumps(json_value(content), indent=2, allow_nan=False) + "\n")


def json_value(value: object) -> object:
    """Return a value as JSON has it: dataclasses and arrays as plain values, None for numbers that are not finite."""
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    if isinstance(value, dict):
        return {key: json_value(item) for key, item in cast("dict[str, object]", value).items()}
    if isinstance(value, list | tuple):
        return [json_value(item) for item in cast("list[object]", value)]
    if isinstance(value, np.ndarray | np.generic):
        return json_value(cast("Any", value).tolist())
    if is_dataclass(value):
        return json_value(asdict(cast("Any", value)))
    return str(value) if isinstance(value, Path) else value


@dataclass(frozen=True)
class _ProgressSink:
    advance: Callable[[int], None]

    def write(self, block: Block) -> None:
        """Count the instants of a block."""
        self.advance(len(block.time))

    def close(self, status: Status, stats: Stats) -> None:
        """Do nothing: the bar ends with its context."""


@contextmanager
def show_progress(steps: int) -> Generator[list[Sink]]:
    """Show a progress bar on standard error during a run, if it is a terminal."""
    with show_count(steps + 1, "steps") as advance:
        yield [_ProgressSink(advance)] if sys.stderr.isatty() else []


@contextmanager
def show_count(total: int | None, what: str) -> Generator[Callable[[int], None]]:
    """Show the number of finished items, their rate and the remaining time, if standard error is a terminal."""
    if total == 0 or not sys.stderr.isatty():
        yield lambda _: None
        return
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

    columns = (what, BarColumn(), MofNCompleteColumn(), TextColumn("{task.fields[rate]}"), TimeRemainingColumn())
    with Progress(*columns, console=Console(stderr=True), transient=True) as bar:
        task = bar.add_task(what, total=total, rate="")

        def advance(count: int) -> None:
            bar.advance(task, count)
            speed = bar.tasks[0].speed or 0.0
            bar.update(task, rate=f"{speed:.1f}/s" if speed >= 1.0 else f"{1.0 / speed:.1f} s each" if speed else "")

        yield advance


def _create_table(title: str) -> Table:
    """Return a table without lines, at least as wide as its title."""
    gap = (0, _GAP, 0, 0)
    table = Table(title=title, title_justify="left", title_style="bold", box=None, pad_edge=False, padding=gap)
    table.min_width = len(printable(title))
    return table


def plain_table(title: str, columns: Sequence[str], rows: Iterable[Sequence[str | float]]) -> Table:
    """Return a plain table of texts and numbers with the first column aligned left and numbers aligned right."""
    table = _create_table(title)
    cells = [[cell if isinstance(cell, str) else format_number(cell) for cell in row] for row in rows]
    longest = [max((len(row[i]) for row in cells), default=0) for i in range(len(columns))]
    limit = result_console().width
    unbroken = sum(size + 1 for size in longest if size <= _NUMBER) <= limit  # otherwise their digits are wrapped
    widths, gap = _column_widths(columns, longest, limit)
    table.padding = (0, gap, 0, 0)
    for i, (head, size, width) in enumerate(zip(columns, longest, widths, strict=True)):
        justify = "left" if i == 0 or (i == len(columns) - 1 and size > _NUMBER) else "right"
        no_wrap, narrow = unbroken and size <= _NUMBER, width if size <= _NUMBER else None
        table.add_column(fill(head, max(width, 1)), justify=justify, width=narrow, no_wrap=no_wrap, overflow="fold")
    for row in cells:
        table.add_row(*row)
    return table


def _column_widths(heads: Sequence[str], longest: Sequence[int], limit: int) -> tuple[list[int], int]:
    """Return column widths and their gap; headers and words are wrapped as far as necessary, numbers never.

    Columns of words become narrow first. In a terminal that is too narrow for the rest, headers break inside a word.
    """
    words = [max(map(len, head.split()), default=1) for head in heads]
    tries = [(_WORDS, list(map(len, heads)), _GAP), *((wide, words, 2) for wide in range(_WORDS, _NUMBER, -1))]
    tries += [(_NUMBER, [min(letters, word) for word in words], 1) for letters in range(max(words), 0, -1)]
    lower, gap = list[int](), _GAP
    for wide, of_heads, gap in tries:
        lower = [max(min(size, wide), letters) for size, letters in zip(longest, of_heads, strict=True)]
        if sum(lower) + gap * (len(lower) - 1) <= limit:
            break
    widths = [max(len(head), size) for head, size in zip(heads, longest, strict=True)]
    for i in sorted(range(len(heads)), key=lambda i: lower[i] - widths[i]):  # the longest first
        widths[i] -= min(widths[i] - lower[i], max(sum(widths) + gap * (len(widths) - 1) - limit, 0))
    return widths, gap


def facts_table(title: str, rows: Iterable[tuple[str, str]]) -> Table:
    """Return a table of names and values."""
    table = _create_table(title)
    table.show_header = False
    for row in rows:
        table.add_row(*row)
    return table
