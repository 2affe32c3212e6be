"""A run interrupted at any point leaves a file that flexcam and VTK read, with consistent steps."""

import h5py
import numpy as np
import pytest

from flexcam import ConstantSpeed, InputError, Problem, RunFailedError, newmark, read_result, solve
from flexcam.dynamics import Cause
from flexcam.io.hdf5 import GrowingDataset
from tests.sinks import Cut

CALLS = 50
"""Upper bound of the number of writes of one block."""


@pytest.fixture
def interrupt_at(monkeypatch, ready, solve_into):
    """Return a function that interrupts writing at the n-th growth of a dataset."""
    grow = GrowingDataset.append_empty

    def run(folder, at):
        count = iter(range(10**6))

        def grow_or_interrupt(*arguments, **names):
            if next(count) == at:
                raise KeyboardInterrupt
            grow(*arguments, **names)

        monkeypatch.setattr(GrowingDataset, "append_empty", grow_or_interrupt)
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


def assert_beginning(read, complete):
    """Assert that all histories and fields are the beginning of those of the complete run, with equal lengths."""
    n, f = len(read.time), len(read.field_time)
    for name in ("time", "angle"):
        assert np.array_equal(getattr(read, name), getattr(complete, name)[:n]), name
    for name in ("field_time", "field_angle"):
        assert np.array_equal(getattr(read, name), getattr(complete, name)[:f]), name
    for series in ("displacement", "velocity", "acceleration"):
        assert np.array_equal(getattr(read.probes, series), getattr(complete.probes, series)[:n]), series
        assert np.array_equal(getattr(read.fields, series), getattr(complete.fields, series)[:f]), series
    for name in complete.channels:
        assert np.array_equal(read.channels[name], complete.channels[name][:n]), name


def test_interrupt_between_blocks_keeps_first_blocks(ready, solve_into, stored, tmp_path):
    response, sink = solve_into(ready, tmp_path, sinks=[Cut(after=1)])
    assert response.status.cause is Cause.INTERRUPTED
    assert not sink.path.exists(), "an interrupted run has written the final file"
    read = read_result(sink.partial).response
    assert read.status == response.status
    assert len(read.time) > 0
    assert_beginning(read, stored.result.response)


def assert_file_agrees(path, complete):
    steps, values, fields = counts(path)
    assert values <= steps <= fields, "vtkHDFReader aborts where NSteps < len(Values)"
    assert_beginning(read_result(path).response, complete)


@pytest.mark.parametrize("stride", [11, pytest.param(1, marks=pytest.mark.slow)])
def test_interrupt_within_block_keeps_consistent_steps(stride, interrupt_at, stored, tmp_path):
    """The run is interrupted before each write; the data read are cut to the shortest common length."""
    wrong, places = {}, 0
    for at in range(0, 3 * CALLS, stride):
        response, sink = interrupt_at(tmp_path / str(at), at)
        if response.status.ok:
            break
        places += 1
        try:
            assert_file_agrees(sink.partial, stored.result.response)
        except (AssertionError, ValueError, InputError) as fault:
            wrong[at] = str(fault).splitlines()[0]
    assert places > 20 / stride
    assert not wrong


class CloseCounter(Cut):
    """Sink that counts the calls of `close`."""

    ends = 0

    def close(self, status, stats):
        self.ends += 1


def test_failed_start_closes_sinks(system_of):
    """`Sink.close` is called once, also after a failure; otherwise a file would stay open."""
    sink = CloseCounter(after=1)
    with pytest.raises(RunFailedError):
        solve(Problem(system_of([[0.0]], [[0.0]], [[0.0]]), ConstantSpeed(1.0), 0.1, 3), newmark(), sinks=[sink])
    assert sink.ends == 1
