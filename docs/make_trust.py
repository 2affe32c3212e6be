"""Update ``docs/trust.csv`` from the last test run and make ``docs/trust.md`` from it.

``python docs/make_trust.py``: rows of tests that ran replace the earlier ones. Rows of tests that did not run (often
slow ones) remain, and rows of tests that no longer exist are removed.
"""

from __future__ import annotations

import subprocess
import sys
from itertools import groupby

from manual.rows import ROOT, Row, function, join_texts, markdown_table, merge_rows, read, read_recorded, write

RECORDED = ROOT / "build/trust.json"
KEPT = ROOT / "docs/trust.csv"
PAGE = ROOT / "docs/trust.md"

HEAD = """# Robustness

flexcam guarantees:

- **No silent fault.** flexcam refuses an invalid case, mesh, lift table or result with a message that has the place, the given and the
  permitted value, and the remedy. One report lists all errors, except those that depend on others; the check of equilibrium follows.
- **Nothing is lost.** flexcam overwrites no file without `--overwrite`, and keeps the steps of [unfinished runs](restart.md).
- **No wrong number from a damaged file.** Results and tables of sweeps have [checksums](security.md#integrity).
- **No harm from files of others.** flexcam executes no code from cases and results, and reads only [files in permitted
  folders](security.md#cases).
- **Bounded time and memory.** flexcam refuses [runs that do not fit](long-runs.md#memory-and-disk).
- **No collisions.** Parallel runs in threads and processes equal single runs to rounding; two writers of one file cannot mix.

The tables count the tests of the last test run. A line summarizes the rows of a test that have the same outcome;
[trust.csv](trust.csv) has all rows with their tests. `make trust` generates this page.
"""

KINDS = {
    "mutated": ("Mutated input", "Random changes with fixed seeds. flexcam accepts each input or refuses it with one of its messages, within ten seconds and a memory limit."),
    "planted": ("Invalid input", "One fault per input."),
    "damaged": ("Damaged results", "flexcam refuses the file, or reads correct data."),
    "hostile": ("Hostile files", "Files that try to execute code, read other files or exhaust memory."),
    "killed": ("Killed and interrupted runs", "The test reads the remaining files and compares them with those of an uninterrupted run."),
    "machine": ("Disks, folders, memory, time", "The tests check the message and the remaining files."),
    "together": ("Concurrent processes", "Threads and processes that run or write at the same time."),
}  # fmt: skip
"""Parts of the page in order, with heading and text."""

SHOWN = 3
"""Maximum number of inputs or faults with one outcome that a line names; with more it names the first two."""


def sort_rows(rows: list[Row]) -> list[Row]:
    """Return the rows in the order of the page."""
    kinds = list(KINDS)
    return sorted(rows, key=lambda row: (kinds.index(row["kind"]), function(row), row["what"]))


def line(rows: list[Row]) -> list[str]:
    """Return the cells of a line that summarizes the rows of one test with one outcome."""
    count = f"{sum(row['count'] for row in rows):,}".replace(",", " ")
    shown = rows if len(rows) <= SHOWN else rows[: SHOWN - 1]
    more = f"; {len(rows) - len(shown)} more" if len(shown) < len(rows) else ""
    return [join_texts([row["what"] for row in shown]) + more, count, rows[0]["outcome"]]


def page(rows: list[Row]) -> str:
    """Return the text of the page."""
    parts = [HEAD]
    for kind, (head, words) in KINDS.items():
        selected = [row for row in rows if row["kind"] == kind]
        lines = [line(list(group)) for _, group in groupby(selected, lambda row: (function(row), row["outcome"]))]
        if lines:
            parts.append(f"## {head}\n\n{words}\n")
            parts.append(markdown_table(("input or fault", "count", "outcome"), lines) + "\n")
    return "\n".join(parts)


def collect_tests() -> set[str]:
    """Return the ids of all tests."""
    arguments = ["-m", "pytest", "--collect-only", "-q", "-m", "slow or not slow", "tests"]
    output = subprocess.run([sys.executable, *arguments], cwd=ROOT, capture_output=True, text=True, check=True)
    return set(output.stdout.splitlines())


if __name__ == "__main__":
    ids = collect_tests()
    kept = [row for row in read(KEPT) if row["test"] in ids]
    rows = sort_rows(merge_rows(kept, read_recorded(RECORDED), ROOT / "tests", lambda row: row["test"]))
    write(rows, KEPT)
    PAGE.write_text(page(rows), encoding="utf-8")
