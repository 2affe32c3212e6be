"""`flexcam selftest`: what it checks, that it needs no more than the package, and that it can fail."""

from __future__ import annotations

import time
from dataclasses import replace

import pytest

from flexcam.analysis.selftest import Check, all_checks, installation_info
from flexcam.cli.main import load_commands
from flexcam.fem.assembly import stiffness as fem_stiffness

load_commands(["selftest"])
COMMAND = "flexcam.cli.case_files.all_checks"


def test_everything_passes_within_half_a_minute(flexcam, tmp_path):
    """Run in an empty folder, it needs no other file and leaves nothing there."""
    begun = time.perf_counter()
    ended = flexcam("selftest")
    assert ended.code == 0
    assert time.perf_counter() - begun < 30.0
    assert "All 23 checks passed" in ended.out
    for words in ("tip of a", "buckling", "4027", "kernel solver", "numpy", "extra tables"):
        assert words in ended.out
    assert "FAILED" not in ended.out
    assert list(tmp_path.iterdir()) == []


def test_a_check_that_fails_is_named(flexcam, monkeypatch):
    off = [Check("pi", "Archimedes", 3.14159265, 22 / 7, 1e-4), Check("e", "Euler", 2.718, float("nan"), 1.0)]
    monkeypatch.setattr(COMMAND, lambda: iter([*off, replace(off[0], quantity="fine", tolerance=1.0)]))
    ended = flexcam("selftest")
    assert ended.code == 3
    assert ended.out.count("FAILED") == 2
    assert "2 of 3 checks exceed their tolerance: pi; e" in ended.err
    told = flexcam("selftest", "--json")
    assert told.code == 3
    assert told.json["status"] == "fault"
    assert [one["passed"] for one in told.json["checks"]] == [False, False, True]
    assert told.json["checks"][1]["computed"] is None


def test_a_wrong_element_is_found(monkeypatch):
    """A stiffness that is one part in a million too large."""

    def stiff(beams, dofs):
        return fem_stiffness(beams, dofs).scale(1.0 + 1e-6)

    monkeypatch.setattr("flexcam.analysis.selftest.stiffness", stiff)
    first = next(iter(all_checks()))
    assert not first.passed
    assert first.error == pytest.approx(1e-6, rel=1e-3)


def test_extras_that_are_missing_are_told(monkeypatch):
    monkeypatch.setattr("flexcam.analysis.selftest.find_spec", lambda name: None if name == "pymoo" else object())
    monkeypatch.setattr("flexcam.analysis.selftest._PACKAGES", ("no-such-package",))
    monkeypatch.setattr("flexcam.analysis.selftest.jit.is_available", lambda: False)
    parts = installation_info()
    assert parts["extra design"] == "not there (pymoo): pip install 'flexcam[design]'"
    assert parts["extra tables"] == "usable"
    assert parts["no-such-package"] == "not installed"
    assert parts["compiled code"].startswith("no compiler")
