"""Fits to synthetic measurements with known noise: estimates and their intervals.

A model linear in its value has the least squares in closed form: a constant force F on a spring k, measured n times
with the noise s, has the half width t s k/sqrt(n). For the damped oscillator, nonlinear in its values, the 95 %
intervals must contain the true values about that often.
"""

import math
from dataclasses import replace
from functools import partial

import numpy as np
import pytest
from scipy.special import stdtrit

from flexcam.case.reader import CaseFile
from flexcam.studies.executors import open_evaluators
from flexcam.studies.fitting import Curve, Measurement, curve_row, fit_curves
from flexcam.studies.variables import PointEvaluator, variables_of

SOURCE = "Fits to synthetic measurements"
TRUE_VALUES = {"springs.one.stiffness": 42e3, "springs.one.damping": 6.0, "loads.push.force": -160.0}

CASE = """
format = 1
nodes = { mass = [0.0, 0.0, 0.0] }
supports = { mass = ["ux", "uz"] }
masses.mass = { at = "mass", mass = "0.1 kg" }
loads.push = { at = "mass", direction = "uy", force = -150.0 }
output = { probes = ["mass"] }
[springs]
one = { at = "mass", direction = "uy", stiffness = 40000.0, damping = 5.0 }
other = { at = "mass", direction = "uy", stiffness = 1.0 }
[run]
speed = "3000 rpm"
revolutions = 2
steps_per_revolution = 180
"""


@pytest.fixture(scope="module")
def case_file(tmp_path_factory):
    path = tmp_path_factory.mktemp("fit") / "case.toml"
    path.write_text(CASE, encoding="utf-8")
    return CaseFile.open(path)


def fit_case(file, measured, *settings, fixed=()):
    case = file.read(fixed)
    variables = variables_of(case, settings, "--vary")
    with open_evaluators(file, fixed, partial(curve_row, measured=measured)) as (runs,):
        return fit_curves(PointEvaluator(case, variables, runs), measured)


def simulate_measurement(file, overrides, instants, size, random, *, known=False):
    """Return the simulated position of the mass with noise of a given size."""
    curve = Curve("mass.uy displacement", "probes.mass.uy.displacement", "m", np.zeros(0))
    exact = Measurement("time", instants, (curve,)).simulate(file.read(overrides))[0]
    values = exact + size * random.standard_normal(len(exact))
    return Measurement("time", instants, (replace(curve, values=values, noise=size if known else None),))


def test_interval_of_constant_force(record, case_file):
    instants, size = np.linspace(0.0, 0.04, 41), 2e-4
    fixed = ("run.start=equilibrium",)
    measured = simulate_measurement(case_file, fixed, instants, size, np.random.default_rng(3))
    found = fit_case(case_file, measured, "loads.push.force=-300:-50N", fixed=fixed)
    values, stiffness = measured.curves[0].values, 40001.0
    spread = values.std(ddof=1)
    for quantity, reference, computed in (
        ("estimate", stiffness * values.mean(), found.values[0]),
        ("half width of the 95 % interval", stdtrit(40, 0.975) * spread * stiffness / math.sqrt(41.0),
         found.intervals[0]),
    ):  # fmt: skip
        record(source=SOURCE, case="constant force on a spring", quantity=quantity, unit="N", reference=reference,
               computed=float(computed), tolerance=1e-6, reason="linear least squares in closed form")  # fmt: skip
    known = simulate_measurement(case_file, fixed, instants, size, np.random.default_rng(3), known=True)
    exact = stdtrit(40, 0.975) * size * stiffness / math.sqrt(41.0)
    assert fit_case(case_file, known, "loads.push.force=-300:-50N", fixed=fixed).intervals[0] == pytest.approx(
        exact, rel=1e-6
    )


@pytest.mark.slow
def test_intervals_cover_true_values(record, case_file):
    """The fit estimates the size of the noise of a position from fifty draws."""
    overrides, random = [f"{key}={value}" for key, value in TRUE_VALUES.items()], np.random.default_rng(11)
    inside = np.zeros((50, 3))
    for draw in inside:
        measured = simulate_measurement(case_file, overrides, np.linspace(0.0, 0.04, 60), 2e-4, random)
        found = fit_case(case_file, measured, "springs.one.stiffness=20:80kN/m", "springs.one.damping=0.5:20N s/m",
                       "loads.push.force=-300:-50N")  # fmt: skip
        assert found.converged
        draw[:] = np.abs(found.values * [1e3, 1.0, 1.0] - list(TRUE_VALUES.values())) <= found.intervals * [
            1e3,
            1.0,
            1.0,
        ]
        assert not found.undetermined
    for key, share in zip(TRUE_VALUES, inside.mean(axis=0), strict=True):
        record(source=SOURCE, case="damped oscillator, 50 draws of noise", quantity=f"{key}, within its 95 % interval",
               unit="1", reference=0.95, computed=float(share), tolerance=0.055, absolute=True,
               reason="fifty draws: 0.90 to 1 happens 19 times in 20")  # fmt: skip


@pytest.mark.slow
def test_linearly_dependent_values_are_undetermined(case_file):
    """For two springs at one mass, the data determine the sum but neither stiffness."""
    measured = simulate_measurement(case_file, (), np.linspace(0.0, 0.04, 60), 2e-4, np.random.default_rng(1))
    found = fit_case(case_file, measured, "springs.one.stiffness=20:80kN/m", "springs.other.stiffness=0:20kN/m",
                   "springs.one.damping=0.5:20N s/m")  # fmt: skip
    assert found.undetermined == ((0, 1),)
    assert np.isinf(found.intervals[:2]).all()
    assert math.isfinite(found.intervals[2])
    assert 1e3 * found.values[:2].sum() == pytest.approx(40001.0, rel=0.05)
