"""The page of extremes is made from its CSV file, and names only tests that exist, and all that record a row."""

from __future__ import annotations

import ast
import importlib
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
ASSERTS = "expect"


@pytest.fixture(scope="module")
def maker():
    with pytest.MonkeyPatch.context() as patch:
        patch.syspath_prepend(str(ROOT / "docs"))
        return importlib.import_module("make_extremes")


@pytest.fixture(scope="module")
def rows(maker):
    return maker.read(maker.KEPT)


def recording():
    """Return the tests, slow ones as well, that ask for the fixture `expect`."""
    found = set()
    for path in (ROOT / "tests/extremes").glob("test_*.py"):
        for node in ast.parse(path.read_text(encoding="utf-8")).body:
            if isinstance(node, ast.FunctionDef) and ASSERTS in [a.arg for a in node.args.args]:
                found.add(f"tests/extremes/{path.name}::{node.name}")
    return {name for name in found if "::test_" in name}


def test_the_page_is_made_from_the_rows(maker, rows):
    assert (ROOT / "docs/extremes.md").read_text(encoding="utf-8") == maker.page(rows)


def test_every_row_names_a_test_and_every_test_has_a_row(maker, rows):
    assert {maker.function(row) for row in rows} == recording()


def test_every_row_holds_or_is_marked_as_not_yet(rows):
    assert [row["test"] for row in rows if not row["holds"] and not row["known"]] == []


def test_all_extremes_are_there(maker, rows):
    assert {row["extreme"] for row in rows} == set(maker.EXTREMES)


def test_rows_of_tests_that_did_not_run_are_kept(maker, rows):
    """A run of the normal suite keeps the rows of slow tests, replaces its own, and drops those of no test."""
    one, other = rows[0], next(row for row in rows if maker.function(row) != maker.function(rows[0]))
    gone = one | {"test": "tests/extremes/test_no_such.py::test_nothing"}
    again = maker.merge_rows([one, other, gone], [one | {"given": "new"}], maker.TESTS)
    assert [row["given"] for row in again if maker.function(row) == maker.function(one)] == ["new"]
    assert other in again
    assert gone not in again
