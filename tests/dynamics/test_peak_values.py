"""Peak values between the instants of a history: cubics in closed form, sines, and all reports of peaks."""

import numpy as np
import pytest

from flexcam import compare, prepare, read_case, run
from flexcam.analysis.histories import extract_histories
from flexcam.dynamics import peak, turning_points, value_range
from flexcam.dynamics.memory import ExtremesSink
from flexcam.studies.evaluation import compute_scalars

CASE = "cases/tayeb/model-1-cycloidal.toml"


def test_turning_points_of_cubic():
    """x^3 - 3 x has its turning points at -1 and 1, with values 2 and -2, for any instants."""
    time = np.array([-3.0, 0.5, 0.7, 4.0])
    instants, values = turning_points(time, time**3 - 3.0 * time, 3.0 * time**2 - 3.0)
    turned = sorted((float(t), float(v)) for t, v in zip(instants, values, strict=True) if t not in time)
    np.testing.assert_allclose(turned, [(-1.0, 2.0), (1.0, -2.0)], rtol=1e-14)


@pytest.mark.parametrize("slope", [0.0, 2.0, -1e-300])
def test_straight_lines_have_no_turning_points(slope):
    time = np.linspace(0.0, 1.0, 5)
    assert value_range(time, 1.0 + slope * time, np.full(5, slope)) == pytest.approx(abs(slope), rel=1e-15)
    assert peak(time, 1.0 + slope * time, np.full(5, slope))[0] == 1.0 + max(slope, 0.0)


@pytest.mark.parametrize("steps", [8, 16, 46])
def test_peak_of_coarse_sine(steps):
    """The error of the cubic is at most (2 pi/m)^4/384, that of the instants 1 - cos(pi/m)."""
    time = 2.0 * np.pi * (np.arange(steps + 1) - 0.5) / steps
    largest, at = peak(time, -np.cos(time), np.sin(time))
    assert abs(largest - 1.0) <= (2.0 * np.pi / steps) ** 4 / 384.0
    assert peak(time, -np.cos(time))[0] <= np.cos(np.pi / steps) + 1e-15
    assert min(abs(at - k * np.pi) for k in range(3)) < 1e-9


@pytest.mark.parametrize("seed", range(20))
def test_peak_and_range_include_every_turning_point(seed):
    random = np.random.default_rng(seed)
    time, values = np.cumsum(random.uniform(0.1, 2.0, 30)), random.normal(size=30)
    slopes = random.normal(size=30) * random.choice([0.1, 1.0, 10.0], 30)
    points = np.append(values, turning_points(time, values, slopes)[1])
    assert peak(time, values, slopes)[0] == np.abs(points).max()
    assert value_range(time, values, slopes) == np.ptp(points)


def test_peak_of_empty_history_is_zero():
    nothing = np.zeros(0)
    assert peak(nothing, nothing, nothing) == (0.0, 0.0)
    assert value_range(nothing, nothing) == value_range(nothing, nothing, nothing) == 0.0
    assert peak(np.ones(1), np.array([-2.0]), np.ones(1)) == (2.0, 1.0)


def test_all_reports_agree_on_peak_motion():
    """Summary of a run, row of a sweep, comparison and estimate."""
    case = read_case(CASE, ["run.steps_per_revolution=45", "run.revolutions=1"])
    ready, response = prepare(case), run(case)
    rows = {one.name: one.value for one in compute_scalars(ready, response)}
    least, largest = (float(one[0]) for one in ExtremesSink.of(response).probe("valve"))
    found = compare(response, run(case, rigid=True), "valve", 1.0).deviations
    assert rows["probes.valve.displacement.largest"] == found[0].flexible_peak == max(largest, -least)
    assert (
        rows["probes.valve.velocity.largest"]
        == found[1].flexible_peak
        == extract_histories(response, "valve").size("velocity")
    )
    assert extract_histories(response, "valve").size("lift") == largest - least
    assert found[0].flexible_peak > np.abs(response["valve"].displacement).max()
