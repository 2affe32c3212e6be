"""Blocks wait until they are worth writing: the file is that of blocks written one by one, and a stop loses none."""

from __future__ import annotations

import subprocess
import sys

import h5py
import numpy as np
import pytest

from flexcam import prepare, read_case, read_result
from flexcam.dynamics import Cause
from flexcam.io import result_writer
from tests.sinks import Cut


@pytest.fixture(scope="module")
def longer(ready):
    """Get the inline case ready to run for seven blocks."""
    return prepare(read_case(ready.case.path, ["run.revolutions=6"]))


def content(path):
    """Return every dataset of numbers by its name."""
    found = {}
    with h5py.File(path, "r") as file:
        file.visititems(lambda n, d: found.update({n: d[()]}) if isinstance(d, h5py.Dataset) else None)
    return {name: values for name, values in found.items() if not name.startswith(("about/", "status/"))}


def test_the_file_is_that_of_blocks_written_one_by_one(longer, solve_into, monkeypatch, tmp_path):
    together = content(solve_into(longer, tmp_path / "together")[1].path)
    monkeypatch.setattr(result_writer, "_MIN_WRITE_BYTES", -1)
    single = content(solve_into(longer, tmp_path / "single")[1].path)
    assert together.keys() == single.keys()
    assert all(np.array_equal(values, single[name]) for name, values in together.items())


@pytest.mark.parametrize("blocks", [0, 1, 3])
def test_a_run_that_is_stopped_keeps_what_waited(blocks, longer, solve_into, tmp_path):
    """The first block has `blocks` behind it when the run is stopped; none of them was worth writing."""
    response, sink = solve_into(longer, tmp_path, sinks=[Cut(after=blocks)])
    assert response.status.cause is Cause.INTERRUPTED
    read = read_result(sink.partial).response
    assert len(read.time) == 640 * (blocks + 1)
    assert np.array_equal(read.probes.displacement[: len(response.time)], response.probes.displacement)


KILL = """
import os, sys
from flexcam import read_case
from flexcam.dynamics import solve
from flexcam.analysis.preparation import prepare
from flexcam.analysis.run import open_result_file
ready = prepare(read_case(sys.argv[1]))
file = open_result_file(ready, sys.argv[2])
file.write_checkpoint = lambda checkpoint: os._exit(9)
solve(ready.problem, ready.scheme, save=ready.save, sinks=[file])
"""


def test_a_run_that_is_killed_at_once_leaves_no_copy(ready, tmp_path):
    """Copies cost a fiftieth of the time at most, the first one too."""
    done = subprocess.run([sys.executable, "-c", KILL, str(ready.case.path), str(tmp_path)], timeout=60, check=False)
    assert done.returncode == 9
    assert [path.name for path in tmp_path.iterdir()] == ["inline.writing"]
