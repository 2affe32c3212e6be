"""A run that is cut anywhere leaves a file that flexcam and VTK read, with instants that agree among themselves."""

from __future__ import annotations

import h5py
import numpy as np
import pytest

from flexcam import ConstantSpeed, InputError, Problem, RunFailedError, newmark, read_result, solve
from flexcam.dynamics import Cause
from flexcam.io.hdf5 import GrowingDataset
from tests.sinks import Cut

CALLS = 50
"""A block is appended in fewer pieces than this."""


@pytest.fixture
def cut_at(monkeypatch, ready, solve_into):
    """Interrupt the writing of the file where a dataset grows for the n-th time."""
    grow = GrowingDataset.append_empty

    def run(folder, at):
        count = iter(range(10**6))

        def grown(*arguments, **names):
            if next(count) == at:
                raise KeyboardInterrupt
            grow(*arguments, **names)

        monkeypatch.setattr(GrowingDataset, "append_empty", grown)
        response, sink = solve_into(ready, folder)
        monkeypatch.setattr(GrowingDataset, "append_empty", grow)
        return response, sink

    return run


def counts(path):
    with h5py.File(path, "r") as file:
        steps = file["VTKHDF/Steps"]
        return (
            int(steps.attrs["NSteps"]),
            len(steps["Values"]),
            len(file["VTKHDF/PointData/displacement"]) // int(file["VTKHDF/NumberOfPoints"][0]),
        )


def assert_prefix(read, whole):
    """Every history and field is the beginning of the complete run's, all of one length."""
    n, f = len(read.time), len(read.field_time)
    for name in ("time", "angle"):
        assert np.array_equal(getattr(read, name), getattr(whole, name)[:n]), name
    for name in ("field_time", "field_angle"):
        assert np.array_equal(getattr(read, name), getattr(whole, name)[:f]), name
    for series in ("displacement", "velocity", "acceleration"):
        assert np.array_equal(getattr(read.probes, series), getattr(whole.probes, series)[:n]), series
        assert np.array_equal(getattr(read.fields, series), getattr(whole.fields, series)[:f]), series
    for name in whole.channels:
        assert np.array_equal(read.channels[name], whole.channels[name][:n]), name


def test_between_two_blocks(ready, solve_into, done, tmp_path):
    response, sink = solve_into(ready, tmp_path, sinks=[Cut(after=1)])
    assert response.status.cause is Cause.INTERRUPTED
    assert not sink.path.exists(), "only a complete run takes the final name"
    read = read_result(sink.partial).response
    assert read.status == response.status
    assert len(read.time) > 0
    assert_prefix(read, done.result.response)


def agrees(path, whole):
    steps, values, stored = counts(path)
    assert values <= steps <= stored, "vtkHDFReader aborts where NSteps < len(Values)"
    assert_prefix(read_result(path).response, whole)


@pytest.mark.parametrize("stride", [11, pytest.param(1, marks=pytest.mark.slow)])
def test_within_a_block(stride, cut_at, done, tmp_path):
    """Interrupted before any one piece: what is read back is cut to the shortest common length."""
    wrong, places = {}, 0
    for at in range(0, 3 * CALLS, stride):
        response, sink = cut_at(tmp_path / str(at), at)
        if response.status.ok:
            break
        places += 1
        try:
            agrees(sink.partial, done.result.response)
        except (AssertionError, ValueError, InputError) as fault:
            wrong[at] = str(fault).splitlines()[0]
    assert places > 20 / stride
    assert not wrong


class Closed(Cut):
    """A sink that counts how often it learns the end."""

    ends = 0

    def close(self, status, stats):
        self.ends += 1


def test_a_run_that_cannot_start_closes_its_sinks(system_of):
    """What `Sink.close` promises: called once, also after a failure; else a file stays open and says nothing."""
    sink = Closed(after=1)
    with pytest.raises(RunFailedError):
        solve(Problem(system_of([[0.0]], [[0.0]], [[0.0]]), ConstantSpeed(1.0), 0.1, 3), newmark(), sinks=[sink])
    assert sink.ends == 1
