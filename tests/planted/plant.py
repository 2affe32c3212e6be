"""Plant every fault of ``faults.toml`` in a copy of the tree; fail if the suite stays green under any of them."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import tempfile
import tomllib
from concurrent.futures import ThreadPoolExecutor
from functools import partial
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
COPIED = (
    "flexcam", "tests", "docs", "meshes", "cases", "examples", "benchmarks", "pyproject.toml", "Makefile",
    "CITATION.cff", ".pre-commit-config.yaml", *(page.name for page in ROOT.glob("*.md")),
)  # fmt: skip
"""What the tests look at."""
WORKERS = os.cpu_count() or 1
FAULTS = tomllib.loads((ROOT / "tests/planted/faults.toml").read_text(encoding="utf-8"))["fault"]


def copy_tree(source: Path, target: Path) -> None:
    """Copy a tree with what Python has compiled of it; what is changed in the copy is compiled anew."""
    for name in COPIED:
        if (source / name).is_dir():
            shutil.copytree(source / name, target / name)
        else:
            shutil.copy(source / name, target / name)


def failures(tree: Path, tests: list[str], kept: Path, workers: int = 0) -> str:
    """Run the tests on the tree; return what pytest says if one fails (a suite that cannot even run proves nothing).

    Machine code is kept for all of them in one folder: it is found by the text it was made from, so that a tree with a
    fault in this text has its own.
    """
    command = [sys.executable, "-m", "pytest", "-q", "-x", "-p", "no:cacheprovider", "-n", str(workers), *tests]
    environment = {
        **os.environ, "PYTHONPATH": str(tree), "PYTHONDONTWRITEBYTECODE": "", "FLEXCAM_CACHE": str(kept),
        "FLEXCAM_PLANTED": "1",
        "FLEXCAM_VERIFICATION_JSON": str(tree / "verification.json"),
    }  # fmt: skip
    done = subprocess.run(command, cwd=tree, env=environment, capture_output=True, text=True, check=False)
    if done.returncode not in (0, 1):
        sys.stderr.write(done.stdout + done.stderr)
        message = f"pytest ended with {done.returncode} instead of running the tests"
        raise SystemExit(message)
    return done.stdout if done.returncode == 1 else ""


def plant(fault: dict[str, str], tree: Path) -> None:
    path = tree / fault["file"]
    text = path.read_text(encoding="utf-8")
    if text.count(fault["old"]) != 1:
        message = f"{fault['name']}: the text to replace stands {text.count(fault['old'])} times in {fault['file']}"
        raise SystemExit(message)
    path.write_text(text.replace(fault["old"], fault["new"]), encoding="utf-8")


def control(sound: Path, kept: Path) -> None:
    """Every selection of tests must be green before a fault is planted, or its failing would prove nothing."""
    everything = sorted({test for fault in FAULTS for test in fault["tests"]})
    if said := failures(sound, everything, kept, WORKERS):
        message = f"{said}\nthe suite fails without any fault planted"
        raise SystemExit(message)


def caught(fault: dict[str, str], sound: Path, kept: Path) -> bool:
    """Tell whether the tests of a fault fail on a tree that has it."""
    with tempfile.TemporaryDirectory() as folder:
        tree = Path(folder)
        copy_tree(sound, tree)
        plant(fault, tree)
        return bool(failures(tree, fault["tests"], kept))


def main() -> int:
    survived = []
    # Each thread waits for a process of its own.
    with tempfile.TemporaryDirectory() as folder, ThreadPoolExecutor(WORKERS) as threads:
        sound, kept = Path(folder) / "sound", Path(folder) / "machine-code"
        sound.mkdir()
        copy_tree(ROOT, sound)
        control(sound, kept)
        for fault, seen in zip(FAULTS, threads.map(partial(caught, sound=sound, kept=kept), FAULTS), strict=True):
            sys.stdout.write(f"{'caught' if seen else 'SURVIVED'}: {fault['name']}\n")
            sys.stdout.flush()
            survived += [] if seen else [fault["name"]]
    sys.stdout.write(f"{len(FAULTS) - len(survived)} of {len(FAULTS)} faults caught\n")
    return 1 if survived else 0


if __name__ == "__main__":
    raise SystemExit(main())
