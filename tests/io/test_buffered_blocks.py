"""Buffering of small blocks: the file is the same as without buffering, and an interrupt loses no block."""

import subprocess
import sys
from dataclasses import replace

import h5py
import numpy as np
import pytest

from flexcam import prepare, read_case, read_result
from flexcam.dynamics import Cause
from flexcam.io import result_writer
from tests.sinks import Cut


@pytest.fixture(scope="module")
def ready_for_seven_blocks(ready):
    """Return the inline case prepared for seven blocks of 640 steps."""
    return replace(prepare(read_case(ready.case.path, ["run.revolutions=6"])), save=ready.save)


def content(path):
    """Return all numeric datasets by name."""
    found = {}
    with h5py.File(path, "r") as file:
        file.visititems(lambda n, d: found.update({n: d[()]}) if isinstance(d, h5py.Dataset) else None)
    return {name: values for name, values in found.items() if not name.startswith(("about/", "status/"))}


def test_buffered_file_equals_unbuffered_file(ready_for_seven_blocks, solve_into, monkeypatch, tmp_path):
    together = content(solve_into(ready_for_seven_blocks, tmp_path / "together")[1].path)
    monkeypatch.setattr(result_writer, "_MIN_WRITE_BYTES", -1)
    single = content(solve_into(ready_for_seven_blocks, tmp_path / "single")[1].path)
    assert together.keys() == single.keys()
    assert all(np.array_equal(values, single[name]) for name, values in together.items())


@pytest.mark.parametrize("blocks", [0, 1, 3])
def test_interrupt_writes_buffered_blocks(blocks, ready_for_seven_blocks, solve_into, tmp_path):
    """The run is interrupted after `blocks` further blocks, all of which are still in the buffer."""
    response, sink = solve_into(ready_for_seven_blocks, tmp_path, sinks=[Cut(after=blocks)])
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


def test_early_kill_leaves_no_partial_result(ready, tmp_path):
    """Copies take at most a fiftieth of the run time, including the first one."""
    done = subprocess.run([sys.executable, "-c", KILL, str(ready.case.path), str(tmp_path)], timeout=60, check=False)
    assert done.returncode == 9
    assert [path.name for path in tmp_path.iterdir()] == ["inline.writing"]
