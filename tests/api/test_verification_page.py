"""The verification manual is that of its rows, and its rows are those of the tests that record one."""

from __future__ import annotations

import ast
import re
from collections import Counter
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
MANUAL = ROOT / "docs/verification"


@pytest.fixture
def manual(monkeypatch):
    """Return the modules of the manual, which lie beside the pages."""
    monkeypatch.syspath_prepend(str(ROOT / "docs"))
    from manual import pages, rows, tables

    return {"pages": pages, "rows": rows, "tables": tables}


@pytest.fixture
def kept(manual):
    return manual["rows"].read()


def recording() -> set[str]:
    """Return the test functions, slow ones as well, that ask for the fixture ``record``."""
    found = set()
    for path in (ROOT / "tests/verification").glob("test_*.py"):
        for node in ast.parse(path.read_text(encoding="utf-8")).body:
            inner = node.body if isinstance(node, ast.ClassDef) else [node]
            prefix = f"{node.name}::" if isinstance(node, ast.ClassDef) else ""
            tests = [one for one in inner if isinstance(one, ast.FunctionDef) and one.name.startswith("test_")]
            asking = [one.name for one in tests if "record" in [a.arg for a in one.args.args]]
            found |= {f"tests/verification/{path.name}::{prefix}{name}" for name in asking}
    return found


def test_every_page_is_that_of_the_rows(manual, kept):
    made = manual["pages"].pages(kept)
    assert set(made) == {path.name for path in MANUAL.glob("*.md")}
    for name, text in made.items():
        assert (MANUAL / name).read_text(encoding="utf-8") == text, f"{name}: python docs/make_verification.py"


def test_every_row_names_a_test_and_every_test_has_a_row(manual, kept):
    assert {manual["rows"].function(row) for row in kept} == recording()


def test_every_row_holds(manual, kept):
    """The digits kept are ten: a row may pass its tolerance by so much."""
    assert len(kept) > 1000
    for row in kept:
        size = 1.0 if row["absolute"] else abs(row["reference"])
        slack = 2e-10 * max(abs(row["reference"]), abs(row["computed"]))
        assert abs(row["computed"] - row["reference"]) <= row["tolerance"] * size + slack, row


def test_the_five_published_systems_have_rows_and_pages(manual, kept):
    systems = manual["pages"].SYSTEMS
    assert len(systems) == 5
    known = {row["source"] for row in kept}
    for one in systems:
        assert set(one.sources) <= known
        text = (MANUAL / f"{one.name}.md").read_text(encoding="utf-8")
        assert {"## Reproduced and not reproduced", "## Errata"} <= set(text.splitlines())


def test_benchmarks_have_rows_and_pages(manual, kept):
    known = {row["source"] for row in kept}
    for one in manual["pages"].BENCHMARKS:
        assert set(one.sources) <= known
        assert one.notes


def test_tests_named_as_proof_of_an_erratum_exist(manual):
    """A page may not name a test that was renamed."""
    known = {name.rpartition("::")[2] for name in manual["rows"].list_tests(manual["rows"].VERIFICATION)}
    files = {path.name for path in (ROOT / "tests/verification").glob("*.py")}
    for path in MANUAL.glob("*.md"):
        for name in re.findall(r"`(test_\w+(?:\.py)?)`", path.read_text(encoding="utf-8")):
            assert name in known | files, f"{path.name}: {name}"


def test_figures_shown_are_those_made_and_one_is_drawn_alike(monkeypatch):
    monkeypatch.syspath_prepend(str(ROOT / "docs"))
    from manual.figures import FIGURES, figure_text

    shown = {
        name for path in MANUAL.glob("*.md") for name in re.findall(r"\(figures/([\w-]+)\.svg\)", path.read_text())
    }
    assert shown == set(FIGURES) == {path.stem for path in (MANUAL / "figures").iterdir()}
    first = figure_text(FIGURES["roussev"])
    assert first == figure_text(FIGURES["roussev"])
    assert "<dc:date>" not in first


def test_rows_of_tests_that_did_not_run_are_kept(manual, kept):
    rows = manual["rows"]
    one, other = kept[0], next(row for row in kept if rows.function(row) != rows.function(kept[0]))
    gone = one | {"test": "tests/verification/test_no_such.py::test_nothing"}
    again = rows.merge_rows([one, other, gone], [one | {"computed": 7.0}])
    assert [row["computed"] for row in again if rows.function(row) == rows.function(one)] == [7.0]
    assert other in again
    assert gone not in again


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({}, []),
        ({"computed": 7.0}, []),  # digits of another machine; the test itself has judged them
        ({"quantity": "another"}, ["no longer recorded", "not in the manual"]),
        ({"reference": 7.0}, ["changed"]),
        ({"tolerance": 0.5}, ["changed"]),
        ({"reason": "a guess"}, ["changed"]),
    ],
)
def test_a_run_that_says_otherwise_is_seen(manual, kept, change, said):
    rows = manual["rows"]
    counts = Counter(rows.function(row) for row in kept)
    one = next(row for row in kept if counts[rows.function(row)] == 1)
    found = rows.differences(kept, [one | change])
    assert [text.partition(":")[0] for text in found] == said


def test_the_recorded_rows_are_read_back_as_written(manual, kept, tmp_path):
    path = tmp_path / "rows.csv"
    manual["rows"].write(kept, path)
    assert manual["rows"].sort_rows(manual["rows"].read(path)) == kept
    assert path.read_bytes() == manual["rows"].KEPT.read_bytes()
