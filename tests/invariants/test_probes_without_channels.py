"""Runs that save only probes, with every engine."""

from dataclasses import replace
from pathlib import Path

import numpy as np

from flexcam import prepare, read_case
from flexcam.core import Triplets
from flexcam.dynamics import ConstantSpeed, Probe, Problem, SaveAt, State, System, newmark, solve

CASES = Path(__file__).parents[2] / "cases"


def test_all_engines_give_same_probes():
    problem = replace(prepare(read_case(CASES / "tayeb/model-2-parabolic.toml")).problem, steps=1500)
    found = [
        solve(replace(problem, engine=path), newmark(), save=SaveAt(100, channels=False))
        for path in ("direct", "modal", "kernel")
    ]
    assert all(response.channels == {} for response in found)
    for other in found[1:]:  # different order of operations
        np.testing.assert_allclose(other.probes.displacement, found[0].probes.displacement, rtol=0.0, atol=1e-10 * 0.01)


def test_probes_of_unloaded_system():
    """Without a load there are no load histories; the free vibration is still computed."""
    one = Triplets.from_dense([[1.0]])
    watch = Probe("x", ("x",), np.eye(1), (None,))
    system = System(one, Triplets.zeros(1), one, ("x",), probes=(watch,))
    problem = Problem(system, ConstantSpeed(1.0), step=0.01, steps=1500, start=State(np.ones(1), np.zeros(1)))
    response = solve(problem, newmark(), save=SaveAt(100, channels=False))
    assert response.stats.engine == "modal"
    turn = 2.0 * np.arctan(0.005)  # per step of the average acceleration, 2 arctan(omega h/2)
    expected = np.cos(turn * np.arange(1501))
    np.testing.assert_allclose(response.probes.displacement[:, 0], expected, rtol=0.0, atol=1e-12)  # rounding of steps
