"""Many runs of one case: each is told of as it ends, and a Ctrl-C inside one of them ends all of them."""

from __future__ import annotations

import sys
from dataclasses import replace
from pathlib import Path

import pytest
from flexcam.analysis.natural_modes import campbell

from flexcam import read_case
from flexcam.analysis.comparison import compare_models_over_speed
from flexcam.analysis.limits import Search, find_limits
from flexcam.analysis.model_choice import evaluate_ladder
from flexcam.analysis.orders import Signal, waterfall
from flexcam.analysis.stability import stability_over_speeds
from flexcam.dynamics import Cause, Status, solve
from flexcam.studies.quantities import quantity_row

ROOT = Path(__file__).resolve().parents[2]
ENGINE = ROOT / "cases/pushrod-engine/intake.toml"
ONE_MASS = ROOT / "tests/data/limits/one-mass.toml"
TAYEB = ROOT / "cases/tayeb/model-1-shm.toml"
SHORT = ("run.revolutions=1", "run.steps_per_revolution=120")
SPEEDS = [200.0, 300.0]
BROAD = Search(150.0, 250.0, tolerance=1e3, spacing=1.0)
FORCE = Signal("contacts.intake.force")

STUDIES = {
    "limits": ("limits", ONE_MASS, lambda case, **o: find_limits(case, BROAD, ["loss_of_contact"], **o)),
    "campbell": ("orders", ENGINE, lambda case, **o: campbell(case, SPEEDS, orders=[1], **o)),
    "orders": ("orders", ENGINE, lambda case, **o: waterfall(case, SPEEDS, [FORCE], 4, **o)),
    "models": ("comparison", ENGINE, lambda case, **o: compare_models_over_speed(case, SPEEDS, **o)),
    "stability": ("stability", TAYEB, lambda case, **o: stability_over_speeds(case, SPEEDS, **o)),
    "trade": ("model_choice", TAYEB, lambda case, **o: evaluate_ladder(case, "valve", repeats=1, **o)),
}
"""Module of `flexcam.analysis`, case and call by study."""


@pytest.mark.parametrize("study", STUDIES)
def test_a_stopped_run_stops_what_asked_for_it(study, monkeypatch):
    calls = []

    def stopped(*given, **options):
        calls.append(1)
        return replace(solve(*given, **options), status=Status(Cause.INTERRUPTED, "stopped by a signal"))

    module, path, ask = STUDIES[study]
    monkeypatch.setattr(sys.modules[f"flexcam.analysis.{module}"], "solve", stopped)
    with pytest.raises(KeyboardInterrupt):
        ask(read_case(path, SHORT))
    assert len(calls) == 1


@pytest.mark.parametrize(
    ("where", "ask"),
    [
        ("flexcam.analysis.model_choice", lambda case: evaluate_ladder(case, "valve", repeats=1)),
        ("flexcam.studies.evaluation", lambda case: quantity_row(case, ["deviation.peak"])),
    ],
)
def test_a_run_behind_another_is_heeded_too(where, ask, monkeypatch):
    """Those that make a sentence of a failure, or a row, do not make one of a Ctrl-C."""

    def stopped(*given, **options):
        return replace(solve(*given, **options), status=Status(Cause.INTERRUPTED, "stopped by a signal"))

    monkeypatch.setattr(sys.modules[where], "solve", stopped)
    with pytest.raises(KeyboardInterrupt):
        ask(read_case(TAYEB, SHORT))


@pytest.mark.parametrize("study", STUDIES)
def test_each_is_told_of(study):
    _, path, ask = STUDIES[study]
    told = []
    found = ask(read_case(path, SHORT), advance=told.append)
    assert told == [1] * (len(found[1]) if study == "trade" else 2)


@pytest.mark.parametrize("study", ["limits", "orders", "models", "campbell"])
def test_the_runs_to_come_count(study, monkeypatch):
    """Machine code pays for many short runs where it would not for one."""
    runs = []

    def counted(problem, *_, **__):
        runs.append(problem.runs)
        raise KeyboardInterrupt

    module, path, ask = STUDIES[study]
    monkeypatch.setattr(sys.modules[f"flexcam.analysis.{module}"], "solve", counted)
    with pytest.raises(KeyboardInterrupt):
        ask(read_case(path, SHORT))
    assert runs == [2]
