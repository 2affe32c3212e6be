"""Runs killed by a signal at any point leave valid partial results and can be resumed.

The point does not depend on timing: ``kill -9`` occurs at a random one of all calls of the run, or, to interrupt HDF5
within a call, the kernel ends the process when a file exceeds a random size. Copies are written after every block, a
hundred times as often as by default, so that many kills interrupt one.
"""

from __future__ import annotations

import json
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest

from flexcam import InputError, read_result
from flexcam.dynamics import Cause
from flexcam.io import partial_path

CASE = Path(__file__).parents[1] / "data/inline.toml"

RUNS = """
import itertools, json, os, random, resource, signal, sys
from dataclasses import replace
from pathlib import Path
from flexcam import read_case
from flexcam.dynamics import SaveAt, solve
from flexcam.io import result_writer
from flexcam.analysis.preparation import prepare
from flexcam.analysis.run import open_partial_result, open_result_file

case, folder, kills, override = Path(sys.argv[1]), Path(sys.argv[2]), int(sys.argv[3]), sys.argv[4]
result_writer._MAX_COPY_TIME = float("inf")
ready = prepare(read_case(case, [override]))
ready = replace(ready, save=SaveAt(field_every=5, fields_per_block=8))

def run(into, pipe=None, resume=False):
    earlier = open_partial_result(ready, into) if resume else None
    file = open_result_file(ready, into, resume=earlier, overwrite=(into / f"{case.stem}.vtkhdf").exists())
    if pipe is not None:
        write = file.write_checkpoint
        def write_and_report(checkpoint):
            write(checkpoint)
            os.write(pipe, checkpoint.steps.to_bytes(8, "little"))
        file.write_checkpoint = write_and_report
    solve(ready.problem, ready.scheme, save=ready.save, sinks=[file], resume=earlier)

def at_call(number):  # kills this process at the given number of calls of Python and C functions from now on
    calls = itertools.count(1)
    def count_call(frame, event, _):
        if event in ("call", "c_call") and next(calls) == number:
            os.kill(os.getpid(), signal.SIGKILL)
    sys.setprofile(count_call)
    return calls

def at_size(size):  # kills this process when a file exceeds a size
    signal.signal(signal.SIGXFSZ, signal.SIG_DFL)
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    resource.setrlimit(resource.RLIMIT_FSIZE, (size, size))

run(folder / "first")  # imports all modules and fills the caches
calls = at_call(0)
run(folder / "whole")
sys.setprofile(None)
most, size = next(calls), (folder / "whole" / f"{case.stem}.vtkhdf").stat().st_size
draws, rows = random.Random(kills), []
for i in range(kills):
    into, (reading, writing) = folder / str(i), os.pipe()
    if i % 4 > 1:
        into.mkdir()
        (into / f"{case.stem}.vtkhdf").write_bytes(b"the result before")
    ends, last = ((at_call, most), (at_size, size))[i % 2]
    where = draws.randrange(last // 4, last * 19 // 20)  # after the last block no copy is written
    if not os.fork():
        ends(where)
        run(into, writing)
        os._exit(0)
    ended = os.waitstatus_to_exitcode(os.wait()[1])
    assert ended in (-signal.SIGKILL, -signal.SIGXFSZ), (ends.__name__, where, last, ended)
    os.close(writing)
    reported = b"".join(iter(lambda: os.read(reading, 1 << 16), b""))
    os.close(reading)
    rows.append((i, int.from_bytes(reported[-8:], "little")))
(folder / "rows.json").write_text(json.dumps(rows))
"""

RESUMED = (
    RUNS[: RUNS.index("def at_call")]
    + """
for i in map(int, sys.argv[5:]):
    run(folder / str(i), resume=True)
"""
)


@dataclass(frozen=True, eq=False)
class KilledRun:
    """A killed run: its partial result, and the number of steps that it had reported as saved."""

    path: Path
    reported: int


@dataclass(frozen=True, eq=False)
class KilledRuns:
    """Killed runs, and the uninterrupted one."""

    folder: Path
    runs: list[KilledRun]
    uninterrupted: Any
    engine: str


def run_script(text, *words):
    done = subprocess.run([sys.executable, "-c", text, *map(str, words)], capture_output=True, text=True, timeout=1200)
    assert done.returncode == 0, done.stderr


ENGINES = {
    "direct": "run.engine=direct", "modal": "run.engine=modal", "kernel": "run.engine=kernel",
    "kinematic": "fidelity.model=rigid",
}  # fmt: skip


@pytest.fixture(
    scope="module",
    params=[("direct", 4), *(pytest.param((engine, 100), marks=pytest.mark.slow) for engine in ENGINES)],
    ids=lambda given: f"{given[0]}-{given[1]}",
)
def killed_runs(request, tmp_path_factory):
    folder, (engine, count) = tmp_path_factory.mktemp("kills"), request.param
    run_script(RUNS, CASE, folder, count, ENGINES[engine])
    rows = json.loads((folder / "rows.json").read_text())
    uninterrupted = folder / "whole/inline.vtkhdf"
    killed = [KilledRun(partial_path(folder / str(i) / uninterrupted.name), said) for i, said in rows]
    assert sum(one.reported > 0 for one in killed) >= 0.2 * count, "few runs had saved a step"
    return KilledRuns(folder, killed, read_result(uninterrupted).response, engine)


def first_difference(path, uninterrupted):
    """Return the number of steps and the first quantity that differs from the uninterrupted run, or an empty string."""
    read = read_result(path).response
    n, f = len(read.time), len(read.field_time)
    assert read.status.cause is Cause.INTERRUPTED
    pairs = {
        "time": (read.time, uninterrupted.time[:n]), "angle": (read.angle, uninterrupted.angle[:n]),
        "field time": (read.field_time, uninterrupted.field_time[:f]),
        **{f"channel {name}": (values, uninterrupted.channels[name][:n]) for name, values in read.channels.items()},
    }  # fmt: skip
    for one in ("displacement", "velocity", "acceleration"):
        pairs[f"probes {one}"] = getattr(read.probes, one), getattr(uninterrupted.probes, one)[:n]
        pairs[f"fields {one}"] = getattr(read.fields, one), getattr(uninterrupted.fields, one)[:f]
    assert 5 * (f - 1) < n <= 5 * f, "fields as far as histories"
    return n, next((name for name, (got, expected) in pairs.items() if not np.array_equal(got, expected)), "")


def test_reported_steps_are_saved_exactly(killed_runs, tried):
    wrong = {}
    for one in killed_runs.runs:
        if not one.path.exists():
            wrong |= {one.path.parent.name: "reported, but not there"} if one.reported else {}
            continue
        try:
            count, fault = first_difference(one.path, killed_runs.uninterrupted)
            if fault or count < one.reported:
                wrong[one.path.parent.name] = fault or f"{count} of {one.reported} reported instants"
        except (AssertionError, InputError) as fault:
            wrong[one.path.parent.name] = str(fault)
    assert not wrong
    what = f"kill -9 at any call, or where a file grows: {killed_runs.engine} engine"
    tried("killed", what, len(killed_runs.runs), "every saved step is present, bit by bit")


def test_killed_run_keeps_earlier_result(killed_runs, tried):
    """A killed run writes no result and leaves an earlier one unchanged."""
    for i, one in enumerate(killed_runs.runs):
        target = one.path.with_name(f"{CASE.stem}.vtkhdf")
        assert target.read_bytes() == b"the result before" if i % 4 > 1 else not target.exists()
    what = f"kill -9, a result of the same name exists: {killed_runs.engine} engine"
    tried("killed", what, len(killed_runs.runs), "the earlier result is unchanged")


def test_h5py_reads_all_chunks_after_kill(killed_runs, tried):
    """All chunks have a checksum, so that reading an incomplete one raises an error."""
    seen = 0
    for one in killed_runs.runs:
        if one.path.exists():
            with h5py.File(one.path) as file:
                file.visititems(lambda _, item: item[()] if isinstance(item, h5py.Dataset) else None)
            seen += 1
    assert seen >= len(killed_runs.runs) // 2
    what = f"kill -9, file read by h5py alone: {killed_runs.engine} engine"
    tried("killed", what, seen, "every chunk is present, with its checksum")


READ_WITH_VTK = """
import sys
from vtkmodules.vtkIOHDF import vtkHDFReader
for path in sys.argv[1:]:
    reader = vtkHDFReader()
    reader.SetFileName(path)
    reader.UpdateInformation()
    assert reader.GetNumberOfSteps() > 0
    for step in range(reader.GetNumberOfSteps()):
        reader.SetStep(step)
        reader.Update()
        assert reader.GetOutput().GetNumberOfPoints() == 6
"""


def test_vtk_reads_all_steps_after_kill(killed_runs, tried):
    """VTK runs in its own process, since its reader aborts on inconsistent data."""
    pytest.importorskip("vtkmodules.vtkIOHDF")
    some = [one.path for one in killed_runs.runs if one.reported]
    run_script(READ_WITH_VTK, *some)
    tried("killed", f"kill -9, file read by VTK: {killed_runs.engine} engine", len(some), "every step is readable")


@pytest.mark.slow
def test_resumed_killed_runs_equal_uninterrupted_run(killed_runs, tried):
    """The resumed runs also remove the temporary files of the killed ones."""
    some = [one.path.parent for one in killed_runs.runs if one.reported][:60:5]
    run_script(RESUMED, CASE, killed_runs.folder, 0, ENGINES[killed_runs.engine], *(folder.name for folder in some))
    assert some
    for folder in some:
        assert [path.name for path in folder.iterdir()] == ["inline.vtkhdf"]
        read = read_result(folder / "inline.vtkhdf").response
        assert read.status.ok
        for name, values in killed_runs.uninterrupted.channels.items():
            assert np.array_equal(read.channels[name], values), name
        assert np.array_equal(read.fields.acceleration, killed_runs.uninterrupted.fields.acceleration)
    what = f"kill -9, continued with --resume: {killed_runs.engine} engine"
    tried("killed", what, len(some), "bit by bit the result of the uninterrupted run")
