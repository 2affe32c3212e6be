"""Exact round trip of the case with all options, its damping and all numbers of the run."""

from pathlib import Path

import numpy as np
import pytest

from flexcam import read_case, read_result
from flexcam.analysis.preparation import prepare
from flexcam.analysis.run import open_result_file
from flexcam.case.case import CaseRecord
from flexcam.dynamics import solve
from flexcam.io import write_csv

EVERY = Path(__file__).parents[1] / "data/every-key.toml"


@pytest.fixture(scope="module")
def saved(tmp_path_factory):
    case = read_case(EVERY, ["run.revolutions=0.2"])
    ready = prepare(case)
    sink = open_result_file(ready, tmp_path_factory.mktemp("saved"))
    response = solve(ready.problem, ready.scheme, save=ready.save, sinks=[sink])
    return case, response, read_result(sink.path)


def test_case_round_trip_as_written_and_resolved(saved):
    case, _, result = saved
    assert result.about["case"] == EVERY.read_text(encoding="utf-8")
    assert CaseRecord.model_validate_json(result.about["resolved"], context={"case": EVERY}) == case.record
    assert case.record.run.damping.modal == 0.01


def test_every_number_of_the_run(saved):
    _, response, result = saved
    for name in ("displacement", "velocity", "acceleration"):
        np.testing.assert_array_equal(getattr(result.response.probes, name), getattr(response.probes, name))
    for name, values in response.channels.items():
        np.testing.assert_array_equal(result.response.channels[name], values)
    for name in ("time", "angle", "field_time", "field_angle"):
        np.testing.assert_array_equal(getattr(result.response, name), getattr(response, name))
    assert result.response.status == response.status
    assert result.response.stats == response.stats


@pytest.mark.parametrize("every", [1, 7])
def test_csv_round_trip_is_exact(saved, tmp_path, every):
    _, response, _ = saved
    path = write_csv(response, tmp_path / "rows.csv", probes=["valve", "cam.uy"], every=every)
    rows = np.loadtxt(path, delimiter=",", skiprows=1)
    np.testing.assert_array_equal(rows[:, 0], response.time[::every])
    np.testing.assert_array_equal(rows[:, 2], response["valve"].displacement[::every])
