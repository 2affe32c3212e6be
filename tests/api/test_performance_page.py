"""The performance page is generated from its measurements, also from a part of them."""

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


def test_page_is_generated_from_measurements(maker, figures):
    assert (ROOT / "docs/performance.md").read_text(encoding="utf-8") == maker.page(*figures)


def test_all_measured_tables_are_shown(maker, figures):
    assert set(figures[0]["tables"]) == {"bounds", *maker.SECTIONS}


def test_page_states_missing_solvers_and_cases(maker, figures):
    """Missing solvers and runs that exceed the memory have a note in their row; unmeasured tables are omitted."""
    measured, peers = figures
    missing_solver = peers["solvers"][1] | {"missing": "not installed: pip install it"}
    text = maker.page({}, peers | {"solvers": [peers["solvers"][0], missing_solver]})
    assert f"| {missing_solver['title']} | not installed: pip install it | | | | | |" in text
    assert "## Linear transient" not in text
    rows = [row | {"missing": "more memory than there is"} for row in measured["tables"]["linear"]]
    text = maker.page(measured | {"tables": measured["tables"] | {"linear": rows}}, {})
    assert "| more memory than there is |" in text
    assert "## Comparison with other solvers" not in text


def test_page_states_missing_contact_solvers(maker, figures):
    train = figures[1]["train"]
    missing_solver = train["solvers"][-1] | {"missing": "not installed: pip install it", "settings": []}
    text = maker.page({}, figures[1] | {"train": train | {"solvers": [*train["solvers"][:-1], missing_solver]}})
    assert f"| {missing_solver['title']} | not installed: pip install it | | |" in text
    assert f"| {missing_solver['title']}, " not in text


def test_time_at_equal_error_is_interpolated(maker):
    """Interpolation is linear in logarithms along the fastest settings, without extrapolation."""
    settings = [{"error": error, "ms": ms} for error, ms in ((1e-1, 5.0), (1e-2, 1.0), (1e-3, 10.0), (2e-3, 20.0))]
    assert maker.time_at(settings, 1e-1) == pytest.approx(1.0)  # the setting of 5 ms is slower and has a larger error
    assert maker.time_at(settings, 10.0**-2.5) == pytest.approx(10.0**0.5)
    assert maker.time_at(settings, 1e-3) == pytest.approx(10.0)
    assert maker.time_at(settings, 1e-4) is None
