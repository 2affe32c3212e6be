"""Divergence gives a status with time, cam angle, unknown and remedy; arrays and files contain finite numbers only.

Linear acceleration (Newmark with beta = 1/6) is stable up to omega dt = 2 sqrt 3 = 3.46.
"""

from __future__ import annotations

import math
import re

import h5py
import numpy as np
import pytest

from flexcam import prepare, read_case
from flexcam.analysis.run import open_result_file
from flexcam.dynamics import Cause, ConstantSpeed, Problem, State, newmark, solve

DIVERGING = "a run that diverges"
STABILITY_LIMIT = 2.0 * math.sqrt(3.0)
UNSTABLE = ["run.integrator.beta=0.16666666666666666", "run.steps_per_revolution=360", "run.revolutions=20"]


def solve_oscillator(system_of, x):
    system = system_of([[1.0]], [[0.0]], [[1.0]])
    start = State(np.ones(1), np.zeros(1))
    return solve(Problem(system, ConstantSpeed(1.0), x, 5000, start), newmark(beta=1 / 6))


def all_finite(response):
    parts = [getattr(s, n) for s in (response.probes, response.fields) for n in s.__annotations__]
    return all(np.isfinite(part).all() for part in (response.time, response.angle, *parts, *response.channels.values()))


def test_amplitude_is_bounded_below_stability_limit(expect, system_of):
    response = solve_oscillator(system_of, 0.999 * STABILITY_LIMIT)
    assert response.status.ok
    # The eigenvalues are a pair of modulus 1: the amplitude is bounded by 1/sqrt(1 - (x/edge)^2) = 22.
    expect.right(DIVERGING, "linear acceleration, omega dt 0.999 of 2 sqrt 3, 5000 steps", what="amplitude above 22 by",
                 reference=0.0, computed=max(0.0, np.abs(response["all"].displacement).max() - 22.4), tolerance=0.0,
                 absolute=True)  # fmt: skip


@pytest.mark.parametrize("over", [1.01, 1.5, 100.0])
def test_divergence_above_stability_limit_gives_status(expect, system_of, over):
    response = solve_oscillator(system_of, over * STABILITY_LIMIT)
    assert response.status.cause is Cause.NOT_FINITE
    assert 0 < len(response.time) < 5001
    assert all_finite(response)
    expect.refuses(DIVERGING, f"linear acceleration, omega dt {over:g} of 2 sqrt 3", str(response.status),
                   "x0 is not finite", r"t = [\d.e+]+ s", r"cam angle [\d.]+ deg", "smaller step")  # fmt: skip


def test_command_on_diverging_case_gives_status(expect, command, tayeb):
    words = [word for one in UNSTABLE for word in ("--set", one)]
    code, output = command("run", tayeb, "-o", "out", *words)
    assert code == 3
    match = re.search(r"not-finite:[^\n]*(?:\n(?!\n)[^\n]*){0,3}", output)
    expect.refuses(DIVERGING, "flexcam run, published case, linear acceleration, 360 steps per revolution; exit code 3",
                   match[0] if match else output, r"\S+\.[ur][xyz] is not finite", r"t = [\d.e+-]+ s",
                   r"cam angle [\d.]+ deg", "smaller step")  # fmt: skip


def test_file_of_diverging_run_is_finite(expect, tmp_path, tayeb):
    ready = prepare(read_case(tayeb, UNSTABLE))
    sink = open_result_file(ready, tmp_path)
    response = solve(ready.problem, ready.scheme, save=ready.save, sinks=[sink])
    assert response.status.cause is Cause.NOT_FINITE
    assert all_finite(response)
    wrong: list[str] = []

    def look(name, item):
        if isinstance(item, h5py.Dataset) and item.dtype.kind == "f" and not np.isfinite(item[...]).all():
            wrong.append(name)

    with h5py.File(sink.partial) as file:
        file.visititems(look)
    assert not wrong
    expect.right(DIVERGING, "its partial result file", what="data sets with NaN or infinity:", reference=0.0,
                 computed=len(wrong), tolerance=0.0, absolute=True)  # fmt: skip
