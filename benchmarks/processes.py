"""Time and memory of separate processes."""

from __future__ import annotations

import os
import subprocess
import sys
import time
from collections.abc import Sequence
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
# Not the value of `resource`: a new process begins there with the peak of its parent.
_PRINT_PEAK = "print(next(line.split()[1] for line in open('/proc/self/status') if line.startswith('VmHWM')))"


class ProcessError(RuntimeError):
    """A failed process; the message is the last line of its output."""


def time_command(command: Sequence[str | Path], **variables: str) -> float:
    """Run a command in the project's folder with one thread of linear algebra and return its time, s."""
    environment = os.environ | {"OPENBLAS_NUM_THREADS": "1", "OMP_NUM_THREADS": "1"} | variables
    start = time.perf_counter()
    process = subprocess.run(command, cwd=ROOT, env=environment, capture_output=True, text=True, check=False)
    seconds = time.perf_counter() - start
    if process.returncode:
        raise ProcessError((process.stderr.strip() or f"exit code {process.returncode}").splitlines()[-1])
    return seconds


def peak_memory(statements: str) -> int:
    """Run Python statements in a new process and return its peak memory, MB (Linux), with Python and libraries."""
    command = [sys.executable, "-c", f"{statements}\n{_PRINT_PEAK}"]
    process = subprocess.run(command, cwd=ROOT, check=True, capture_output=True, text=True)
    return round(int(process.stdout.split()[-1]) / 1024.0)
