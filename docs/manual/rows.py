"""The rows of the verification manual: those kept with the pages, and those of the last test run."""

from __future__ import annotations

import ast
import json
import math
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
RECORDED = ROOT / "build/verification.json"
KEPT = ROOT / "docs/verification.json"

Row = dict
SAME = ("source", "case", "quantity", "unit", "absolute", "reason")
"""What a row must not change without the manual being made anew."""

SLACK = 1e-6
"""Relative; references are computed too, and their last digits differ between machines."""


def read(path: Path) -> list[Row]:
    return json.loads(path.read_text(encoding="utf-8")) if path.exists() else []


def write(rows: list[Row], path: Path = KEPT) -> None:
    """Write a row to a line, so that a change of one is a change of one line."""
    lines = ",\n".join(json.dumps(row, ensure_ascii=False) for row in rows)
    path.write_text(f"[\n{lines}\n]\n", encoding="utf-8")


def function(row: Row) -> str:
    """Return file and function of a row's test, without parameters."""
    return row["test"].partition("[")[0]


def file(row: Row) -> str:
    return row["test"].partition("::")[0]


def existing() -> set[str]:
    """Return the test functions and methods of the verification, as ``file::name`` and ``file::Class::name``."""
    found = set()
    for path in (ROOT / "tests/verification").glob("test_*.py"):
        for node in ast.parse(path.read_text(encoding="utf-8")).body:
            inner = (
                [f"{node.name}::{one.name}" for one in _functions(node.body)] if isinstance(node, ast.ClassDef) else []
            )
            own = [node.name] if isinstance(node, ast.FunctionDef) else []
            found |= {f"tests/verification/{path.name}::{name}" for name in [*own, *inner]}
    return found


def _functions(body: list[ast.stmt]) -> list[ast.FunctionDef]:
    return [node for node in body if isinstance(node, ast.FunctionDef)]


def ordered(rows: list[Row]) -> list[Row]:
    return sorted(rows, key=lambda row: (row["source"], file(row), row["case"], row["quantity"], row["test"]))


def merged(kept: list[Row], recorded: list[Row]) -> list[Row]:
    """Return the rows that ran, and of those kept the ones whose test did not run but exists, in the pages' order."""
    ran, known = {function(row) for row in recorded}, existing()
    return ordered([row for row in kept if function(row) not in ran and function(row) in known] + recorded)


def failed(rows: list[Row]) -> list[str]:
    return [row["test"] for row in rows if not row["passed"]]


def _key(row: Row) -> tuple[str, ...]:
    return row["test"], row["case"], row["quantity"]


def differences(kept: list[Row], recorded: list[Row]) -> list[str]:
    """Return what a test run says otherwise than the manual: rows that are new, gone or of another reference."""
    ran, known = {function(row) for row in recorded}, existing()
    old = {_key(row): row for row in kept if function(row) in ran or function(row) not in known}
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
