"""Studies with many runs of one case: progress is reported after each run, and Ctrl-C in a run ends the study."""

import sys
from dataclasses import replace
from pathlib import Path

import pytest

from flexcam import read_case
from flexcam.analysis.comparison import compare_models_over_speed
from flexcam.analysis.limits import Search, find_limits
from flexcam.analysis.model_choice import evaluate_ladder
from flexcam.analysis.natural_modes import campbell
from flexcam.analysis.orders import Signal, waterfall
from flexcam.analysis.stability import stability_over_speeds
from flexcam.dynamics import Cause, Status, solve
from flexcam.studies.quantities import quantity_row
from tests.thinning import slow_if

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


@pytest.mark.parametrize("study", slow_if(lambda name: name == "campbell", STUDIES))
def test_interrupted_run_ends_study(study, monkeypatch):
    calls = []

    def solve_interrupted(*given, **options):
        calls.append(1)
        return replace(solve(*given, **options), status=Status(Cause.INTERRUPTED, "stopped by a signal"))

    module, path, ask = STUDIES[study]
    monkeypatch.setattr(sys.modules[f"flexcam.analysis.{module}"], "solve", solve_interrupted)
    with pytest.raises(KeyboardInterrupt):
        ask(read_case(path, SHORT))
    assert len(calls) == 1


@pytest.mark.parametrize(
    ("where", "ask"),
    [
        pytest.param(
            "flexcam.analysis.model_choice",
            lambda case: evaluate_ladder(case, "valve", repeats=1),
            marks=pytest.mark.slow,
        ),
        ("flexcam.studies.evaluation", lambda case: quantity_row(case, ["deviation.peak"])),
    ],
)
def test_interrupted_inner_run_ends_study(where, ask, monkeypatch):
    """Studies that turn failures into messages or rows do not do so with Ctrl-C."""

    def solve_interrupted(*given, **options):
        return replace(solve(*given, **options), status=Status(Cause.INTERRUPTED, "stopped by a signal"))

    monkeypatch.setattr(sys.modules[where], "solve", solve_interrupted)
    with pytest.raises(KeyboardInterrupt):
        ask(read_case(TAYEB, SHORT))


@pytest.mark.parametrize(
    "study",
    slow_if(lambda name: name not in ("campbell", "models"), STUDIES),
)
def test_progress_is_reported_for_each_run(study):
    _, path, ask = STUDIES[study]
    progress = []
    found = ask(read_case(path, SHORT), advance=progress.append)
    assert progress == [1] * (len(found[1]) if study == "trade" else 2)


@pytest.mark.parametrize("study", ["limits", "orders", "models", "campbell"])
def test_engine_selection_uses_number_of_runs(study, monkeypatch):
    """Compiled code is worthwhile for many short runs, though not for one."""
    runs = []

    def count_runs(problem, *_, **__):
        runs.append(problem.runs)
        raise KeyboardInterrupt

    module, path, ask = STUDIES[study]
    monkeypatch.setattr(sys.modules[f"flexcam.analysis.{module}"], "solve", count_runs)
    with pytest.raises(KeyboardInterrupt):
        ask(read_case(path, SHORT))
    assert runs == [2]
