"""The terminal: results to standard output, a progress bar to standard error, tables without lines."""

from __future__ import annotations

import json
import os
import sys
from collections.abc import Callable, Generator, Iterable, Sequence
from contextlib import contextmanager
from functools import partial

from rich.console import Console
from rich.table import Table

from flexcam.response import Block, Sink, Stats, Status


def out() -> Console:
    """Return the console of results; tables keep one width where nobody reads along, and brackets are brackets.

    Returns
    -------
    Console
        On standard output.
    """
    width = None if sys.stdout.isatty() or "COLUMNS" in os.environ else 160
    return Console(file=sys.stdout, width=width, highlight=False, markup=False, soft_wrap=False)


def print_json(content: object) -> None:
    """Print one JSON object to standard output; numbers that are not finite are a fault of flexcam.

    Parameters
    ----------
    content
        What `json` can write.
    """
    sys.stdout.write(json.dumps(content, indent=2, allow_nan=False) + "\n")


class _Bar:
    """Sink that moves a progress bar."""

    def __init__(self, advance: Callable[[float], None]) -> None:
        self._advance = advance

    def write(self, block: Block) -> None:
        self._advance(len(block.time))

    def close(self, status: Status, stats: Stats) -> None:
        del status, stats


@contextmanager
def progress(steps: int) -> Generator[list[Sink]]:
    """Show a progress bar on standard error while a run goes on, if somebody sees it.

    Parameters
    ----------
    steps
        Of the whole run.

    Yields
    ------
    list
        The bar as a sink; empty where standard error is no terminal.
    """
    if not sys.stderr.isatty():
        yield []
        return
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, TimeRemainingColumn

    columns = ("steps", BarColumn(), MofNCompleteColumn(), TimeRemainingColumn())
    with Progress(*columns, console=Console(stderr=True), transient=True) as shown:
        yield [_Bar(partial(shown.advance, shown.add_task("steps", total=steps + 1)))]


@contextmanager
def counting(total: int | None, what: str) -> Generator[Callable[[int], None]]:
    """Show how many of many things are finished, their rate and the time left, if somebody sees it.

    Parameters
    ----------
    total
        How many there are; None where only the end will tell.
    what
        They are.

    Yields
    ------
    callable
        To be told how many more are finished; the first call says how many were before.
    """
    if total == 0 or not sys.stderr.isatty():
        yield lambda _: None
        return
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

    columns = (what, BarColumn(), MofNCompleteColumn(), TextColumn("{task.fields[rate]}"), TimeRemainingColumn())
    with Progress(*columns, console=Console(stderr=True), transient=True) as shown:
        task = shown.add_task(what, total=total, rate="")

        def advance(count: int) -> None:
            shown.advance(task, count)
            shown.update(task, rate=_rate(shown.tasks[0].speed))

        yield advance


def _rate(speed: float | None) -> str:
    """Return how many are finished per second, or how many seconds one takes."""
    if not speed:
        return ""
    return f"{speed:.1f}/s" if speed >= 1.0 else f"{1.0 / speed:.1f} s each"


def bare(title: str) -> Table:
    """Return a table without lines, as wide as its title at least.

    Parameters
    ----------
    title
        Above it.

    Returns
    -------
    Table
        Without columns.
    """
    made = Table(title=title, title_justify="left", title_style="bold", box=None, pad_edge=False, padding=(0, 3, 0, 0))
    made.min_width = len(title)
    return made


def table(title: str, columns: Sequence[str], rows: Iterable[Sequence[str]]) -> Table:
    """Return a plain table, first column to the left, numbers to the right.

    Parameters
    ----------
    title
        Above it.
    columns
        Heads.
    rows
        Cells.

    Returns
    -------
    Table
        For rich.
    """
    made = bare(title)
    for i, column in enumerate(columns):
        made.add_column(column, justify="left" if i == 0 else "right")
    for row in rows:
        made.add_row(*row)
    return made


def facts(title: str, rows: Iterable[tuple[str, str]]) -> Table:
    """Return a table of names and what is to be said of them.

    Parameters
    ----------
    title
        Above it.
    rows
        Name and text.

    Returns
    -------
    Table
        For rich.
    """
    made = bare(title)
    made.show_header = False
    made.add_column()
    made.add_column()
    for name, text in rows:
        made.add_row(name, text)
    return made
