"""The verification manual is generated from its rows, which match the tests that record them."""

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
    """Return the modules of the manual, which are in the folder of the pages."""
    monkeypatch.syspath_prepend(str(ROOT / "docs"))
    from manual import pages, rows, tables

    return {"pages": pages, "rows": rows, "tables": tables}


@pytest.fixture
def stored_rows(manual):
    return manual["rows"].read()


def recording_tests() -> set[str]:
    """Return the test functions, including slow ones, that use the fixture ``record``."""
    found = set()
    for path in (ROOT / "tests/verification").glob("test_*.py"):
        for node in ast.parse(path.read_text(encoding="utf-8")).body:
            inner = node.body if isinstance(node, ast.ClassDef) else [node]
            prefix = f"{node.name}::" if isinstance(node, ast.ClassDef) else ""
            tests = [one for one in inner if isinstance(one, ast.FunctionDef) and one.name.startswith("test_")]
            asking = [one.name for one in tests if "record" in [a.arg for a in one.args.args]]
            found |= {f"tests/verification/{path.name}::{prefix}{name}" for name in asking}
    return found


def test_pages_are_generated_from_rows(manual, stored_rows):
    made = manual["pages"].pages(stored_rows)
    assert set(made) == {path.name for path in MANUAL.glob("*.md")}
    for name, text in made.items():
        assert (MANUAL / name).read_text(encoding="utf-8") == text, f"{name}: python docs/make_verification.py"


def test_rows_match_recording_tests(manual, stored_rows):
    assert {manual["rows"].function(row) for row in stored_rows} == recording_tests()


def test_rows_are_within_tolerance(manual, stored_rows):
    """Rows have ten digits, so that a row may exceed its tolerance by rounding."""
    assert len(stored_rows) > 1000
    for row in stored_rows:
        size = 1.0 if row["absolute"] else abs(row["reference"])
        slack = 2e-10 * max(abs(row["reference"]), abs(row["computed"]))
        assert abs(row["computed"] - row["reference"]) <= row["tolerance"] * size + slack, row


def test_published_systems_have_rows_and_pages(manual, stored_rows):
    systems = manual["pages"].SYSTEMS
    assert len(systems) == 5
    known = {row["source"] for row in stored_rows}
    for one in systems:
        assert set(one.sources) <= known
        text = (MANUAL / f"{one.name}.md").read_text(encoding="utf-8")
        assert {"## Reproduced and not reproduced", "## Errata"} <= set(text.splitlines())


def test_benchmarks_have_rows_and_pages(manual, stored_rows):
    known = {row["source"] for row in stored_rows}
    for one in manual["pages"].BENCHMARKS:
        assert set(one.sources) <= known
        assert one.notes


def test_tests_named_in_pages_exist(manual):
    """Errata refer to tests, which may be renamed."""
    known = {name.rpartition("::")[2] for name in manual["rows"].list_tests(manual["rows"].VERIFICATION)}
    files = {path.name for path in (ROOT / "tests/verification").glob("*.py")}
    for path in MANUAL.glob("*.md"):
        for name in re.findall(r"`(test_\w+(?:\.py)?)`", path.read_text(encoding="utf-8")):
            assert name in known | files, f"{path.name}: {name}"


def test_figures_are_all_shown_and_reproducible(monkeypatch):
    monkeypatch.syspath_prepend(str(ROOT / "docs"))
    from manual.figures import FIGURES, figure_text

    shown = {
        name for path in MANUAL.glob("*.md") for name in re.findall(r"\(figures/([\w-]+)\.svg\)", path.read_text())
    }
    assert shown == set(FIGURES) == {path.stem for path in (MANUAL / "figures").iterdir()}
    first = figure_text(FIGURES["roussev"])
    assert first == figure_text(FIGURES["roussev"])
    assert "<dc:date>" not in first


def test_rows_of_skipped_tests_are_preserved(manual, stored_rows):
    rows = manual["rows"]
    one, other = stored_rows[0], next(row for row in stored_rows if rows.function(row) != rows.function(stored_rows[0]))
    removed = one | {"test": "tests/verification/test_no_such.py::test_nothing"}
    merged = rows.merge_rows([one, other, removed], [one | {"computed": 7.0}])
    assert [row["computed"] for row in merged if rows.function(row) == rows.function(one)] == [7.0]
    assert other in merged
    assert removed not in merged


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({}, []),
        ({"computed": 7.0}, []),  # digits may differ between machines; the test itself checks the value
        ({"quantity": "another"}, ["no longer recorded", "not in the manual"]),
        ({"reference": 7.0}, ["changed"]),
        ({"tolerance": 0.5}, ["changed"]),
        ({"reason": "a guess"}, ["changed"]),
    ],
)
def test_changed_rows_are_reported(manual, stored_rows, change, message):
    rows = manual["rows"]
    counts = Counter(rows.function(row) for row in stored_rows)
    one = next(row for row in stored_rows if counts[rows.function(row)] == 1)
    found = rows.differences(stored_rows, [one | change])
    assert [text.partition(":")[0] for text in found] == message


def test_rows_round_trip(manual, stored_rows, tmp_path):
    path = tmp_path / "rows.csv"
    manual["rows"].write(stored_rows, path)
    assert manual["rows"].sort_rows(manual["rows"].read(path)) == stored_rows
    assert path.read_bytes() == manual["rows"].KEPT.read_bytes()
