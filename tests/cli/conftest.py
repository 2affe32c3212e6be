"""The command in a folder of its own: in this process, or in one of its own where that is what a test is about."""

from __future__ import annotations

import json
import shutil
import signal
import subprocess
import sys
import time
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest

from flexcam.cli.app import run_state
from flexcam.cli.main import main

ROOT = Path(__file__).parents[2]
LONG = ("--set", "run.revolutions=100000", "--set", "run.steps_per_revolution=7200", "--allow-large")


@dataclass(frozen=True)
class Ended:
    """A command that ended: exit code, both streams."""

    code: int
    out: str
    err: str

    @property
    def json(self) -> Any:
        return json.loads(self.out)


def default_signals():
    """Undo what a test run in the background inherits: interrupts ignored."""
    signal.signal(signal.SIGINT, signal.SIG_DFL)


def start(words, folder):
    command = [sys.executable, "-m", "flexcam", *map(str, words)]
    return subprocess.Popen(
        command, cwd=folder, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, preexec_fn=default_signals
    )


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
def flexcam(tmp_path, monkeypatch, capsys):
    """Run the command in this process, which a start of Python would take four times as long as most commands do."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.delenv("COLUMNS", raising=False)
    monkeypatch.setattr(signal, "signal", lambda *_: None)

    def run(*words):
        monkeypatch.setattr(run_state, "solving", False)
        with pytest.raises(SystemExit) as ended:
            main([str(word) for word in words])
        out, err = capsys.readouterr()
        assert "Traceback" not in out + err
        return Ended(ended.value.code, out, err)

    return run


@pytest.fixture
def told(flexcam, monkeypatch):
    """Run the command in this process, on a wide screen."""
    monkeypatch.setenv("COLUMNS", "200")
    return flexcam


@pytest.fixture
def stopped(tmp_path):
    """Start a run that would take hours, send a signal once its file has grown, and return how it ended."""

    def run(number, *words):
        process = start(["run", "case.toml", "-o", "out", *LONG, *words], tmp_path)
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


@pytest.fixture(scope="session")
def tayeb():
    return lambda model, law="shm": ROOT / f"cases/tayeb/model-{model}-{law}.toml"
