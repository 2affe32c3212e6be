"""The pages of extremes and of trust are generated from CSV files, whose rows match the tests that record them."""

import ast
import importlib
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
FIXTURES = {"extremes": "expect", "trust": "tried"}
"""Fixtures that record the rows of a page."""


@pytest.fixture(scope="module", params=FIXTURES)
def page(request):
    return request.param


@pytest.fixture(scope="module")
def maker(page):
    with pytest.MonkeyPatch.context() as patch:
        patch.syspath_prepend(str(ROOT / "docs"))
        return importlib.import_module(f"make_{page}")


@pytest.fixture(scope="module")
def rows(maker):
    return maker.read(maker.KEPT)


def recording_tests(fixture):
    """Return the tests, including slow ones, that use a fixture."""
    return {
        f"{path.relative_to(ROOT)}::{node.name}"
        for path in (ROOT / "tests").rglob("test_*.py")
        for node in ast.parse(path.read_text(encoding="utf-8")).body
        if isinstance(node, ast.FunctionDef) and node.name.startswith("test_")
        if fixture in [one.arg for one in node.args.args]
    }


def test_page_is_generated_from_rows(page, maker, rows):
    assert (ROOT / f"docs/{page}.md").read_text(encoding="utf-8") == maker.page(rows)


def test_rows_match_recording_tests(page, maker, rows):
    assert {maker.function(row) for row in rows} == recording_tests(FIXTURES[page])


def test_rows_of_skipped_tests_are_preserved(page, maker, rows):
    """The normal suite keeps rows of slow tests, replaces those of its own tests and removes rows without a test."""
    one, other = rows[0], next(row for row in rows if maker.function(row) != maker.function(rows[0]))
    removed = one | {"test": "tests/extremes/test_no_such.py::test_nothing"}
    if page == "extremes":
        key, new, identity = "given", "new", maker.function
        merged = maker.merge_rows([one, other, removed], [one | {key: new}], maker.TESTS)
    else:
        key, new, identity = "count", 7, lambda row: row["test"]
        merged = maker.merge_rows([one, other, removed], [one | {key: new}], ROOT / "tests", identity)
    assert [row[key] for row in merged if identity(row) == identity(one)] == [new]
    assert other in merged
    assert removed not in merged


@pytest.mark.parametrize("page", ["extremes"], indirect=True)
def test_rows_cover_all_extremes_and_failed_rows_are_known(maker, rows):
    assert {row["extreme"] for row in rows} == set(maker.EXTREMES)
    assert [row["test"] for row in rows if not row["holds"] and not row["known"]] == []
