"""Errors of the operating system while a result is written: message, exit code and remaining files."""

import os
import re
import resource
import shutil
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import h5py
import pytest

from flexcam import prepare, read_case, read_result
from flexcam.analysis.run import open_result_file
from flexcam.core.errors import InputError
from flexcam.dynamics import Cause, solve
from flexcam.io import result_writer
from tests.command import OFTEN, PROGRAM

CASE = Path(__file__).parents[1] / "data/inline.toml"
RUN = ("run", "case.toml", "-o", "out")


def run_process(folder, *words, file_size=None, program=PROGRAM):
    """Run the command in its own process, optionally with a limit of the size of its files in bytes."""

    def limit_file_size():
        resource.setrlimit(resource.RLIMIT_FSIZE, (file_size, file_size))

    shutil.copy(CASE, folder / "case.toml")
    command = [sys.executable, *program, *words]
    # A module compiled under the limit would stay truncated.
    environment = os.environ | {"PYTHONDONTWRITEBYTECODE": "1"}
    limit = {} if file_size is None else {"preexec_fn": limit_file_size, "env": environment}
    return subprocess.run(command, cwd=folder, capture_output=True, text=True, timeout=60, **limit)


def file_names(folder):
    return sorted(path.name for path in folder.iterdir())


@pytest.mark.parametrize(
    ("file_size", "program"),
    [
        pytest.param(40_000, PROGRAM, marks=pytest.mark.slow),
        pytest.param(700_000, PROGRAM, marks=pytest.mark.slow),
        (3_000_000, OFTEN),
    ],
)
def test_full_disk_keeps_earlier_result_and_copy(file_size, program, tried, tmp_path):
    """The disk is full before the first step, before the first copy, or after it."""
    (tmp_path / "out").mkdir()
    old = tmp_path / "out/case.vtkhdf"
    old.write_bytes(b"the result before")
    done = run_process(
        tmp_path, *RUN, "--overwrite", "--set", "run.revolutions=20", file_size=file_size, program=program
    )
    assert done.returncode == (2 if file_size < 500_000 else 3)
    assert re.search(r"File too large.*[Ff]ree space or name another folder", done.stderr)
    assert done.stderr.count("\n") == 1
    assert old.read_bytes() == b"the result before"
    remaining = file_names(tmp_path / "out")
    assert remaining == (["case.vtkhdf"] if program == PROGRAM else ["case.partial.vtkhdf", "case.vtkhdf"])
    if program == OFTEN:
        copy = read_result(tmp_path / "out/case.partial.vtkhdf").response
        assert copy.status.cause is Cause.INTERRUPTED
        assert len(copy.time) >= 640
    tried("machine", f"disk full after {file_size // 1000} kB", 1, "error message; the earlier result is unchanged")


@pytest.fixture
def ready():
    return with_short_blocks(prepare(read_case(CASE)))


def with_short_blocks(ready):
    return replace(ready, save=replace(ready.save, fields_per_block=32))


@pytest.fixture
def copy_every_block(monkeypatch):
    """Write a copy after every block."""
    monkeypatch.setattr(result_writer, "_MAX_COPY_TIME", float("inf"))


class ActionSink:
    """Sink that calls a function at its second block, or at another one."""

    def __init__(self, what, at=2):
        self._what, self._at, self._blocks = what, at, 0

    def write(self, block):
        self._blocks += 1
        if self._blocks == self._at:
            self._what()

    def close(self, status, stats):
        pass


def solve_to_file(ready, file, *sinks):
    return solve(ready.problem, ready.scheme, save=ready.save, sinks=[*sinks, file])


def test_removed_result_folder_gives_status_not_saved(ready, tried, tmp_path):
    file = open_result_file(ready, tmp_path / "out")
    response = solve_to_file(ready, file, ActionSink(lambda: shutil.rmtree(tmp_path / "out")))
    assert response.status.cause is Cause.NOT_SAVED
    assert "No such file or directory" in response.status.text
    assert len(response.time) == ready.problem.steps + 1, "the numbers are in memory"
    tried("machine", "the folder of the result is removed meanwhile", 1, "status not-saved; nothing else is lost")


def test_read_only_folder_is_refused(flexcam, tried):
    """No user can write to ``/proc/self``, not even the superuser."""
    done = flexcam("run", CASE, "-o", "/proc/self", "--allow-large")
    assert done.code == 2
    assert "a folder with write permission" in done.err
    assert "name another" in done.err.lower()
    tried("machine", "a folder that cannot be written to", 1, "refused before the first step")


def test_folder_with_name_of_result_is_refused(ready, tmp_path):
    """The run is refused before it starts, not when the result is saved."""
    (tmp_path / "inline.vtkhdf").mkdir()
    with pytest.raises(InputError, match="A folder has this name"):
        open_result_file(ready, tmp_path, overwrite=True)


def test_results_open_in_other_readers_are_replaced(ready, copy_every_block, tried, tmp_path):
    """Readers of the earlier result and of the partial result keep the files that they opened."""
    solve_to_file(ready, file := open_result_file(ready, tmp_path))
    opened = []
    with h5py.File(file.path) as before:
        file = open_result_file(ready, tmp_path, overwrite=True)
        assert solve_to_file(ready, file, ActionSink(lambda: opened.append(h5py.File(file.partial)))).status.ok
        with opened[0] as partial:
            assert 0 < partial["history"].attrs["steps"] < ready.problem.steps
        assert before["history"].attrs["steps"] == ready.problem.steps + 1
    assert file_names(tmp_path) == [file.path.name]
    tried(
        "machine",
        "the result before and the partial one are open elsewhere",
        2,
        "replaced; readers keep the earlier file",
    )


def test_full_disk_stops_copies_but_not_the_run(copy_every_block, monkeypatch, tmp_path):
    """The run needs the space itself: the last copy stays, and the result is complete."""
    ready = with_short_blocks(prepare(read_case(CASE, ["run.revolutions=4"])))
    file, full, lengths = open_result_file(ready, tmp_path), shutil._ntuple_diskusage(0, 0, 0), []

    def look():
        lengths.append(len(read_result(file.partial).response.time))
        monkeypatch.setattr(result_writer.shutil, "disk_usage", lambda _: full)

    assert solve_to_file(ready, file, ActionSink(look, at=2), ActionSink(look, at=4)).status.ok
    assert lengths[0] == lengths[1] > 0
    assert read_result(file.path).response.status.ok


PARALLEL_RUNS = """
import os, sys
from dataclasses import replace
from flexcam import prepare, read_case
from flexcam.dynamics import solve
from flexcam.analysis.run import open_result_file
case, (begin, all_ready) = read_case(sys.argv[1]), os.pipe()
for i in range(8):
    if not os.fork():
        os.close(all_ready)
        os.read(begin, 1)  # returns for all processes when the parent closes the pipe
        for name in (f"a{i}", f"b{i}"):
            ready = prepare(replace(case, path=case.path.with_name(name + ".toml")))
            solve(ready.problem, ready.scheme, save=ready.save, sinks=[open_result_file(ready, sys.argv[2])])
        os._exit(0)
os.close(all_ready)
sys.exit(sum(os.wait()[1] != 0 for _ in range(8)))
"""


@pytest.mark.slow
def test_parallel_processes_write_into_one_folder(tried, tmp_path):
    """Eight processes start at the same time and write different results."""
    command = [sys.executable, "-c", PARALLEL_RUNS, str(CASE), str(tmp_path / "out")]
    done = subprocess.run(command, capture_output=True, text=True, timeout=100)
    assert (done.returncode, done.stderr) == (0, "")
    assert file_names(tmp_path / "out") == sorted(f"{letter}{i}.vtkhdf" for letter in "ab" for i in range(8))
    ready = prepare(read_case(CASE))
    expected = solve(ready.problem, ready.scheme, save=ready.save)
    for path in (tmp_path / "out").iterdir():
        assert (read_result(path).response.channels["energy.work"] == expected.channels["energy.work"]).all()
    tried("together", "eight processes write sixteen results into one folder", 16, "all are complete and correct")


LOCK_AND_EXIT = """
import os, sys
from pathlib import Path
from flexcam.io import open_with_lock
open_with_lock(Path(sys.argv[1]))
os._exit(9)
"""


def test_second_process_for_same_result_is_refused(ready, tried, tmp_path):
    """The second process is refused also with --overwrite; an ended process holds no lock."""
    file = open_result_file(ready, tmp_path / "out")
    shutil.copy(CASE, tmp_path / "inline.toml")
    done = run_process(tmp_path, "run", "inline.toml", "-o", "out", "--overwrite")
    assert done.returncode == 2
    assert "Another run is writing it now" in done.stderr
    for overwrite in (False, True):
        with pytest.raises(InputError, match="Another run is writing it now"):
            open_result_file(ready, tmp_path / "out", overwrite=overwrite)
    assert solve_to_file(ready, file).status.ok
    assert file_names(tmp_path / "out") == ["inline.vtkhdf"]
    remaining = str(tmp_path / "out/inline.writing")
    subprocess.run([sys.executable, "-c", LOCK_AND_EXIT, remaining], timeout=60, check=False)
    assert solve_to_file(ready, open_result_file(ready, tmp_path / "out", overwrite=True)).status.ok
    tried("together", "two processes write one result", 3, "the second is refused; a dead process holds no lock")


def test_full_standard_output_gives_exit_code_3(tmp_path):
    command = [sys.executable, "-m", "flexcam", "check", str(CASE)]
    with open("/dev/full", "w") as full:
        done = subprocess.run(command, cwd=tmp_path, stdout=full, stderr=subprocess.PIPE, text=True, timeout=60)
    assert done.returncode == 3
    assert done.stderr == "output could not be written: No space left on device; free space\n"


def test_command_without_standard_streams(tmp_path):
    """A daemon may close the standard streams."""
    command = f"exec {sys.executable} -m flexcam check {CASE} >&- 2>&-"
    assert subprocess.run(["/bin/sh", "-c", command], cwd=tmp_path, timeout=60).returncode == 0


def test_pipes_and_devices_are_refused(flexcam, tmp_path):
    """Reading a device, or a pipe without a writer, would never end."""
    for name in ("pipe.toml", "pipe.vtkhdf"):
        os.mkfifo(tmp_path / name)
    for words in (("check", "pipe.toml"), ("info", "pipe.vtkhdf"), ("run", "/dev/zero")):
        done = flexcam(*words)
        assert done.code == 2
        assert "is a folder, a device or a pipe" in done.err


@pytest.mark.parametrize("command", ["check", "info"])
def test_long_input_name_is_refused(command, flexcam):
    done = flexcam(command, "a" * 400)
    assert done.code == 2
    assert "name too long" in done.err


@pytest.mark.parametrize("words", [("run", "case.toml", "-o"), ("new", "pushrod-engine", "-o")])
def test_long_output_name_is_refused(words, flexcam, tmp_path):
    shutil.copy(CASE, tmp_path / "case.toml")
    done = flexcam(*words, 300 * "a" + ".toml" * (words[0] == "new"))
    assert done.code == 2
    assert "name too long" in done.err.lower()


def test_file_name_that_is_not_utf8_is_refused(flexcam):
    done = flexcam("check", os.fsdecode(b"a\xff.toml"))
    assert done.code == 2
    assert "UTF-8" in done.err


def test_title_is_escaped_for_ascii_terminal(tmp_path, monkeypatch):
    monkeypatch.setenv("PYTHONIOENCODING", "ascii")
    done = run_process(tmp_path, "check", "case.toml", "--set", "title=Größe 漢")
    assert done.returncode == 0
    assert "Gr\\xf6\\xdfe" in done.stdout


@pytest.mark.slow
def test_kernel_engine_without_jit_is_refused(tmp_path, monkeypatch):
    monkeypatch.setenv("NUMBA_DISABLE_JIT", "1")
    done = run_process(tmp_path, *RUN, "--set", "run.engine=kernel")
    assert done.returncode == 2
    assert "NUMBA_DISABLE_JIT" in done.stderr


def test_file_created_during_run_is_not_overwritten(ready, tmp_path):
    sink = open_result_file(ready, tmp_path)
    sink.path.write_bytes(b"of another program")
    response = solve(ready.problem, ready.scheme, save=ready.save, sinks=[sink])
    assert response.status.cause is Cause.NOT_SAVED
    assert "another file appeared" in response.status.text
    assert sink.path.read_bytes() == b"of another program"
    assert read_result(sink.partial).response.status.ok


def test_case_named_like_partial_result_is_refused(flexcam, tmp_path):
    """The end of the run with that partial result would delete the result of this case."""
    shutil.copy(CASE, tmp_path / "case.partial.toml")
    done = flexcam("run", "case.partial.toml")
    assert done.code == 2
    assert "Rename it" in done.err


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="a stream that takes nothing")
@pytest.mark.parametrize(("words", "code"), [
    pytest.param(("modes", "inline.toml", "--set", "fidelity.model=rigid"), 0, marks=pytest.mark.slow),
    (("run", "inline.toml", "--time-limit", "1ms"), 3),
])  # fmt: skip
def test_full_standard_error_keeps_exit_code(words, code, tmp_path):
    """No message can be written to standard error; the exit code is the same as otherwise."""
    (tmp_path / "inline.toml").write_bytes((Path(__file__).parents[1] / "data/inline.toml").read_bytes())
    buffered = {name: value for name, value in os.environ.items() if name != "PYTHONUNBUFFERED"}
    with Path("/dev/full").open("w") as full:
        done = subprocess.run(
            [sys.executable, "-m", "flexcam", *words], cwd=tmp_path, stdout=subprocess.DEVNULL, stderr=full,
            env=buffered, check=False,
        )  # fmt: skip
    assert done.returncode == code
