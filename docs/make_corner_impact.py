"""Make docs/pictures/corner-impact.png: the position of a cam follower once per revolution, over the speed of the cam.

Speeds rise and then fall. Each run starts from the final state of the last one; so the picture shows coexisting motions.
"""

from __future__ import annotations

import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

ROOT = Path(__file__).parents[1]
sys.path.insert(0, str(ROOT))

from flexcam import solve  # noqa: E402 - needs the path above
from flexcam.dynamics import State  # noqa: E402
from tests.verification.corner_cam import prepared  # noqa: E402
from tests.verification.test_corner_impact import orbit_start  # noqa: E402

MIN_SPEED, CORNER_SPEED, MAX_SPEED, STEP = 640.0, 673.234, 700.0, 0.5
REVOLUTIONS, SHOWN, STEPS = 180, 50, 360


def positions(speeds: np.ndarray) -> list[np.ndarray]:
    """Return the positions at cam angle 0 in the last revolutions at each speed."""
    start, results = State(np.zeros(1), np.zeros(1)), list[np.ndarray]()
    for rpm in speeds:
        ready = prepared(rpm, f"run.revolutions={REVOLUTIONS}", f"run.steps_per_revolution={STEPS}")
        follower = solve(replace(ready.problem, start=start), ready.scheme)["follower.uy"]
        start = State(follower.displacement[-1:], follower.velocity[-1:])
        results.append(follower.displacement[::STEPS][-SHOWN:])
    return results


def bifurcation_diagram() -> Figure:
    """Return the bifurcation diagram with the closed-form orbit of one impact per revolution."""
    speeds = np.arange(MIN_SPEED, MAX_SPEED + 0.5 * STEP, STEP)
    figure = Figure(figsize=(8.0, 4.2), layout="constrained")
    axes = figure.subplots()
    for values, colour, name in ((speeds, "#0072B2", "rising speed"), (speeds[::-1], "#D55E00", "falling speed")):
        axes.plot(np.repeat(values, SHOWN), np.concatenate(positions(values)), ".", color=colour, markersize=1.5)
        axes.plot([], [], "s", color=colour, markersize=4, label=name)
    above = np.linspace(CORNER_SPEED + 0.01, MAX_SPEED, 200)
    height = [orbit_start(rpm).displacement[0] for rpm in above]
    axes.plot(above, height, color="0.3", linewidth=0.6, label="one impact per turn, closed form")
    axes.axvline(CORNER_SPEED, color="0.6", linestyle="--", linewidth=0.8)
    axes.annotate("impact at the corner", (CORNER_SPEED, 0.65), (-4, 0), ("data", "axes fraction"), "offset points",
                  ha="right")  # fmt: skip
    axes.set_xlabel("cam speed, rpm")
    axes.set_ylabel("follower at cam angle 0, m")
    axes.grid(alpha=0.3)
    axes.legend(loc="upper left")
    return figure


if __name__ == "__main__":
    bifurcation_diagram().savefig(ROOT / "docs/pictures/corner-impact.png", dpi=120)
