"""Fixtures of the command line tests: the command in this process or in its own process, cases and results."""

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
def spawn(tmp_path):
    """Run the command in its own process and check that its output shows no traceback."""
    return lambda *words: finish(start(words, tmp_path))


@pytest.fixture
def wide_flexcam(flexcam, monkeypatch):
    """Run the command in this process with a terminal width of 200 columns."""
    monkeypatch.setenv("COLUMNS", "200")
    return flexcam


@pytest.fixture
def stop_run(tmp_path):
    """Start a run of several hours, send a signal once its file has grown, and return the completed process."""

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
    """Copy the inline case as case.toml to the working folder of the commands."""
    return Path(shutil.copy(ROOT / "tests/data/inline.toml", tmp_path / "case.toml"))


RESULT_CACHE: dict[str, bytes] = {}
"""Result of the inline case from its first run."""


@pytest.fixture
def result(flexcam, case, tmp_path):
    """Return the result of the inline case, which is computed once and then copied."""
    path = tmp_path / "out/case.vtkhdf"
    if RESULT_CACHE:
        path.parent.mkdir()
        path.write_bytes(RESULT_CACHE["result"])
        return path
    assert flexcam("run", case.name, "-o", "out").code == 0
    RESULT_CACHE["result"] = path.read_bytes()
    return path


@pytest.fixture
def one_mass(tmp_path):
    """Write the single-mass case with parts of its text replaced and return its path."""

    def write(*replacements):
        text = (Path(__file__).parents[1] / "data/limits/one-mass.toml").read_text(encoding="utf-8")
        for old, new in replacements:
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
    """Return a coarse result of one revolution of the pushrod engine."""
    few = ["run.steps_per_revolution=720", "run.revolutions=1", "run.engine=kernel"]
    ready = prepare(read_case(ROOT / "cases/pushrod-engine/intake.toml", few))
    sink = open_result_file(ready, tmp_path_factory.mktemp("intake"))
    assert solve(ready.problem, ready.scheme, save=ready.save, sinks=[sink]).status.ok
    return sink.path
