"""The page of trust is made from its CSV file, and names only tests that exist, and all that keep a row."""

from __future__ import annotations

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


def keeping():
    """Return the tests, slow ones as well, that ask for the fixture `tried`."""
    found = set()
    for path in (ROOT / "tests").rglob("test_*.py"):
        for node in ast.parse(path.read_text(encoding="utf-8")).body:
            if isinstance(node, ast.FunctionDef) and "tried" in [one.arg for one in node.args.args]:
                found.add(f"{path.relative_to(ROOT)}::{node.name}")
    return {name for name in found if "::test_" in name}


def test_the_page_is_made_from_the_rows(maker, rows):
    assert (ROOT / "docs/trust.md").read_text(encoding="utf-8") == maker.page(rows)


def test_every_row_names_a_test_and_every_test_has_a_row(maker, rows):
    assert {maker.function(row) for row in rows} == keeping()


def test_rows_of_tests_that_did_not_run_are_kept(maker, rows):
    one, other = rows[0], next(row for row in rows if maker.function(row) != maker.function(rows[0]))
    gone = one | {"test": "tests/fuzz/test_no_such.py::test_nothing"}
    again = maker.merge_rows([one, other, gone], [one | {"count": 7}], ROOT / "tests", lambda row: row["test"])
    assert [row["count"] for row in again if row["test"] == one["test"]] == [7]
    assert other in again
    assert gone not in again
