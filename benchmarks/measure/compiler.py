"""Cost of the compiled kernel at its first use on a machine, and after that."""

from __future__ import annotations

import sys
import tempfile
from pathlib import Path

from benchmarks.processes import ROOT, seconds

CASE = ROOT / "cases/pushrod-engine/intake.toml"
REPEATS = 3


def measured() -> dict[str, float]:
    """Return seconds of a run with contacts: without cached code, with it, and without compiled code."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        run = [sys.executable, "-m", "flexcam", "run", CASE, "--overwrite", "-o", folder / "results"]
        first = [seconds(run, FLEXCAM_CACHE=str(folder / str(i))) for i in range(REPEATS)]
        later = [seconds(run, FLEXCAM_CACHE=str(folder / "0")) for _ in range(REPEATS)]
        without = [seconds([*run, "--set", "run.engine=direct"]) for _ in range(REPEATS)]
    return {"first_s": min(first), "later_s": min(later), "without_s": min(without)}
