"""Update ``docs/extremes.csv`` from the last test run and make ``docs/extremes.md`` from it.

``python docs/make_extremes.py``: rows of tests that ran replace the earlier ones. Rows of tests that did not run (often
slow ones) remain, and rows of tests that no longer exist are removed.
"""

from __future__ import annotations

from itertools import groupby

from manual.rows import ROOT, Row, function, join_texts, markdown_table, merge_rows, read, read_recorded, write

TESTS = ROOT / "tests/extremes"
RECORDED = ROOT / "build/extremes.json"
KEPT = ROOT / "docs/extremes.csv"
PAGE = ROOT / "docs/extremes.md"

HEAD = """# Extreme parameters: right, warning, refused

Deviations are relative unless a unit is given. A line summarizes the rows of a test, with the beginning of a message;
[extremes.csv](extremes.csv) has all {count} rows and messages with their tests in `tests/extremes`, which give the reasons for the
tolerances. `make extremes` generates this page.
"""
EXTREMES = (
    "step times frequency", "steps per revolution", "camshaft speed", "many revolutions", "ratio of masses",
    "ratio of stiffnesses", "slenderness of a beam", "elements per span", "axial load", "damping",
    "jumps of the parabolic law", "restart", "scale of the units", "a run that diverges",
)  # fmt: skip
"""Extremes in the order of the page."""

PARTS = {
    "right": ("Right", "The result agrees with theory."),
    "warns": ("Warns", "The run continues and prints a warning."),
    "refuses": (
        "Refuses",
        "flexcam prints cause and remedy instead of a result. Exit code 2 for invalid input, 3 for a failed run.",
    ),
    "not yet": ("Not yet", "The expected behaviour is missing; the tests are marked."),
}
SHOWN = 3
"""Maximum number of rows whose values a line shows; with more rows it shows the first one."""
WORDS = 8
"""Maximum number of words of a message in a line."""


def sort_rows(rows: list[Row]) -> list[Row]:
    """Return the rows in the order of the page."""
    rows = [{name: value for name, value in row.items() if name != "place"} for row in rows]
    return sorted(rows, key=lambda row: (EXTREMES.index(row["extreme"]), function(row)))


def section(row: Row) -> str:
    return row["outcome"] if row["holds"] else "not yet"


def shorten(message: str) -> str:
    """Return the beginning of a message."""
    words = message.split()
    return message if len(words) <= WORDS else " ".join(words[:WORDS]).rstrip(",;:") + " ..."


def line(rows: list[Row]) -> list[str]:
    """Return the cells of a line that summarizes the rows of a test."""
    first, more = rows[0], f" and {len(rows) - 1} more" if len(rows) > 1 else ""
    show_all = len(rows) <= SHOWN
    given = join_texts([row["given"] for row in rows]) if show_all else first["given"] + more
    messages = shorten(first["happens"]) + (f" (first of {len(rows)})" if more else "")
    happens = join_texts([row["happens"] for row in rows]) if show_all and section(first) == "right" else messages
    return [first["extreme"], given, happens]


def merge_lines(lines: list[list[str]]) -> list[list[str]]:
    """Return the lines with those of the same extreme and behaviour merged."""
    groups = groupby(lines, lambda cells: (cells[0], cells[2]))
    return [[extreme, "; ".join(cells[1] for cells in group), behaviour] for (extreme, behaviour), group in groups]


def page(rows: list[Row]) -> str:
    """Return the text of the page."""
    parts = [HEAD.format(count=len(rows))]
    for part, (head, words) in PARTS.items():
        selected = [row for row in rows if section(row) == part]
        lines = [line(list(group)) for _, group in groupby(selected, lambda row: (row["extreme"], function(row)))]
        if lines:
            lines = merge_lines(lines)
            parts.append(f"## {head}\n\n{words}\n")
            parts.append(markdown_table(("extreme", "value", "behaviour"), lines) + "\n")
    return "\n".join(parts)


if __name__ == "__main__":
    rows = sort_rows(merge_rows(read(KEPT), read_recorded(RECORDED), TESTS))
    if failed := [row["test"] for row in rows if not row["holds"] and not row["known"]]:
        message = f"these tests failed; the page shows assertions that hold: {failed}"
        raise SystemExit(message)
    write(rows, KEPT)
    PAGE.write_text(page(rows), encoding="utf-8")
