"""Representations of large objects are short."""

from pathlib import Path

import flexcam
from flexcam.analysis.run import open_result_file

CASE = Path(__file__).parents[2] / "cases/tayeb/model-1-shm.toml"


def test_representations_are_one_short_line(tmp_path):
    case = flexcam.read_case(CASE, ["run.revolutions=0.01"])
    ready = flexcam.prepare(case)
    sink = open_result_file(ready, tmp_path)
    response = flexcam.solve(ready.problem, ready.scheme, save=ready.save, sinks=[sink])
    result = flexcam.read_result(sink.path)
    words = {str(one) for one in (case, ready, ready.problem.system, response, response["valve"], result)}
    assert all(len(one) < 300 and "array" not in one and "\n" not in one for one in words)
    assert "<Response, done: the run is complete; 37 instants, 3 fields; probes: valve, cam; 14 channels>" in words
    assert "<History of valve: valve; shape (37,)>" in words
