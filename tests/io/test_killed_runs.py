"""Runs that a signal ends anywhere: what is shown of them is whole, and they go on as if nothing had been.

Where is not left to the clock. ``kill -9`` comes at a call that is drawn from all calls of the run, and, for what HDF5
does within one of them, the kernel ends the process where a file is to grow beyond a size drawn from all sizes. Copies
are shown after every block here, a hundred times as often as in use, so that many kills fall into one.
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

def run(into, told=None, resume=False):
    earlier = open_partial_result(ready, into) if resume else None
    file = open_result_file(ready, into, resume=earlier, overwrite=(into / f"{case.stem}.vtkhdf").exists())
    if told is not None:
        keep = file.write_checkpoint
        def kept(checkpoint):
            keep(checkpoint)
            os.write(told, checkpoint.steps.to_bytes(8, "little"))
        file.write_checkpoint = kept
    solve(ready.problem, ready.scheme, save=ready.save, sinks=[file], resume=earlier)

def at_call(number):  # ends this process at so many calls of Python functions and C functions from now on
    calls = itertools.count(1)
    def called(frame, event, _):
        if event in ("call", "c_call") and next(calls) == number:
            os.kill(os.getpid(), signal.SIGKILL)
    sys.setprofile(called)
    return calls

def at_size(size):  # ends it where a file grows beyond a size
    signal.signal(signal.SIGXFSZ, signal.SIG_DFL)
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    resource.setrlimit(resource.RLIMIT_FSIZE, (size, size))

run(folder / "first")  # everything is imported and everything cached
calls = at_call(0)
run(folder / "whole")
sys.setprofile(None)
most, size = next(calls), (folder / "whole" / f"{case.stem}.vtkhdf").stat().st_size
draws, rows = random.Random(kills), []
for i in range(kills):
    into, (told, tell) = folder / str(i), os.pipe()
    if i % 4 > 1:
        into.mkdir()
        (into / f"{case.stem}.vtkhdf").write_bytes(b"the result before")
    ends, last = ((at_call, most), (at_size, size))[i % 2]
    where = draws.randrange(last // 4, last * 19 // 20)  # behind the last block there is nothing left to show
    if not os.fork():
        ends(where)
        run(into, tell)
        os._exit(0)
    ended = os.waitstatus_to_exitcode(os.wait()[1])
    assert ended in (-signal.SIGKILL, -signal.SIGXFSZ), (ends.__name__, where, last, ended)
    os.close(tell)
    said = b"".join(iter(lambda: os.read(told, 1 << 16), b""))
    os.close(told)
    rows.append((i, int.from_bytes(said[-8:], "little")))
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
class Killed:
    """A run that was killed: what it left, and the instants that it had reported as saved."""

    path: Path
    reported: int


@dataclass(frozen=True, eq=False)
class Kills:
    """Runs that were killed, and the one that was left alone."""

    folder: Path
    runs: list[Killed]
    whole: Any
    engine: str


def script(text, *words):
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
def kills(request, tmp_path_factory):
    folder, (engine, count) = tmp_path_factory.mktemp("kills"), request.param
    script(RUNS, CASE, folder, count, ENGINES[engine])
    rows = json.loads((folder / "rows.json").read_text())
    whole = folder / "whole/inline.vtkhdf"
    killed = [Killed(partial_path(folder / str(i) / whole.name), said) for i, said in rows]
    assert sum(one.reported > 0 for one in killed) >= 0.2 * count, "many had saved something"
    return Kills(folder, killed, read_result(whole).response, engine)


def first_difference(path, whole):
    """Return what of a partial result is not the beginning of the whole one; nothing if all is right."""
    read = read_result(path).response
    n, f = len(read.time), len(read.field_time)
    assert read.status.cause is Cause.INTERRUPTED
    pairs = {
        "time": (read.time, whole.time[:n]), "angle": (read.angle, whole.angle[:n]),
        "field time": (read.field_time, whole.field_time[:f]),
        **{f"channel {name}": (values, whole.channels[name][:n]) for name, values in read.channels.items()},
    }  # fmt: skip
    for one in ("displacement", "velocity", "acceleration"):
        pairs[f"probes {one}"] = getattr(read.probes, one), getattr(whole.probes, one)[:n]
        pairs[f"fields {one}"] = getattr(read.fields, one), getattr(whole.fields, one)[:f]
    assert 5 * (f - 1) < n <= 5 * f, "fields as far as histories"
    return n, next((name for name, (got, wanted) in pairs.items() if not np.array_equal(got, wanted)), "")


def test_every_reported_step_is_there_and_right(kills, tried):
    wrong = {}
    for one in kills.runs:
        if not one.path.exists():
            wrong |= {one.path.parent.name: "reported, but not there"} if one.reported else {}
            continue
        try:
            count, fault = first_difference(one.path, kills.whole)
            if fault or count < one.reported:
                wrong[one.path.parent.name] = fault or f"{count} of {one.reported} reported instants"
        except (AssertionError, InputError) as fault:
            wrong[one.path.parent.name] = str(fault)
    assert not wrong
    what = f"kill -9 at any call, or where a file grows: {kills.engine} engine"
    tried("killed", what, len(kills.runs), "every saved step is present, bit by bit")


def test_the_result_before_stays(kills, tried):
    """A killed run leaves the name of its result free, or the earlier result as it was."""
    for i, one in enumerate(kills.runs):
        target = one.path.with_name(f"{CASE.stem}.vtkhdf")
        assert target.read_bytes() == b"the result before" if i % 4 > 1 else not target.exists()
    tried("killed", f"the same: {kills.engine} engine", len(kills.runs), "the earlier result is unchanged")


def test_h5py_reads_every_chunk(kills, tried):
    """Every chunk has its checksum: what is torn raises."""
    seen = 0
    for one in kills.runs:
        if one.path.exists():
            with h5py.File(one.path) as file:
                file.visititems(lambda _, item: item[()] if isinstance(item, h5py.Dataset) else None)
            seen += 1
    assert seen >= len(kills.runs) // 2
    what = f"kill -9, file read by h5py alone: {kills.engine} engine"
    tried("killed", what, seen, "every chunk is present, with its checksum")


READ = """
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


def test_vtk_reads_every_step(kills, tried):
    """In a process of its own: what does not fit together makes the reader abort."""
    pytest.importorskip("vtkmodules.vtkIOHDF")
    some = [one.path for one in kills.runs if one.reported]
    script(READ, *some)
    tried("killed", f"kill -9, file read by VTK: {kills.engine} engine", len(some), "every step is readable")


def test_killed_runs_go_on_to_the_same_end(kills, tried):
    """And leave nothing of what the killed process was writing."""
    some = [one.path.parent for one in kills.runs if one.reported][:60:5]
    script(RESUMED, CASE, kills.folder, 0, ENGINES[kills.engine], *(folder.name for folder in some))
    assert some
    for folder in some:
        assert [path.name for path in folder.iterdir()] == ["inline.vtkhdf"]
        read = read_result(folder / "inline.vtkhdf").response
        assert read.status.ok
        for name, values in kills.whole.channels.items():
            assert np.array_equal(read.channels[name], values), name
        assert np.array_equal(read.fields.acceleration, kills.whole.fields.acceleration)
    what = f"kill -9, continued with --resume: {kills.engine} engine"
    tried("killed", what, len(some), "bit by bit the result of the uninterrupted run")
