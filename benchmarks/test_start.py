"""What a process costs: Python alone, the import, commands as a user calls them."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

MODEL = Path(__file__).parents[1] / "cases" / "tayeb" / "model-3-shm.toml"
CALLS = {
    "python": ["-c", "pass"],
    "numpy": ["-c", "import numpy"],
    "import flexcam": ["-c", "import flexcam"],
    "all of run": ["-c", "import flexcam; flexcam.run, flexcam.read_case"],
    "help": ["-m", "flexcam", "--help"],
    "check": ["-m", "flexcam", "check", str(MODEL)],
    "run": ["-m", "flexcam", "run", str(MODEL), "-o", ".", "--overwrite"],
}
"""Words after ``python``; the last is 7200 steps of published model 3 with a result file."""


@pytest.mark.parametrize("words", CALLS.values(), ids=CALLS)
def test_process(benchmark, words, tmp_path):
    call = [sys.executable, *words]
    assert benchmark(subprocess.run, call, cwd=tmp_path, check=True, capture_output=True).returncode == 0
