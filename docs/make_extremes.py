"""Make ``docs/extremes.md`` from ``docs/extremes.json``, first brought up to date from the last test run.

``python docs/make_extremes.py``: rows of tests that ran replace the earlier ones; those of tests that did not run (the
slow ones, on most days) are kept, and those of tests that no longer exist are dropped.
"""

from __future__ import annotations

import ast
import json
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
RECORDED = ROOT / "build/extremes.json"
KEPT = ROOT / "docs/extremes.json"
PAGE = ROOT / "docs/extremes.md"

HEAD = """# Where flexcam is right, where it warns, where it refuses

Made by `make extremes` from `docs/extremes.json`, which the tests of `tests/extremes` record; every row is an assertion of
the test it names, and the reason of every tolerance stands there. Deviations are relative unless a unit stands with them.
"""
EXTREMES = (
    "step times frequency", "steps per revolution", "camshaft speed", "many revolutions", "ratio of masses",
    "ratio of stiffnesses", "slenderness of a beam", "elements per span", "axial load", "damping",
    "jumps of the parabolic law", "restart", "scale of the units", "a run that diverges",
)  # fmt: skip
"""Their order on the page."""

PARTS = {
    "right": ("Right", "The answer is that of the theory."),
    "warns": ("Warns", "The run goes on and says what is lost or passed."),
    "refuses": ("Refuses", "Nothing is answered; the cause and the remedy are. Exit code 2 for input, 3 for a run."),
    "not yet": ("Not yet", "What is expected here does not happen yet; each is a test marked as such."),
}


def function(row: dict) -> str:
    """Return file and function of a row's test, without parameters."""
    return row["test"].partition("[")[0]


def existing() -> set[str]:
    """Return all test functions of the extremes, as ``file::name``."""
    found = set()
    for path in (ROOT / "tests/extremes").glob("test_*.py"):
        tree = ast.parse(path.read_text(encoding="utf-8"))
        names = (node.name for node in tree.body if isinstance(node, ast.FunctionDef))
        found |= {f"tests/extremes/{path.name}::{name}" for name in names if name.startswith("test_")}
    return found


def merged(kept: list[dict], recorded: list[dict]) -> list[dict]:
    """Return the rows that ran, and of those kept the ones whose test did not run but exists, in the page's order."""
    ran, known = {function(row) for row in recorded}, existing()
    rows = [row for row in kept if function(row) not in ran and function(row) in known] + recorded
    rows = [{name: value for name, value in row.items() if name != "place"} for row in rows]
    return sorted(rows, key=lambda row: (EXTREMES.index(row["extreme"]), function(row)))


def section(row: dict) -> str:
    return row["outcome"] if row["holds"] else "not yet"


def cell(text: str) -> str:
    return text.replace("|", "\\|").replace("<", "&lt;")


def table(rows: list[dict], part: str) -> list[str]:
    head, words = PARTS[part]
    lines = [
        f"## {head}",
        "",
        words,
        "",
        "| extreme | given | expected | what happens | test |",
        "|---|---|---|---|---|",
    ]
    for row in rows:
        cells = [row["extreme"], row["given"], row["outcome"], row["happens"]]
        test = function(row).removeprefix("tests/extremes/")
        lines.append("| " + " | ".join(map(cell, cells)) + f" | `{test}` |")
    return [*lines, ""]


def page(rows: list[dict]) -> str:
    """Return the text of the page."""
    parts = [HEAD]
    for part in PARTS:
        if its := [row for row in rows if section(row) == part]:
            parts += table(its, part)
    return "\n".join(parts)


def read(path: Path) -> list[dict]:
    return json.loads(path.read_text(encoding="utf-8")) if path.exists() else []


if __name__ == "__main__":
    rows = merged(read(KEPT), read(RECORDED))
    if failed := [row["test"] for row in rows if not row["holds"] and not row["known"]]:
        message = f"these tests failed; the page shows assertions that hold: {failed}"
        raise SystemExit(message)
    KEPT.write_text(json.dumps(rows, indent=1, ensure_ascii=False) + "\n", encoding="utf-8")
    PAGE.write_text(page(rows), encoding="utf-8")
