"""Time per speed in a sweep over many speeds of a published model."""

from __future__ import annotations

import sys
import tempfile
import time
from collections.abc import Callable
from dataclasses import replace

import numpy as np

from benchmarks.processes import ROOT, time_command
from flexcam import prepare, read_case
from flexcam.core.units import RPM
from flexcam.dynamics import SaveAt, solve
from flexcam.studies.evaluation import evaluate

CASE = ROOT / "cases/tayeb/model-3-shm.toml"
SPEEDS, COMMAND_SPEEDS = 200, 1000


def measure_table(count: int = 0) -> dict[str, float]:
    """Return ms per speed of complete rows, of the motion and of the probes alone, and the time of the command in s."""
    case = read_case(CASE)
    model = prepare(case).model
    speeds = (np.linspace(1000.0, 6000.0, count or SPEEDS) * RPM).tolist()

    def row(speed: float, *, channels: bool) -> bool:
        return evaluate(case.at_speed(speed), model=model, runs=len(speeds), channels=channels).status.ok

    def probes(speed: float) -> bool:
        ready = prepare(case.at_speed(speed), model=model)
        minimal = SaveAt(field_every=ready.problem.steps, channels=False)
        return solve(replace(ready.problem, runs=len(speeds)), ready.scheme, save=minimal).status.ok

    assert row(speeds[0], channels=True)  # warm-up: imports and caches
    return {
        "speeds": len(speeds), "steps": prepare(case).problem.steps,
        "row_ms": _time_per_speed(lambda speed: row(speed, channels=True), speeds),
        "motion_ms": _time_per_speed(lambda speed: row(speed, channels=False), speeds),
        "probes_ms": _time_per_speed(probes, speeds),
        "commanded": count or COMMAND_SPEEDS, "command_s": _time_sweep(count or COMMAND_SPEEDS),
    }  # fmt: skip


def _time_per_speed(run: Callable[[float], bool], speeds: list[float]) -> float:
    """Return milliseconds per speed."""
    start = time.perf_counter()
    assert all(run(speed) for speed in speeds)
    return (time.perf_counter() - start) * 1e3 / len(speeds)


def _time_sweep(count: int) -> float:
    """Return the time of the command for the motion of the probes at `count` speeds in two processes, s."""
    spec = f"run.speed=1000:6000#{count}rpm"
    with tempfile.TemporaryDirectory() as folder:
        options = ("--set", spec, "--scalars", "probes", "--workers", "2", "--output", folder)
        return time_command([sys.executable, "-m", "flexcam", "sweep", CASE, *options])
