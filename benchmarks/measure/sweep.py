"""Many speeds of the published model: what a run costs when it is one of many."""

from __future__ import annotations

import sys
import tempfile
import time
from collections.abc import Callable
from dataclasses import replace

import numpy as np

from benchmarks.processes import ROOT, seconds
from flexcam import prepare, read_case
from flexcam.core.units import RPM
from flexcam.dynamics import SaveAt, solve
from flexcam.studies.evaluation import evaluate

CASE = ROOT / "cases/tayeb/model-3-shm.toml"
SPEEDS, COMMANDED = 200, 1000


def measured(count: int = 0) -> dict[str, float]:
    """Return milliseconds per speed of rows of a sweep and of bare runs, and seconds of the whole command."""
    speeds, case = count or SPEEDS, read_case(CASE)
    model = prepare(case).model
    each = (np.linspace(1000.0, 6000.0, speeds) * RPM).tolist()

    def row(speed: float, *, channels: bool) -> bool:
        return evaluate(case.at_speed(speed), model=model, runs=speeds, channels=channels).status.ok

    def probes(speed: float) -> bool:
        ready = prepare(case.at_speed(speed), model=model)
        few = SaveAt(field_every=ready.problem.steps, channels=False)
        return solve(replace(ready.problem, runs=speeds), ready.scheme, save=few).status.ok

    assert row(each[0], channels=True)  # what is imported and made once
    return {
        "speeds": speeds, "steps": prepare(case).problem.steps,
        "row_ms": _each(lambda speed: row(speed, channels=True), each),
        "motion_ms": _each(lambda speed: row(speed, channels=False), each),
        "probes_ms": _each(probes, each),
        "commanded": count or COMMANDED, "command_s": _command(count or COMMANDED),
    }  # fmt: skip


def _each(run: Callable[[float], bool], speeds: list[float]) -> float:
    """Return milliseconds per speed."""
    begun = time.perf_counter()
    assert all(run(speed) for speed in speeds)
    return (time.perf_counter() - begun) * 1e3 / len(speeds)


def _command(count: int) -> float:
    """Return how long the command takes for the motion of the probes at so many speeds, in two processes."""
    spec = f"run.speed=1000:6000#{count}rpm"
    with tempfile.TemporaryDirectory() as folder:
        options = ("--set", spec, "--scalars", "probes", "--workers", "2", "--output", folder)
        return seconds([sys.executable, "-m", "flexcam", "sweep", CASE, *options])
