"""Error of the cam force, by method and number of steps."""

from __future__ import annotations

import numpy as np

from benchmarks.processes import ROOT
from flexcam import prepare, read_case
from flexcam.dynamics import Response, solve

CASES = ("pushrod-engine/intake", "pushrod-engine/lever", "direct-acting/bucket")
METHODS = ("newmark", "collocation")
STEPS = (1800, 3600, 7200, 14400)
"""Steps per revolution."""
REFERENCE = 115_200
REVOLUTIONS = 0.5
"""The lift alone: on the base circle after it the follower bounces, and small differences of two runs grow fast."""
FORCE = "contacts.intake.force"


def measure_table() -> list[dict[str, object]]:
    """Return the rms error of the force relative to its rms value, by case, method and steps."""
    rows: list[dict[str, object]] = []
    for case in CASES:
        reference = _run(case, "collocation", REFERENCE).channels[FORCE]
        for steps in STEPS:
            expected = reference[:: REFERENCE // steps]
            for method in METHODS:
                difference = _run(case, method, steps).channels[FORCE] - expected
                error = float(np.sqrt(np.mean(difference**2) / np.mean(expected**2)))
                rows.append({"case": case, "method": method, "steps": steps, "error": error})
    return rows


def _run(case: str, method: str, steps: int) -> Response:
    run = {"revolutions": REVOLUTIONS, "steps_per_revolution": steps, "integrator.method": method, "engine": "kernel"}
    ready = prepare(read_case(ROOT / f"cases/{case}.toml", [f"run.{key}={value}" for key, value in run.items()]))
    return solve(ready.problem, ready.scheme, save=ready.save)
