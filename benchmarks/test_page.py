"""What measures the page of speed, on the smallest of each kind, and the page made of it."""

from __future__ import annotations

import importlib.util

import pytest

from benchmarks import machine
from benchmarks.measure import (
    accuracy,
    assembly,
    bounds,
    compiler,
    contact,
    derivatives,
    gradients,
    linear,
    modes,
    peaks,
    process,
    saving,
    searches,
    sweep,
)
from benchmarks.processes import ROOT


@pytest.fixture
def smallest(monkeypatch):
    monkeypatch.setattr(bounds, "LENGTH", 1000)
    monkeypatch.setattr(bounds, "ORDER", 50)
    monkeypatch.setattr(linear, "SHAFTS", linear.SHAFTS[:2])
    monkeypatch.setattr(linear, "STEPS", 1200)
    monkeypatch.setattr(contact, "CASES", (("petrescu/valve-spring", ()),))
    monkeypatch.setattr(contact, "REPEATS", 1)
    monkeypatch.setattr(accuracy, "CASES", accuracy.CASES[-1:])
    monkeypatch.setattr(accuracy, "STEPS", accuracy.STEPS[:1])
    monkeypatch.setattr(accuracy, "REFERENCE", 1800)
    monkeypatch.setattr(sweep, "SPEEDS", 3)
    monkeypatch.setattr(gradients, "NUMBERS", {"direct-acting/bucket": ("run.crank_speed",)})
    monkeypatch.setattr(gradients, "COUNTS", (1,))
    monkeypatch.setattr(gradients, "REPEATS", 1)
    monkeypatch.setattr(derivatives, "CHECKS", derivatives.CHECKS[:1])
    monkeypatch.setattr(derivatives, "REPEATS", 1)
    monkeypatch.setattr(searches, "VARIED", searches.VARIED[:2])
    monkeypatch.setattr(searches, "GRADIENT", 2)
    monkeypatch.setattr(searches, "GLOBAL", 24)
    monkeypatch.setattr(assembly, "ELEMENTS", (10,))
    monkeypatch.setattr(modes, "SHAFTS", modes.SHAFTS[:1])
    monkeypatch.setattr(peaks, "WORKS", {"Python": "pass"})
    monkeypatch.setattr(saving, "STEPS", 100)
    monkeypatch.setattr(compiler, "CASE", ROOT / "cases/tayeb/model-1-shm.toml")
    monkeypatch.setattr(compiler, "REPEATS", 1)
    monkeypatch.setattr(process, "COMMANDS", {"Python alone": ["-c", "pass"]})


@pytest.mark.usefixtures("smallest")
def test_the_page_is_made_of_what_is_measured():
    rooms = (
        bounds, linear, contact, accuracy, sweep, gradients, derivatives, searches, assembly, modes, peaks, saving,
        process, compiler,
    )  # fmt: skip
    tables = {room.__name__.rpartition(".")[2]: room.measured() for room in rooms}
    found = {"machine": machine.described(), "date": machine.today(), "versions": machine.versions("flexcam")}
    spec = importlib.util.spec_from_file_location("make_performance", ROOT / "docs/make_performance.py")
    maker = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(maker)
    text = maker.page(found | {"tables": tables}, {})
    assert [line for line in text.splitlines() if line.startswith("| 60 | **")]
    assert "missing" not in text
    assert text.count("\n## ") == len(maker.SECTIONS)  # and the machine; both tables of derivatives share a heading
