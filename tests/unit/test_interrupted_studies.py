"""A Ctrl-C inside one of many runs ends all of them."""

from __future__ import annotations

import sys
from dataclasses import replace
from pathlib import Path

import pytest

from flexcam import read_case
from flexcam.integrate import solve
from flexcam.limits import find_limits
from flexcam.response import Cause, Status
from flexcam.stability import campbell

ENGINE = Path(__file__).resolve().parents[2] / "cases/pushrod-engine/intake.toml"
QUICK = ("run.steps_per_revolution=180", "run.revolutions=1")


@pytest.mark.parametrize(
    ("where", "ask"),
    [
        ("flexcam.limits", lambda case: find_limits(case, lowest=200.0, highest=300.0)),
        ("flexcam.stability.campbell", lambda case: campbell(case, [200.0, 300.0], orders=[1])),
    ],
    ids=["limits", "campbell"],
)
def test_a_stopped_run_stops_what_asked_for_it(where, ask, monkeypatch):
    calls = []

    def stopped(*given, **options):
        calls.append(1)
        return replace(solve(*given, **options), status=Status(Cause.INTERRUPTED, "stopped by the user"))

    monkeypatch.setattr(sys.modules[where], "solve", stopped)
    with pytest.raises(KeyboardInterrupt):
        ask(read_case(ENGINE, QUICK))
    assert len(calls) == 1
