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
"""The lift; the follower hops on the base circle behind it, and two runs there are soon different ones."""
FORCE = "contacts.intake.force"


def measured() -> list[dict[str, object]]:
    """Return the error of the force relative to its rms value, by case, method and steps."""
    rows: list[dict[str, object]] = []
    for case in CASES:
        exact = _run(case, "collocation", REFERENCE).channels[FORCE]
        for steps in STEPS:
            fine = exact[:: REFERENCE // steps]
            for method in METHODS:
                missed = _run(case, method, steps).channels[FORCE] - fine
                error = float(np.sqrt(np.mean(missed**2) / np.mean(fine**2)))
                rows.append({"case": case, "method": method, "steps": steps, "error": error})
    return rows


def _run(case: str, method: str, steps: int) -> Response:
    words = (f"run.revolutions={REVOLUTIONS}", f"run.steps_per_revolution={steps}", f"run.integrator.method={method}")
    ready = prepare(read_case(ROOT / f"cases/{case}.toml", [*words, "run.engine=kernel"]))
    return solve(ready.problem, ready.scheme, save=ready.save)
