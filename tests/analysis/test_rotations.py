"""Results of a follower arm that rotates by the lift of its cam."""

import math
from pathlib import Path

import pytest

from flexcam import compare, read_case, run
from flexcam.analysis.histories import extract_histories
from flexcam.dynamics.memory import ExtremesSink
from flexcam.report.tables import comparison_table, run_table

ARM = read_case(Path(__file__).with_name("arm.toml"))


@pytest.fixture(scope="module")
def response():
    return run(ARM)


def cells(table):
    return [list(column.cells) for column in table.columns]


def test_rotation_is_not_shown_as_length(response):
    """The rigid arm rotates by the lift of 18 deg, at most 2 lift/rise in time."""
    result = compare(response, run(ARM, rigid=True), "load.rx", 300.0)
    assert [row.unit for row in result.deviations] == ["rad", "rad/s", "rad/s^2"]
    names, rigid, *_ = cells(comparison_table(result))
    assert names == ["displacement, deg", "velocity, rad/s", "acceleration, rad/s^2"]
    assert rigid[:2] == ["18", f"{2.0 * math.radians(18.0) / (100.0 / 1800.0):.4g}"]
    histories = extract_histories(response, "load.rx")
    assert [histories.unit(name) for name in ("lift", "velocity", "force main")] == ["rad", "rad/s", "N"]
    names, _, largest = cells(run_table(ARM, ExtremesSink.of(response)))
    value, unit = largest[names.index("load.rx")].split()
    assert float(value) == pytest.approx(18.0, abs=0.5)
    assert unit == "deg"
