"""`flexcam selftest`: checks, failed checks and missing extras."""

from dataclasses import replace

import pytest

from flexcam.analysis.selftest import Check, all_checks, installation_info
from flexcam.cli.main import load_commands
from flexcam.dynamics.jit import Program
from flexcam.fem.assembly import stiffness as fem_stiffness

load_commands(["selftest"])
COMMAND = "flexcam.cli.case_files.all_checks"


def test_selftest_passes_without_other_files(flexcam, tmp_path):
    """In an empty folder: the selftest needs no other file and leaves no file there."""
    done = flexcam("selftest")
    assert done.code == 0
    assert "All 23 checks passed" in done.out
    for words in ("tip of a", "buckling", "4027", "kernel solver", "numpy", "optional packages: tables"):
        assert words in done.out
    assert "FAILED" not in done.out
    assert list(tmp_path.iterdir()) == []


def test_failed_check_is_named(flexcam, monkeypatch):
    failed_checks = [Check("pi", "Archimedes", 3.14159265, 22 / 7, 1e-4), Check("e", "Euler", 2.718, float("nan"), 1.0)]
    monkeypatch.setattr(
        COMMAND, lambda: iter([*failed_checks, replace(failed_checks[0], quantity="fine", tolerance=1.0)])
    )
    plain = flexcam("selftest")
    assert plain.code == 3
    assert plain.out.count("FAILED") == 2
    assert "2 of 3 checks exceed their tolerance: pi; e" in plain.err
    done = flexcam("selftest", "--json")
    assert done.code == 3
    assert done.json["status"] == "fault"
    assert [check["passed"] for check in done.json["checks"]] == [False, False, True]
    assert done.json["checks"][1]["computed"] is None


def test_wrong_element_stiffness_fails_selftest(monkeypatch):
    """The stiffness is one part in a million too large."""

    def scaled_stiffness(beams, dofs):
        return fem_stiffness(beams, dofs).scale(1.0 + 1e-6)

    monkeypatch.setattr("flexcam.analysis.selftest.stiffness", scaled_stiffness)
    first = next(iter(all_checks()))
    assert not first.passed
    assert first.error == pytest.approx(1e-6, rel=1e-3)


def test_installation_info_lists_missing_extras(monkeypatch):
    monkeypatch.setattr("flexcam.analysis.selftest.find_spec", lambda name: None if name == "pymoo" else object())
    monkeypatch.setattr("flexcam.analysis.selftest._PACKAGES", ("no-such-package",))
    monkeypatch.setattr(Program, "is_available", lambda program: False)
    parts = installation_info()
    assert parts["extra design"] == "not there (pymoo): pip install 'flexcam[design]'"
    assert parts["extra tables"] == "installed"
    assert parts["no-such-package"] == "not installed"
    assert parts["compiled code"].startswith("missing: install numba")
