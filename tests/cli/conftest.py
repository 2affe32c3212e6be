"""The command in a folder of its own: in this process, or in one of its own where that is what a test is about."""

from __future__ import annotations

import shutil
import subprocess
import time
from pathlib import Path

import pytest

from flexcam import prepare, read_case, solve
from flexcam.analysis.run import open_result_file
from tests.command import OFTEN, Ended, start

ROOT = Path(__file__).parents[2]
LONG = ("--set", "run.revolutions=100000", "--set", "run.steps_per_revolution=7200", "--allow-large")


def finish(process):
    try:
        out, err = process.communicate(timeout=60)
    except subprocess.TimeoutExpired:
        process.kill()
        pytest.fail(f"did not end within 60 s: {process.communicate()[1]}")
    assert "Traceback" not in err
    assert "Traceback" not in out
    return Ended(process.returncode, out, err)


@pytest.fixture
def spawned(tmp_path):
    """Run the command in a process of its own; no output of it ever shows a traceback."""
    return lambda *words: finish(start(words, tmp_path))


@pytest.fixture
def told(flexcam, monkeypatch):
    """Run the command in this process, on a wide screen."""
    monkeypatch.setenv("COLUMNS", "200")
    return flexcam


@pytest.fixture
def stopped(tmp_path):
    """Start a run that would take hours, send a signal once its file has grown, and return how it ended."""

    def run(number, *words):
        process = start(["run", "case.toml", "-o", "out", *LONG, *words], tmp_path, OFTEN)
        partial = tmp_path / "out/case.partial.vtkhdf"
        until = time.monotonic() + 30.0
        while not (partial.exists() and partial.stat().st_size > 300_000):
            if process.poll() is not None or time.monotonic() > until:
                process.kill()
                pytest.fail(f"the run wrote nothing: {process.communicate()}")
            time.sleep(0.02)
        process.send_signal(number)
        return finish(process), partial

    return run


@pytest.fixture
def case(tmp_path):
    """Put the inline case as case.toml into the folder the commands run in."""
    return Path(shutil.copy(ROOT / "tests/data/inline.toml", tmp_path / "case.toml"))


KEPT: dict[str, bytes] = {}
"""The result of the inline case, from its first run."""


@pytest.fixture
def result(flexcam, case, tmp_path):
    """Return the result of the inline case, which is computed once and then copied."""
    path = tmp_path / "out/case.vtkhdf"
    if KEPT:
        path.parent.mkdir()
        path.write_bytes(KEPT["result"])
        return path
    assert flexcam("run", case.name, "-o", "out").code == 0
    KEPT["result"] = path.read_bytes()
    return path


@pytest.fixture
def one_mass(tmp_path):
    """Write the case of one mass, with parts of its text replaced, and return its path."""

    def write(*replaced):
        text = (Path(__file__).parents[1] / "data/limits/one-mass.toml").read_text(encoding="utf-8")
        for old, new in replaced:
            assert old in text
            text = text.replace(old, new)
        path = tmp_path / "one.toml"
        path.write_text(text, encoding="utf-8")
        return path

    return write


@pytest.fixture(scope="session")
def tayeb():
    return lambda model, law="shm": ROOT / f"cases/tayeb/model-{model}-{law}.toml"


@pytest.fixture(scope="session")
def intake(tmp_path_factory):
    """Return the result of a revolution of the pushrod engine in few steps."""
    few = ["run.steps_per_revolution=720", "run.revolutions=1", "run.engine=kernel"]
    ready = prepare(read_case(ROOT / "cases/pushrod-engine/intake.toml", few))
    sink = open_result_file(ready, tmp_path_factory.mktemp("intake"))
    assert solve(ready.problem, ready.scheme, save=ready.save, sinks=[sink]).status.ok
    return sink.path
