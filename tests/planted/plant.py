"""Plant every fault of ``faults.toml`` in a copy of the tree; fail if the suite stays green under any of them.

Run as ``python -m tests.planted.plant`` from the root of the repository.
"""

from __future__ import annotations

import argparse
import os
import shutil
import subprocess
import sys
import tempfile
import tomllib
from concurrent.futures import ThreadPoolExecutor
from functools import partial
from pathlib import Path

from tests.planted.anchors import AnchorError, Edit, Fault, Package

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


def refusals(faults: list[Fault], tree: Path) -> list[str]:
    """Return what is wrong with the places of the faults and the tests that they name."""
    package, found = Package(tree), []
    for fault in faults:
        try:
            package.edit(fault)
        except AnchorError as error:
            found.append(str(error))
        missing = [test for test in fault["tests"] if not (tree / test.partition("::")[0]).exists()]
        found += [f"{fault['name']}: there is no {test}" for test in missing]
    return found


def control(faults: list[Fault], sound: Path, kept: Path) -> None:
    """Every selection of tests must be green before a fault is planted, or its failing would prove nothing."""
    everything = sorted({test for fault in faults for test in fault["tests"]})
    if said := failures(sound, everything, kept, WORKERS):
        message = f"{said}\nthe suite fails without any fault planted"
        raise SystemExit(message)


def caught(fault: Fault, edit: Edit, sound: Path, kept: Path) -> bool:
    """Tell whether the tests of a fault fail on a tree that has it."""
    with tempfile.TemporaryDirectory() as folder:
        tree = Path(folder)
        copy_tree(sound, tree)
        edit.apply(tree)
        return bool(failures(tree, fault["tests"], kept))


def survivors(faults: list[Fault]) -> list[str]:
    """Plant the faults one by one, tell how each ends, and return the names of those that no test catches."""
    survived = []
    # Each thread waits for a process of its own.
    with tempfile.TemporaryDirectory() as folder, ThreadPoolExecutor(WORKERS) as threads:
        sound, kept = Path(folder) / "sound", Path(folder) / "machine-code"
        sound.mkdir()
        copy_tree(ROOT, sound)
        package = Package(sound)
        edits = [package.edit(fault) for fault in faults]
        control(faults, sound, kept)
        for fault, seen in zip(
            faults, threads.map(partial(caught, sound=sound, kept=kept), faults, edits), strict=True
        ):
            sys.stdout.write(f"{'caught' if seen else 'SURVIVED'}: {fault['name']}\n")
            sys.stdout.flush()
            survived += [] if seen else [fault["name"]]
    return survived


def main() -> int:
    parser = argparse.ArgumentParser(description="Plant known faults; fail if the tests stay green under any of them.")
    parser.add_argument("--check", action="store_true", help="only check that every fault has exactly one place")
    parser.add_argument(
        "--only", metavar="SUBSTRING", action="append", help="only faults with this in their name; may be repeated"
    )
    asked = parser.parse_args()
    faults = [fault for fault in FAULTS if any(some in fault["name"] for some in asked.only or [""])]
    if not faults:
        parser.error(f"no fault has {' or '.join(asked.only)} in its name")
    if refused := refusals(faults, ROOT):
        sys.stderr.write("".join(f"{one}\n" for one in refused))
        return 1
    if asked.check:
        sys.stdout.write(f"{len(faults)} faults have their places\n")
        return 0
    survived = survivors(faults)
    sys.stdout.write(f"{len(faults) - len(survived)} of {len(faults)} faults caught\n")
    sys.stdout.write("".join(f"no test catches: {name}\n" for name in survived))
    return 1 if survived else 0


if __name__ == "__main__":
    raise SystemExit(main())
