"""Many speeds of the published model: what a run costs when it is one of many."""

from __future__ import annotations

import time
from dataclasses import replace

import numpy as np

from benchmarks.processes import ROOT
from flexcam import prepare, read_case
from flexcam.integrate import SaveAt, solve
from flexcam.sweep import evaluate
from flexcam.units import RPM

CASE = ROOT / "cases/tayeb/model-3-shm.toml"
SPEEDS = 200


def measured(count: int = 0) -> dict[str, float]:
    """Return milliseconds per speed of the whole row of a sweep, and of the motion of the probes alone."""
    speeds, case = count or SPEEDS, read_case(CASE)
    model = prepare(case).model
    each = (np.linspace(1000.0, 6000.0, speeds) * RPM).tolist()
    evaluate(case, model=model, runs=speeds)  # what is imported and made once
    begun = time.perf_counter()
    for speed in each:
        assert evaluate(case.at_speed(speed), model=model, runs=speeds).status.ok
    rows = time.perf_counter()
    for speed in each:
        ready = prepare(case.at_speed(speed), model=model)
        few = SaveAt(field_every=ready.problem.steps, channels=False)
        assert solve(replace(ready.problem, runs=speeds), ready.scheme, save=few).status.ok
    ended = time.perf_counter()
    per_speed = 1e3 / speeds
    return {
        "speeds": speeds, "steps": ready.problem.steps, "row_ms": (rows - begun) * per_speed,
        "probes_ms": (ended - rows) * per_speed,
    }  # fmt: skip
