"""The page of speed is that of its figures, and is made whatever of them there is."""

from __future__ import annotations

import importlib.util
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]


@pytest.fixture(scope="module")
def maker():
    spec = importlib.util.spec_from_file_location("make_performance", ROOT / "docs/make_performance.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.fixture(scope="module")
def figures(maker):
    return maker.read(maker.MEASURED), maker.read(maker.PEERS)


def test_the_page_is_that_of_the_figures(maker, figures):
    assert (ROOT / "docs/performance.md").read_text(encoding="utf-8") == maker.page(*figures)


def test_every_table_measured_is_shown(maker, figures):
    assert set(figures[0]["tables"]) == {"bounds", *maker.SECTIONS}


def test_what_is_missing_is_said(maker, figures):
    """Of a peer in its row; a path that does not fit in memory too; tables that were not measured are left out."""
    measured, peers = figures
    gone = peers["solvers"][1] | {"missing": "not installed: pip install it"}
    text = maker.page({}, peers | {"solvers": [peers["solvers"][0], gone]})
    assert f"| {gone['title']} | not installed: pip install it | | | | | |" in text
    assert "## Linear transient" not in text
    rows = [row | {"missing": "more memory than there is"} for row in measured["tables"]["linear"]]
    text = maker.page(measured | {"tables": measured["tables"] | {"linear": rows}}, {})
    assert "| more memory than there is |" in text
    assert "## Beside other solvers" not in text


def test_solvers_that_are_missing_in_contact_are_said(maker, figures):
    train = figures[1]["train"]
    gone = train["solvers"][-1] | {"missing": "not installed: pip install it", "settings": []}
    text = maker.page({}, figures[1] | {"train": train | {"solvers": [*train["solvers"][:-1], gone]}})
    assert f"| {gone['title']} | not installed: pip install it | | |" in text
    assert f"| {gone['title']}, " not in text


def test_times_at_equal_error_lie_between_the_settings(maker):
    """Along the fastest settings, a straight line in logarithms; no time beyond the smallest error."""
    settings = [{"error": error, "ms": ms} for error, ms in ((1e-1, 5.0), (1e-2, 1.0), (1e-3, 10.0), (2e-3, 20.0))]
    assert maker.time_at(settings, 1e-1) == pytest.approx(1.0)  # 5 ms with more error is no alternative
    assert maker.time_at(settings, 10.0**-2.5) == pytest.approx(10.0**0.5)
    assert maker.time_at(settings, 1e-3) == pytest.approx(10.0)
    assert maker.time_at(settings, 1e-4) is None
