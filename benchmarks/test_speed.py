"""Speed of the import."""

from __future__ import annotations

import subprocess
import sys


def test_import(benchmark):
    command = [sys.executable, "-c", "import flexcam; flexcam.run, flexcam.read_case"]
    assert benchmark(subprocess.run, command, check=True).returncode == 0
