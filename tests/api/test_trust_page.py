"""The page of trust is generated from its CSV file, whose rows match the tests that record them."""

import ast
import importlib
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]


@pytest.fixture(scope="module")
def maker():
    with pytest.MonkeyPatch.context() as patch:
        patch.syspath_prepend(str(ROOT / "docs"))
        return importlib.import_module("make_trust")


@pytest.fixture(scope="module")
def rows(maker):
    return maker.read(maker.KEPT)


def recording_tests():
    """Return the tests, including slow ones, that use the fixture `tried`."""
    found = set()
    for path in (ROOT / "tests").rglob("test_*.py"):
        for node in ast.parse(path.read_text(encoding="utf-8")).body:
            if isinstance(node, ast.FunctionDef) and "tried" in [one.arg for one in node.args.args]:
                found.add(f"{path.relative_to(ROOT)}::{node.name}")
    return {name for name in found if "::test_" in name}


def test_page_is_generated_from_rows(maker, rows):
    assert (ROOT / "docs/trust.md").read_text(encoding="utf-8") == maker.page(rows)


def test_rows_match_recording_tests(maker, rows):
    assert {maker.function(row) for row in rows} == recording_tests()


def test_rows_of_skipped_tests_are_preserved(maker, rows):
    one, other = rows[0], next(row for row in rows if maker.function(row) != maker.function(rows[0]))
    removed = one | {"test": "tests/fuzz/test_no_such.py::test_nothing"}
    merged = maker.merge_rows([one, other, removed], [one | {"count": 7}], ROOT / "tests", lambda row: row["test"])
    assert [row["count"] for row in merged if row["test"] == one["test"]] == [7]
    assert other in merged
    assert removed not in merged
