"""The command in a process of its own, where that is what is tested; the fixture `flexcam` runs it in this one."""

from __future__ import annotations

import json
import signal
import subprocess
import sys
from dataclasses import dataclass
from typing import Any

PROGRAM = ("-m", "flexcam")
OFTEN = (
    "-c",
    """
from flexcam.cli.main import main
from flexcam.io import result_writer
result_writer._MAX_COPY_TIME = float("inf")
main()
""",
)
"""The command, with a copy after every block, so that no busy machine makes the first one late."""


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


def start(words, folder, program=PROGRAM):
    """Start a command in a folder."""
    command = [sys.executable, *program, *map(str, words)]
    return subprocess.Popen(
        command, cwd=folder, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, preexec_fn=default_signals
    )


def facts(run, *words):
    """Return the JSON of a command that succeeds."""
    done = run(*words, "--json")
    assert (done.code, done.err) == (0, "")
    return done.json
