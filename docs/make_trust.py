"""Make ``docs/trust.md`` from ``docs/trust.json``, first brought up to date from the last test run.

``python docs/make_trust.py``: rows of tests that ran replace the earlier ones; those of tests that did not run (the
slow ones, on most days) are kept, and those of tests that no longer exist are dropped.
"""

from __future__ import annotations

import ast
import json
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
RECORDED = ROOT / "build/trust.json"
KEPT = ROOT / "docs/trust.json"
PAGE = ROOT / "docs/trust.md"

HEAD = """# Robustness tests

This page lists the damaged, hostile and random input and the machine faults that tests try, with the outcome. `make trust`
generates it from `docs/trust.json`. Tests record a row with the fixture `tried` after their assertions; the count is the number of
inputs or faults in the last run of the test.
"""

KINDS = {
    "mutated": ("Mutated input", "Random changes of cases, meshes and results, with fixed seeds. flexcam accepts or refuses each with a message of its own, within ten seconds and a memory limit."),
    "planted": ("Invalid input", "One fault per input. The message names the place, the given value, the permitted values and the remedy."),
    "damaged": ("Damaged results", "Results with flipped bits, cut-off files and files of other formats. flexcam refuses the file, or reads correct data."),
    "hostile": ("Hostile files", "Files that try to execute code, read other files or exhaust memory."),
    "killed": ("Killed and interrupted runs", "The test reads the remaining files and compares them with those of an uninterrupted run."),
    "machine": ("Disks, folders, memory, time", "Failures of disk, folder, memory or time, with the message and the remaining files."),
    "together": ("Concurrent processes", "Processes that write at the same time."),
}  # fmt: skip
"""Parts of the page, in order: heading and words."""


def function(row: dict) -> str:
    """Return file and function of a row's test, without parameters."""
    return row["test"].partition("[")[0]


def existing() -> set[str]:
    """Return all test functions, as ``file::name``."""
    found = set()
    for path in (ROOT / "tests").rglob("test_*.py"):
        tree = ast.parse(path.read_text(encoding="utf-8"))
        names = (node.name for node in tree.body if isinstance(node, ast.FunctionDef))
        found |= {f"{path.relative_to(ROOT)}::{name}" for name in names if name.startswith("test_")}
    return found


def merged(kept: list[dict], recorded: list[dict]) -> list[dict]:
    """Return the rows that ran, and of those kept the ones whose test did not run but exists, in the page's order."""
    ran, known = {row["test"] for row in recorded}, existing()
    rows = [row for row in kept if row["test"] not in ran and function(row) in known] + recorded
    kinds = list(KINDS)
    return sorted(rows, key=lambda row: (kinds.index(row["kind"]), function(row), row["what"]))


def cell(text: str) -> str:
    return text.replace("|", "\\|").replace("<", "&lt;")


def table(rows: list[dict], kind: str) -> list[str]:
    head, words = KINDS[kind]
    lines = [f"## {head}", "", words, "", "| input or fault | count | outcome | test |", "|---|---|---|---|"]
    for row in rows:
        count = f"{row['count']:,}".replace(",", " ")
        test = function(row).removeprefix("tests/")
        lines.append(f"| {cell(row['what'])} | {count} | {cell(row['outcome'])} | `{test}` |")
    return [*lines, ""]


def page(rows: list[dict]) -> str:
    """Return the text of the page."""
    parts = [HEAD]
    for kind in KINDS:
        if its := [row for row in rows if row["kind"] == kind]:
            parts += table(its, kind)
    return "\n".join(parts)


def read(path: Path) -> list[dict]:
    return json.loads(path.read_text(encoding="utf-8")) if path.exists() else []


if __name__ == "__main__":
    rows = merged(read(KEPT), read(RECORDED))
    KEPT.write_text(json.dumps(rows, indent=1, ensure_ascii=False) + "\n", encoding="utf-8")
    PAGE.write_text(page(rows), encoding="utf-8")
