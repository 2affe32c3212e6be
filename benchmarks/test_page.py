"""Measurements of `docs/performance.md` with the smallest models, and the page that they generate."""

from __future__ import annotations

import importlib.util

import pytest

from benchmarks import machine
from benchmarks.measure import (
    accuracy,
    assembly,
    commands,
    contact,
    derivatives,
    gradients,
    linear,
    memory,
    modes,
    saving,
    searches,
    sweep,
)
from benchmarks.measure.__main__ import TABLES
from benchmarks.processes import ROOT


@pytest.fixture
def small_models(monkeypatch):
    monkeypatch.setattr(machine, "LENGTH", 1000)
    monkeypatch.setattr(machine, "ORDER", 50)
    monkeypatch.setattr(linear, "SHAFTS", linear.SHAFTS[:2])
    monkeypatch.setattr(linear, "STEPS", 1200)
    monkeypatch.setattr(contact, "CASES", (("petrescu/valve-spring", ()),))
    monkeypatch.setattr(contact, "REPEATS", 1)
    monkeypatch.setattr(accuracy, "CASES", accuracy.CASES[-1:])
    monkeypatch.setattr(accuracy, "STEPS", accuracy.STEPS[:1])
    monkeypatch.setattr(accuracy, "REFERENCE", 1800)
    monkeypatch.setattr(sweep, "SPEEDS", 3)
    monkeypatch.setattr(sweep, "COMMAND_SPEEDS", 3)
    monkeypatch.setattr(gradients, "NUMBERS", {"direct-acting/bucket": ("run.crank_speed",)})
    monkeypatch.setattr(gradients, "COUNTS", (1,))
    monkeypatch.setattr(gradients, "REPEATS", 1)
    monkeypatch.setattr(derivatives, "CHECKS", derivatives.CHECKS[:1])
    monkeypatch.setattr(derivatives, "REPEATS", 1)
    monkeypatch.setattr(searches, "VARIED", searches.VARIED[:2])
    monkeypatch.setattr(searches, "GRADIENT_EVALUATIONS", 2)
    monkeypatch.setattr(searches, "GLOBAL_EVALUATIONS", 24)
    monkeypatch.setattr(assembly, "ELEMENTS", (10,))
    monkeypatch.setattr(modes, "SHAFTS", modes.SHAFTS[:1])
    monkeypatch.setattr(memory, "STATEMENTS", {"Python": "pass"})
    monkeypatch.setattr(saving, "STEPS", 100)
    # Not run: test_start.py runs the commands, and the wheel check compiles the kernel.
    monkeypatch.setattr(commands, "time_command", lambda *_words, **_environment: 1.0)


@pytest.mark.usefixtures("small_models")
def test_page_has_all_tables():
    tables = {"bounds": machine.measure_limits()} | {name: measure() for name, measure in TABLES.items()}
    packages = machine.package_versions("flexcam")
    labels = {"machine": machine.describe(), "date": machine.today(), "versions": packages}
    spec = importlib.util.spec_from_file_location("make_performance", ROOT / "docs/make_performance.py")
    maker = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(maker)
    text = maker.page(labels | {"tables": tables}, {})
    assert [line for line in text.splitlines() if line.startswith("| 60 | **")]
    assert "missing" not in text
    # One more heading for the machine; both tables of derivatives share a heading.
    assert text.count("\n## ") == len(maker.SECTIONS)
