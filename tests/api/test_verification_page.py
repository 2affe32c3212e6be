"""The verification page names only tests that exist, and all that record a row."""

from __future__ import annotations

import ast
import re
from pathlib import Path

ROOT = Path(__file__).parents[2]
PAGE = (ROOT / "docs/verification.md").read_text(encoding="utf-8")
NAMED = set(re.findall(r"^`(tests/verification/\w+\.py)`$", PAGE, re.M))


def recording() -> set[str]:
    """Return the test files with a test that asks for the fixture ``record``."""
    found = set()
    for path in (ROOT / "tests/verification").glob("test_*.py"):
        tree = ast.parse(path.read_text(encoding="utf-8"))
        tests = [node for node in ast.walk(tree) if isinstance(node, ast.FunctionDef) and node.name.startswith("test_")]
        if any(a.arg == "record" for test in tests for a in test.args.args):
            found.add(f"tests/verification/{path.name}")
    return found


def test_every_file_named_exists_and_every_file_that_records_is_named():
    assert recording() == NAMED


def test_every_row_is_within_its_tolerance_by_the_digits_shown():
    rows = [line.split(" | ") for line in PAGE.splitlines() if line.startswith("| ") and not line.startswith("| case")]
    assert len(rows) > 200
    for row in rows:
        deviation, tolerance = row[-2].replace("< ", ""), row[-1].split()[0]
        assert float(deviation) <= 1.5 * float(tolerance) + 1e-9, row  # the deviation is shown with one digit
