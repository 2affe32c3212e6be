"""Commands as whole processes, timed."""

from __future__ import annotations

import os
import subprocess
import time
from collections.abc import Sequence
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]


class FailedError(RuntimeError):
    """A process that ended with a fault; its text is the last line it said."""


def seconds(command: Sequence[str | Path], **variables: str) -> float:
    """Run a command from the root of the project with one thread of linear algebra and return how long it took, s."""
    environment = os.environ | {"OPENBLAS_NUM_THREADS": "1", "OMP_NUM_THREADS": "1"} | variables
    began = time.perf_counter()
    ended = subprocess.run(command, cwd=ROOT, env=environment, capture_output=True, text=True, check=False)
    took = time.perf_counter() - began
    if ended.returncode:
        raise FailedError((ended.stderr.strip() or f"exit code {ended.returncode}").splitlines()[-1])
    return took
