"""The page of extremes is generated from its CSV file, whose rows match the tests that record them."""

import ast
import importlib
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
EXPECT_FIXTURE = "expect"


@pytest.fixture(scope="module")
def maker():
    with pytest.MonkeyPatch.context() as patch:
        patch.syspath_prepend(str(ROOT / "docs"))
        return importlib.import_module("make_extremes")


@pytest.fixture(scope="module")
def rows(maker):
    return maker.read(maker.KEPT)


def recording_tests():
    """Return the tests, including slow ones, that use the fixture `expect`."""
    found = set()
    for path in (ROOT / "tests/extremes").glob("test_*.py"):
        for node in ast.parse(path.read_text(encoding="utf-8")).body:
            if isinstance(node, ast.FunctionDef) and EXPECT_FIXTURE in [a.arg for a in node.args.args]:
                found.add(f"tests/extremes/{path.name}::{node.name}")
    return {name for name in found if "::test_" in name}


def test_page_is_generated_from_rows(maker, rows):
    assert (ROOT / "docs/extremes.md").read_text(encoding="utf-8") == maker.page(rows)


def test_rows_match_recording_tests(maker, rows):
    assert {maker.function(row) for row in rows} == recording_tests()


def test_failed_rows_are_known(rows):
    assert [row["test"] for row in rows if not row["holds"] and not row["known"]] == []


def test_rows_cover_all_extremes(maker, rows):
    assert {row["extreme"] for row in rows} == set(maker.EXTREMES)


def test_rows_of_skipped_tests_are_preserved(maker, rows):
    """The normal suite keeps rows of slow tests, replaces those of its own tests and removes rows without a test."""
    one, other = rows[0], next(row for row in rows if maker.function(row) != maker.function(rows[0]))
    removed = one | {"test": "tests/extremes/test_no_such.py::test_nothing"}
    merged = maker.merge_rows([one, other, removed], [one | {"given": "new"}], maker.TESTS)
    assert [row["given"] for row in merged if maker.function(row) == maker.function(one)] == ["new"]
    assert other in merged
    assert removed not in merged
