"""The command in a separate process; the fixture `flexcam` runs it in the process of the test."""

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
"""The command with a copy of the result after every block, so that a slow machine does not delay the first copy."""


@dataclass(frozen=True)
class Ended:
    """Exit code and output of a command."""

    code: int
    out: str
    err: str

    @property
    def json(self) -> Any:
        return json.loads(self.out)


def default_signals():
    """Restore the default action of interrupts, which a process in the background ignores."""
    signal.signal(signal.SIGINT, signal.SIG_DFL)


def start(words, folder, program=PROGRAM):
    """Start a command in a folder."""
    command = [sys.executable, *program, *map(str, words)]
    return subprocess.Popen(
        command, cwd=folder, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, preexec_fn=default_signals
    )


def facts(run, *words):
    """Return the JSON output of a successful command."""
    result = run(*words, "--json")
    assert (result.code, result.err) == (0, "")
    return result.json
