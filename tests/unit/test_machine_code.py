"""Where machine code is kept: in the user's folder, never beside the package, and a run needs none of it."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
from flexcam.integrate.compiled import machine

import flexcam

PACKAGE = Path(flexcam.__file__).parent
RUN = """
import numpy as np
from flexcam.integrate import Problem, newmark, solve
from flexcam.linalg import Triplets
from flexcam.system import ConstantSpeed, Load, Probe, System
one, row = Triplets.from_dense([[1.0]]), np.ones(1)
push = Load("push", row, lambda motion: np.sin(motion.angle))
system = System(one, Triplets.zeros(1), one, ("x",), (push,), probes=(Probe("x", ("x",), np.eye(1), (None,)),))
run = solve(Problem(system, ConstantSpeed(3.0), 0.01, 100, path="compiled"), newmark())
print(run.stats.path, run.status.cause, run["x"].displacement[-1].hex())
"""


def environment(**changes):
    """Return this process's environment with changes; None takes a variable out."""
    own = {**os.environ, **{name: str(value) for name, value in changes.items()}}
    return {name: value for name, value in own.items() if changes.get(name, "") is not None}


def started(**changes):
    return subprocess.Popen(
        [sys.executable, "-c", RUN], env=environment(**changes), stdout=subprocess.PIPE, stderr=subprocess.PIPE,
        text=True,
    )  # fmt: skip


def said(process):
    out, err = process.communicate(timeout=240)
    assert process.returncode == 0, err
    assert not err
    assert out.startswith("compiled done")
    return out


def beside_the_package():
    return {path: path.stat().st_mtime_ns for path in PACKAGE.rglob("*.nb[ci]")}


@pytest.fixture
def nothing_new():
    """Assert at the end that nothing was written beside the package; what lay there before says nothing."""
    before = beside_the_package()
    yield
    assert beside_the_package() == before


@pytest.fixture
def folder(monkeypatch):
    """Return a function that finds the folder in an environment."""

    def found(**variables):
        for name in ("FLEXCAM_CACHE", "XDG_CACHE_HOME", "HOME"):
            monkeypatch.delenv(name, raising=False)
        for name, value in variables.items():
            monkeypatch.setenv(name, str(value))
        return machine.folder.__wrapped__()

    return found


def test_the_first_that_is_named(folder, tmp_path):
    named, own, home = (tmp_path / name for name in ("named", "own", "home"))
    every = {"FLEXCAM_CACHE": named, "XDG_CACHE_HOME": own, "HOME": home}
    assert folder(**every).is_relative_to(named / "flexcam")
    assert folder(XDG_CACHE_HOME=own, HOME=home).is_relative_to(own / "flexcam")
    assert folder(HOME=home).is_relative_to(home / ".cache/flexcam")
    assert folder(FLEXCAM_CACHE="", XDG_CACHE_HOME="", HOME=home).is_relative_to(home / ".cache/flexcam")


def test_only_the_user_may_write_there(folder, tmp_path):
    assert folder(FLEXCAM_CACHE=tmp_path).stat().st_mode & 0o077 == 0
    assert not list(folder(FLEXCAM_CACHE=tmp_path).iterdir())  # what was tried is gone


def test_nowhere_to_write(folder, tmp_path, monkeypatch):
    """A file where the folder should be; a user without a home."""
    (tmp_path / "file").write_text("")
    assert folder(FLEXCAM_CACHE=tmp_path / "file") is None

    def homeless():
        message = "Could not determine home directory."
        raise RuntimeError(message)

    monkeypatch.setattr(Path, "home", homeless)
    assert folder() is None


def test_another_source_has_another_folder(folder, tmp_path, monkeypatch):
    found = {folder(FLEXCAM_CACHE=tmp_path).name}
    for changed in machine._SOURCES:
        tree = tmp_path / changed.replace("/", "-")
        for name in (*machine._SOURCES, "integrate/compiled/machine.py"):
            (tree / name).parent.mkdir(parents=True, exist_ok=True)
            shutil.copy(PACKAGE / name, tree / name)
        monkeypatch.setattr(machine, "__file__", str(tree / "integrate/compiled/machine.py"))
        assert folder(FLEXCAM_CACHE=tmp_path).name in found
        with (tree / changed).open("a") as source:
            source.write("# changed\n")
        found.add(folder(FLEXCAM_CACHE=tmp_path).name)
        monkeypatch.undo()
    assert len(found) == 1 + len(machine._SOURCES)


def test_every_compiled_source_counts():
    """What a compiled function is made of stands in the sources that name the folder."""
    from flexcam.integrate.compiled import glide, kernel, locating, march, newton, stepping

    rooms = (glide, kernel, locating, march, newton, stepping)
    dispatchers = [one for room in rooms for one in vars(room).values() if hasattr(one, "py_func")]
    assert len(dispatchers) > 10
    files = {Path(one.py_func.__code__.co_filename).relative_to(PACKAGE).as_posix() for one in dispatchers}
    assert files | {"integrate/iteration.py", "integrate/led.py", "integrate/compiled/once.py"} == set(machine._SOURCES)


@pytest.mark.usefixtures("nothing_new")
def test_whoever_imports_the_kernel_first(tmp_path):
    """It is kept where it belongs, and the compiler's own setting is as it was."""
    code = (
        "from numba.core import config; before = config.CACHE_DIR; import numpy as np; "
        "from flexcam.integrate.compiled.march import put; put(np.ones((1, 2)), found := np.zeros((1, 2))); "
        "assert found.all(); assert config.CACHE_DIR == before"
    )
    subprocess.run([sys.executable, "-c", code], env=environment(FLEXCAM_CACHE=tmp_path), check=True)
    assert [path.name for path in tmp_path.rglob("*.nbi") if "march.put" in path.name]


@pytest.mark.usefixtures("nothing_new")
def test_a_run_that_can_keep_nothing(tmp_path):
    """It compiles for itself, says nothing and leaves nothing behind, and its numbers are those of every other."""
    (tmp_path / "file").write_text("")
    assert said(started(FLEXCAM_CACHE=tmp_path / "file")) == said(started())


def flipped(data):
    """Return bytes with one bit in their middle turned."""
    middle = len(data) // 2
    return data[:middle] + bytes([data[middle] ^ 1]) + data[middle + 1 :]


@pytest.mark.slow
def test_two_processes_that_compile_at_once(tmp_path):
    """Both end well, and what they leave is whole: a third compiles nothing."""
    outputs = {said(process) for process in [started(FLEXCAM_CACHE=tmp_path) for _ in range(2)]}
    kept = {path: path.stat().st_mtime_ns for path in tmp_path.rglob("*.nb?")}
    outputs.add(said(started(FLEXCAM_CACHE=tmp_path)))
    assert len(outputs) == 1
    assert {path: path.stat().st_mtime_ns for path in tmp_path.rglob("*.nb?")} == kept


@pytest.mark.slow
@pytest.mark.usefixtures("nothing_new")
def test_without_a_home(tmp_path):
    process = started(HOME=None, XDG_CACHE_HOME=None, FLEXCAM_CACHE=None)
    assert said(process) == said(started())


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["*.nbi", "*.nbc"])
@pytest.mark.parametrize("spoiled", [lambda data: data[: len(data) // 2], lambda data: b"", lambda data: flipped(data)])
def test_a_spoiled_cache_is_compiled_anew(tmp_path, kind, spoiled):
    """Cut short or emptied, as by a full disk, or one bit turned: the run goes on, and keeps what it made."""
    first = said(started(FLEXCAM_CACHE=tmp_path))
    files = list(tmp_path.rglob(kind))
    assert files
    for path in files:
        path.write_bytes(spoiled(path.read_bytes()))
    assert said(started(FLEXCAM_CACHE=tmp_path)) == first
    made = {path: path.stat().st_mtime_ns for path in tmp_path.rglob("*.nb?")}
    assert said(started(FLEXCAM_CACHE=tmp_path)) == first
    assert {path: path.stat().st_mtime_ns for path in tmp_path.rglob("*.nb?")} == made
