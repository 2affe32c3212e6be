"""Rows that tests record for the generated pages: those of the last run (JSON) and those kept with the pages (CSV)."""

from __future__ import annotations

import ast
import csv
import json
import math
from collections.abc import Callable, Collection
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parents[2]
RECORDED = ROOT / "build/verification.json"
KEPT = ROOT / "docs/verification/rows.csv"
VERIFICATION = ROOT / "tests/verification"

Row = dict
TYPES: dict[str, Callable[[str], Any]] = {
    "reference": float,
    "computed": float,
    "tolerance": float,
    "count": int,
    "absolute": "True".__eq__,
    "holds": "True".__eq__,
    "known": "True".__eq__,
}
"""Columns of a CSV file other than texts."""

SAME = ("source", "case", "quantity", "unit", "absolute", "reason")
"""Values of a row whose change requires a new manual."""

SLACK = 1e-6
"""Relative; references are computed too, and their last digits differ between machines."""


def read_recorded(path: Path) -> list[Row]:
    """Return the rows of the last test run; none if it recorded none."""
    return json.loads(path.read_text(encoding="utf-8")) if path.exists() else []


def read(path: Path = KEPT) -> list[Row]:
    """Return the rows of a CSV file."""
    with path.open(encoding="utf-8", newline="") as file:
        return [{name: TYPES.get(name, str)(text) for name, text in row.items()} for row in csv.DictReader(file)]


def write(rows: list[Row], path: Path = KEPT) -> None:
    """Write the rows as a CSV file."""
    with path.open("w", encoding="utf-8", newline="") as file:
        writer = csv.DictWriter(file, rows[0], lineterminator="\n")
        writer.writeheader()
        writer.writerows(rows)


def function(row: Row) -> str:
    """Return file and function of a row's test, without parameters."""
    return row["test"].partition("[")[0]


def file(row: Row) -> str:
    return row["test"].partition("::")[0]


def list_tests(folder: Path) -> set[str]:
    """Return the test functions and methods below a folder, as ``file::name`` and ``file::Class::name``."""
    found = set()
    for path in folder.rglob("test_*.py"):
        for node in ast.parse(path.read_text(encoding="utf-8")).body:
            own, prefix = (node.body, f"{node.name}::") if isinstance(node, ast.ClassDef) else ([node], "")
            names = [one.name for one in own if isinstance(one, ast.FunctionDef) and one.name.startswith("test_")]
            found |= {f"{path.relative_to(ROOT)}::{prefix}{name}" for name in names}
    return found


def merge_rows(
    kept: list[Row], recorded: list[Row], folder: Path = VERIFICATION, same: Callable[[Row], str] = function
) -> list[Row]:
    """Return the recorded rows, and the kept rows of tests that exist and did not run; `same` identifies a test."""
    ran, known = {same(row) for row in recorded}, list_tests(folder)
    return [row for row in kept if same(row) not in ran and function(row) in known] + recorded


def sort_rows(rows: list[Row]) -> list[Row]:
    """Return the rows of the manual in the order of its pages, without `passed`."""
    rows = [{name: value for name, value in row.items() if name != "passed"} for row in rows]
    return sorted(rows, key=lambda row: (row["source"], file(row), row["case"], row["quantity"], row["test"]))


def _key(row: Row) -> tuple[str, ...]:
    return row["test"], row["case"], row["quantity"]


def differences(kept: list[Row], recorded: list[Row]) -> list[str]:
    """Return where a test run differs from the manual: rows that are new, gone or of another reference.

    Rows of other parameters than those of the run stay: some run only with the slow tests.
    """
    ran, known = {row["test"] for row in recorded}, list_tests(VERIFICATION)
    old = {_key(row): row for row in kept if row["test"] in ran or function(row) not in known}
    new = {_key(row): row for row in recorded}
    found = [f"not in the manual: {' | '.join(key)}" for key in new.keys() - old.keys()]
    found += [f"no longer recorded: {' | '.join(key)}" for key in old.keys() - new.keys()]
    found += [f"changed: {' | '.join(key)}" for key in old.keys() & new.keys() if _changed(old[key], new[key])]
    return sorted(found)


def _changed(old: Row, new: Row) -> bool:
    size = max(abs(old["reference"]), 0.0 if old["absolute"] else 1e-300)
    allowed = max(SLACK * size, old["tolerance"] if old["absolute"] else 0.0)
    return (
        any(old[name] != new[name] for name in SAME)
        or abs(old["reference"] - new["reference"]) > allowed
        or not math.isclose(old["tolerance"], new["tolerance"], rel_tol=1e-2)
    )


def join_texts(texts: list[str]) -> str:
    """Return texts as one list; words that all share at the beginning and at the end occur once."""
    if len(set(texts)) == 1:
        return texts[0]
    words = [text.split() for text in texts]
    shortest = min(map(len, words))
    start = next((i for i in range(shortest) if len({line[i] for line in words}) > 1), shortest)
    end = next((i for i in range(shortest - start) if len({line[-1 - i] for line in words}) > 1), shortest - start)
    *parts, last = (" ".join(line[start : len(line) - end]) for line in words)
    middle = "; ".join([*(part.rstrip(",") for part in parts), last])
    return " ".join([*words[0][:start], middle, *words[0][len(words[0]) - end :]])


def markdown_table(head: Collection[str], rows: list[list[str]]) -> str:
    """Return a table in Markdown."""
    lines = [[text.replace("|", "\\|").replace("<", "&lt;") for text in row] for row in rows]
    return "\n".join("| " + " | ".join(row) + " |" for row in [list(head), ["---"] * len(head), *lines])
