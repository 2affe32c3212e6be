"""Times of complete commands, and of the compilation of the kernel."""

from __future__ import annotations

import sys
import tempfile
from pathlib import Path

from benchmarks.processes import ROOT, time_command

CASE = "cases/tayeb/model-3-shm.toml"
REPEATS = 7
COMMANDS = {
    "Python alone": ["-c", "pass"],
    "`import flexcam`": ["-c", "import flexcam"],
    "`import flexcam`, a case read": ["-c", f"import flexcam; flexcam.read_case('{CASE}')"],
    f"`flexcam check {CASE}`": ["-m", "flexcam", "check", CASE],
    f"`flexcam run {CASE}`, result written": ["-m", "flexcam", "run", CASE, "--overwrite", "-o"],
}
COMPILED_CASE = ROOT / "cases/pushrod-engine/intake.toml"
COMPILED_REPEATS = 3


def measure_table() -> list[dict[str, object]]:
    """Return the time of each command, files and caches warm; the commands alternate."""
    times: dict[str, list[float]] = {name: [] for name in COMMANDS}
    with tempfile.TemporaryDirectory() as folder:
        for _ in range(REPEATS):
            for name, arguments in COMMANDS.items():
                output = [folder] if arguments[-1] == "-o" else []
                times[name].append(time_command([sys.executable, *arguments, *output]))
    return [{"command": name, "seconds": min(times[name])} for name in COMMANDS]


def measure_compilation() -> dict[str, float]:
    """Return the times of a run with contacts.

    Without cached code, with cached code, with code compiled into the wheel, and with the direct engine.
    """
    repeats = range(COMPILED_REPEATS)
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        install = [sys.executable, "-m", "pip", "install", "--quiet", "--no-deps", "--target", folder / "wheel", ROOT]
        time_command(install, FLEXCAM_COMPILE="1")
        run = [sys.executable, "-m", "flexcam", "run", COMPILED_CASE, "--overwrite", "-o", folder / "results"]
        first = [time_command(run, FLEXCAM_CACHE=str(folder / str(i))) for i in repeats]
        later = [time_command(run, FLEXCAM_CACHE=str(folder / "0")) for _ in repeats]
        without = [time_command([*run, "--set", "run.engine=direct"]) for _ in repeats]
        from_wheel = {"PYTHONPATH": str(folder / "wheel"), "FLEXCAM_CACHE": str(folder / "new")}
        wheel = [time_command([run[0], "-P", *run[1:]], **from_wheel) for _ in repeats]
        if (folder / "new").exists():
            message = "the wheel has no code for this Python"
            raise RuntimeError(message)
    return {"first_s": min(first), "later_s": min(later), "wheel_s": min(wheel), "without_s": min(without)}
