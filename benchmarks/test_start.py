"""Time of processes: Python alone, the import, and commands."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

CASE = Path(__file__).parents[1] / "cases" / "tayeb" / "model-3-shm.toml"
ARGUMENTS = {
    "python": ["-c", "pass"],
    "numpy": ["-c", "import numpy"],
    "import flexcam": ["-c", "import flexcam"],
    "all of run": ["-c", "import flexcam; flexcam.run, flexcam.read_case"],
    "help": ["-m", "flexcam", "--help"],
    "check": ["-m", "flexcam", "check", str(CASE)],
    "run": ["-m", "flexcam", "run", str(CASE), "-o", ".", "--overwrite"],
}
"""Arguments of ``python``; the last runs 7200 steps of published model 3 and writes a result file."""


@pytest.mark.parametrize("arguments", ARGUMENTS.values(), ids=ARGUMENTS)
def test_process(benchmark, arguments, tmp_path):
    command = [sys.executable, *arguments]
    assert benchmark(subprocess.run, command, cwd=tmp_path, check=True, capture_output=True).returncode == 0
