"""What the machine refuses while a result is written: the message, the exit code, and what is left."""

from __future__ import annotations

import os
import re
import resource
import shutil
import subprocess
import sys
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


def spawned(folder, *words, file_size=None, program=PROGRAM):
    """Run the command in a process of its own, whose files may not grow beyond a size in bytes."""

    def bounded():
        resource.setrlimit(resource.RLIMIT_FSIZE, (file_size, file_size))

    shutil.copy(CASE, folder / "case.toml")
    command = [sys.executable, *program, *words]
    whole = os.environ | {"PYTHONDONTWRITEBYTECODE": "1"}  # a module compiled under the limit would stay cut off
    limit = {} if file_size is None else {"preexec_fn": bounded, "env": whole}
    return subprocess.run(command, cwd=folder, capture_output=True, text=True, timeout=60, **limit)


def names(folder):
    return sorted(path.name for path in folder.iterdir())


@pytest.mark.parametrize(
    ("file_size", "program"),
    [
        pytest.param(40_000, PROGRAM, marks=pytest.mark.slow),
        pytest.param(700_000, PROGRAM, marks=pytest.mark.slow),
        (3_000_000, OFTEN),
    ],
)
def test_a_disk_that_is_full(file_size, program, tried, tmp_path):
    """Before the first step, before the first copy, and behind it; the result before stays, and so does the copy."""
    (tmp_path / "out").mkdir()
    old = tmp_path / "out/case.vtkhdf"
    old.write_bytes(b"the result before")
    done = spawned(tmp_path, *RUN, "--overwrite", "--set", "run.revolutions=20", file_size=file_size, program=program)
    assert done.returncode == (2 if file_size < 500_000 else 3)
    assert re.search(r"File too large.*[Ff]ree space or name another folder", done.stderr)
    assert done.stderr.count("\n") == 1
    assert old.read_bytes() == b"the result before"
    left = names(tmp_path / "out")
    assert left == ["case.vtkhdf"] if program == PROGRAM else ["case.partial.vtkhdf", "case.vtkhdf"]
    if program == OFTEN:
        copy = read_result(tmp_path / "out/case.partial.vtkhdf").response
        assert copy.status.cause is Cause.INTERRUPTED
        assert len(copy.time) >= 640
    tried("machine", f"disk full after {file_size // 1000} kB", 1, "error message; the earlier result is unchanged")


@pytest.fixture
def ready():
    return prepare(read_case(CASE))


@pytest.fixture
def often(monkeypatch):
    """Have a copy after every block."""
    monkeypatch.setattr(result_writer, "_MAX_COPY_TIME", float("inf"))


class Doing:
    """A sink that does something at its second block, or another."""

    def __init__(self, what, at=2):
        self._what, self._at, self._blocks = what, at, 0

    def write(self, block):
        self._blocks += 1
        if self._blocks == self._at:
            self._what()

    def close(self, status, stats):
        pass


def solved(ready, file, *sinks):
    return solve(ready.problem, ready.scheme, save=ready.save, sinks=[*sinks, file])


def test_a_folder_that_vanishes(ready, tried, tmp_path):
    file = open_result_file(ready, tmp_path / "out")
    response = solved(ready, file, Doing(lambda: shutil.rmtree(tmp_path / "out")))
    assert response.status.cause is Cause.NOT_SAVED
    assert "No such file or directory" in response.status.text
    assert len(response.time) == ready.problem.steps + 1, "the numbers are in memory"
    tried("machine", "the folder of the result is removed meanwhile", 1, "status not-saved; nothing else is lost")


def test_a_folder_nobody_can_write_to(flexcam, tried):
    """``/proc/self`` exists and takes no file, not even from the superuser."""
    done = flexcam("run", CASE, "-o", "/proc/self", "--allow-large")
    assert done.code == 2
    assert "a folder with write permission" in done.err
    assert "name another" in done.err.lower()
    tried("machine", "a folder that cannot be written to", 1, "refused before the first step")


def test_a_folder_in_the_place_of_the_result(ready, tmp_path):
    """It is refused at once, not when the run is over and cannot take its name."""
    (tmp_path / "inline.vtkhdf").mkdir()
    with pytest.raises(InputError, match="A folder has this name"):
        open_result_file(ready, tmp_path, overwrite=True)


def test_results_that_are_open_elsewhere(ready, often, tried, tmp_path):
    """A reader of the result before, and one of the partial result, keep what they have opened."""
    solved(ready, file := open_result_file(ready, tmp_path))
    opened = []
    with h5py.File(file.path) as before:
        file = open_result_file(ready, tmp_path, overwrite=True)
        assert solved(ready, file, Doing(lambda: opened.append(h5py.File(file.partial)))).status.ok
        with opened[0] as partial:
            assert 0 < partial["history"].attrs["steps"] < ready.problem.steps
        assert before["history"].attrs["steps"] == ready.problem.steps + 1
    assert names(tmp_path) == [file.path.name]
    tried(
        "machine",
        "the result before and the partial one are open elsewhere",
        2,
        "replaced; readers keep the earlier file",
    )


def test_no_room_for_a_copy(often, monkeypatch, tmp_path):
    """The run needs the room itself: what others see stays as it was, and the result is complete."""
    ready = prepare(read_case(CASE, ["run.revolutions=4"]))
    file, full, seen = open_result_file(ready, tmp_path), shutil._ntuple_diskusage(0, 0, 0), []

    def look():
        seen.append(len(read_result(file.partial).response.time))
        monkeypatch.setattr(result_writer.shutil, "disk_usage", lambda _: full)

    assert solved(ready, file, Doing(look, at=2), Doing(look, at=4)).status.ok
    assert seen[0] == seen[1] > 0
    assert read_result(file.path).response.status.ok


BESIDE = """
import os, sys
from dataclasses import replace
from flexcam import prepare, read_case
from flexcam.dynamics import solve
from flexcam.analysis.run import open_result_file
case, (begin, all_ready) = read_case(sys.argv[1]), os.pipe()
for i in range(8):
    if not os.fork():
        os.close(all_ready)
        os.read(begin, 1)  # returns when the parent lets go, for all at once
        for name in (f"a{i}", f"b{i}"):
            ready = prepare(replace(case, path=case.path.with_name(name + ".toml")))
            solve(ready.problem, ready.scheme, save=ready.save, sinks=[open_result_file(ready, sys.argv[2])])
        os._exit(0)
os.close(all_ready)
sys.exit(sum(os.wait()[1] != 0 for _ in range(8)))
"""


@pytest.mark.slow
def test_eight_processes_in_one_folder(ready, tried, tmp_path):
    """Different results; all begin when all are ready."""
    command = [sys.executable, "-c", BESIDE, str(CASE), str(tmp_path / "out")]
    done = subprocess.run(command, capture_output=True, text=True, timeout=100)
    assert (done.returncode, done.stderr) == (0, "")
    assert names(tmp_path / "out") == sorted(f"{letter}{i}.vtkhdf" for letter in "ab" for i in range(8))
    wanted = solve(ready.problem, ready.scheme, save=ready.save)
    for path in (tmp_path / "out").iterdir():
        assert (read_result(path).response.channels["energy.work"] == wanted.channels["energy.work"]).all()
    tried("together", "eight processes write sixteen results into one folder", 16, "all are complete and correct")


HELD = """
import os, sys
from pathlib import Path
from flexcam.io import open_with_lock
open_with_lock(Path(sys.argv[1]))
os._exit(9)
"""


def test_two_processes_and_one_result(ready, tried, tmp_path):
    """The second is refused, also with --overwrite; a process that is gone holds nothing."""
    file = open_result_file(ready, tmp_path / "out")
    shutil.copy(CASE, tmp_path / "inline.toml")
    done = spawned(tmp_path, "run", "inline.toml", "-o", "out", "--overwrite")
    assert done.returncode == 2
    assert "Another run is writing it now" in done.stderr
    for overwrite in (False, True):
        with pytest.raises(InputError, match="Another run is writing it now"):
            open_result_file(ready, tmp_path / "out", overwrite=overwrite)
    assert solved(ready, file).status.ok
    assert names(tmp_path / "out") == ["inline.vtkhdf"]
    left = str(tmp_path / "out/inline.writing")
    subprocess.run([sys.executable, "-c", HELD, left], timeout=60, check=False)
    assert solved(ready, open_result_file(ready, tmp_path / "out", overwrite=True)).status.ok
    tried("together", "two processes write one result", 3, "the second is refused; a dead process holds no lock")


def test_standard_output_is_full(tmp_path):
    command = [sys.executable, "-m", "flexcam", "check", str(CASE)]
    with open("/dev/full", "w") as full:
        done = subprocess.run(command, cwd=tmp_path, stdout=full, stderr=subprocess.PIPE, text=True, timeout=60)
    assert done.returncode == 3
    assert done.stderr == "output could not be written: No space left on device; free space\n"


def test_no_standard_streams(tmp_path):
    """As under a daemon that closes them."""
    command = f"exec {sys.executable} -m flexcam check {CASE} >&- 2>&-"
    assert subprocess.run(["/bin/sh", "-c", command], cwd=tmp_path, timeout=60).returncode == 0


def test_what_is_no_file_is_not_read(flexcam, tmp_path):
    """A pipe that nobody writes to never ends, nor does a device."""
    for name in ("pipe.toml", "pipe.vtkhdf"):
        os.mkfifo(tmp_path / name)
    for words in (("check", "pipe.toml"), ("info", "pipe.vtkhdf"), ("run", "/dev/zero")):
        done = flexcam(*words)
        assert done.code == 2
        assert "is a folder, a device or a pipe" in done.err


@pytest.mark.parametrize("command", ["check", "info"])
def test_a_name_too_long(command, flexcam):
    done = flexcam(command, "a" * 400)
    assert done.code == 2
    assert "name too long" in done.err


@pytest.mark.parametrize("words", [("run", "case.toml", "-o"), ("new", "pushrod-engine", "-o")])
def test_an_output_name_too_long(words, flexcam, tmp_path):
    shutil.copy(CASE, tmp_path / "case.toml")
    done = flexcam(*words, 300 * "a" + ".toml" * (words[0] == "new"))
    assert done.code == 2
    assert "name too long" in done.err.lower()


def test_a_name_that_is_not_utf8(flexcam):
    done = flexcam("check", os.fsdecode(b"a\xff.toml"))
    assert done.code == 2
    assert "UTF-8" in done.err


def test_a_terminal_without_the_letters_of_a_title(tmp_path, monkeypatch):
    monkeypatch.setenv("PYTHONIOENCODING", "ascii")
    done = spawned(tmp_path, "check", "case.toml", "--set", "title=Größe 漢")
    assert done.returncode == 0
    assert "Gr\\xf6\\xdfe" in done.stdout


@pytest.mark.slow
def test_numba_that_may_not_compile(tmp_path, monkeypatch):
    monkeypatch.setenv("NUMBA_DISABLE_JIT", "1")
    done = spawned(tmp_path, *RUN, "--set", "run.engine=kernel")
    assert done.returncode == 2
    assert "NUMBA_DISABLE_JIT" in done.stderr


def test_a_result_that_appears_during_the_run_stays(ready, tmp_path):
    sink = open_result_file(ready, tmp_path)
    sink.path.write_bytes(b"of another program")
    response = solve(ready.problem, ready.scheme, save=ready.save, sinks=[sink])
    assert response.status.cause is Cause.NOT_SAVED
    assert "another file appeared" in response.status.text
    assert sink.path.read_bytes() == b"of another program"
    assert read_result(sink.partial).response.status.ok


def test_a_case_named_like_a_partial_result(flexcam, tmp_path):
    """Its result would be deleted at the end of the run whose partial result has that name."""
    shutil.copy(CASE, tmp_path / "case.partial.toml")
    done = flexcam("run", "case.partial.toml")
    assert done.code == 2
    assert "Rename it" in done.err


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="a stream that takes nothing")
@pytest.mark.parametrize(("words", "code"), [
    pytest.param(("modes", "inline.toml", "--set", "fidelity.model=rigid"), 0, marks=pytest.mark.slow),
    (("run", "inline.toml", "--time-limit", "1ms"), 3),
])  # fmt: skip
def test_nobody_can_be_told(words, code, tmp_path):
    """Standard error is full: the exit code says all that can be said."""
    (tmp_path / "inline.toml").write_bytes((Path(__file__).parents[1] / "data/inline.toml").read_bytes())
    buffered = {name: value for name, value in os.environ.items() if name != "PYTHONUNBUFFERED"}
    with Path("/dev/full").open("w") as full:
        done = subprocess.run(
            [sys.executable, "-m", "flexcam", *words], cwd=tmp_path, stdout=subprocess.DEVNULL, stderr=full,
            env=buffered, check=False,
        )  # fmt: skip
    assert done.returncode == code


@pytest.mark.parametrize("words", [pytest.param(("new", "--list"), marks=pytest.mark.slow), ("schema",)], ids=" ".join)
def test_a_reader_that_closed_the_pipe_ends_a_command_silently(words):
    reading, writing = os.pipe()
    os.close(reading)
    program = "import sys; from flexcam.cli.main import main; main(sys.argv[1:])"
    done = subprocess.run([sys.executable, "-c", program, *words], stdout=writing, stderr=subprocess.PIPE, timeout=60)
    os.close(writing)
    assert (done.returncode, done.stderr) == (0, b"")
