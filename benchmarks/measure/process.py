"""Whole processes: what a user waits for a command."""

from __future__ import annotations

import sys
import tempfile

from benchmarks.processes import seconds

CASE = "cases/tayeb/model-3-shm.toml"
REPEATS = 7
COMMANDS = {
    "Python alone": ["-c", "pass"],
    "`import flexcam`": ["-c", "import flexcam"],
    "`import flexcam`, a case read": ["-c", f"import flexcam; flexcam.read_case('{CASE}')"],
    f"`flexcam check {CASE}`": ["-m", "flexcam", "check", CASE],
    f"`flexcam run {CASE}`, result written": ["-m", "flexcam", "run", CASE, "--overwrite", "-o"],
}


def measured() -> list[dict[str, object]]:
    """Return the time of each command, files and caches warm; they take turns."""
    took: dict[str, list[float]] = {name: [] for name in COMMANDS}
    with tempfile.TemporaryDirectory() as folder:
        for _ in range(REPEATS):
            for name, arguments in COMMANDS.items():
                out = [folder] if arguments[-1] == "-o" else []
                took[name].append(seconds([sys.executable, *arguments, *out]))
    return [{"command": name, "seconds": min(its)} for name, its in took.items()]
