"""Plant every fault of ``faults.toml`` in a copy of the tree; fail if the suite passes with any of them.

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
from queue import SimpleQueue

from tests.planted.anchors import AnchorError, Edit, Fault, Package

ROOT = Path(__file__).resolve().parents[2]
COPIED = (
    "flexcam", "tests", "docs", "meshes", "cases", "examples", "benchmarks", "pyproject.toml", "hatch_build.py",
    "Makefile", "CITATION.cff", ".pre-commit-config.yaml", *(page.name for page in ROOT.glob("*.md")),
)  # fmt: skip
"""Files and folders that the tests need."""
WORKERS = os.cpu_count() or 1
FAULTS = tomllib.loads((ROOT / "tests/planted/faults.toml").read_text(encoding="utf-8"))["fault"]


def copy_tree(source: Path, target: Path) -> None:
    """Copy a tree with its compiled Python files; changed files are compiled again."""
    for name in COPIED:
        if (source / name).is_dir():
            shutil.copytree(source / name, target / name)
        else:
            shutil.copy(source / name, target / name)


def run_tests(tree: Path, tests: list[str], cache: Path, workers: int = 0) -> str:
    """Run the tests on the tree; return the output of pytest if a test fails, else an empty string.

    Raise SystemExit if the suite cannot run. The key of the cache of machine code is the path of the tree and the
    source text: trees at one path share it, but for those with a fault in this text.
    """
    command = [sys.executable, "-m", "pytest", "-q", "-x", "-p", "no:cacheprovider", "-n", str(workers), *tests]
    environment = {
        **os.environ, "PYTHONPATH": str(tree), "PYTHONDONTWRITEBYTECODE": "", "FLEXCAM_CACHE": str(cache),
        "FLEXCAM_PLANTED": "1",
        "FLEXCAM_VERIFICATION_JSON": str(tree / "verification.json"),
    }  # fmt: skip
    done = subprocess.run(command, cwd=tree, env=environment, capture_output=True, text=True, check=False)
    if done.returncode not in (0, 1):
        sys.stderr.write(done.stdout + done.stderr)
        message = f"pytest ended with {done.returncode} instead of running the tests"
        raise SystemExit(message)
    return done.stdout if done.returncode == 1 else ""


def find_invalid_faults(faults: list[Fault], tree: Path) -> list[str]:
    """Return errors in the places of the faults and in the tests that they name."""
    package, found = Package(tree), []
    for fault in faults:
        try:
            package.edit(fault)
        except AnchorError as error:
            found.append(str(error))
        missing = [test for test in fault["tests"] if not (tree / test.partition("::")[0]).exists()]
        found += [f"{fault['name']}: there is no {test}" for test in missing]
    return found


def check_suite(faults: list[Fault], sound: Path, cache: Path) -> None:
    """Check that all selected tests pass before a fault is planted; otherwise their failure would prove nothing."""
    everything = sorted({test for fault in faults for test in fault["tests"]})
    if output := run_tests(sound, everything, cache, WORKERS):
        message = f"{output}\nthe suite fails without any fault planted"
        raise SystemExit(message)


def is_caught(fault: Fault, edit: Edit, sound: Path, cache: Path, trees: SimpleQueue[Path]) -> bool:
    """Return whether the tests of a fault fail on a tree with the fault, in a free folder of `trees`."""
    tree = trees.get()
    try:
        tree.mkdir()
        copy_tree(sound, tree)
        edit.apply(tree)
        return bool(run_tests(tree, fault["tests"], cache))
    finally:
        shutil.rmtree(tree)
        trees.put(tree)


def find_survivors(faults: list[Fault]) -> list[str]:
    """Plant the faults one by one, print the outcomes, and return the names of faults that no test catches."""
    survived = []
    # Each thread waits for a separate process.
    with tempfile.TemporaryDirectory() as folder, ThreadPoolExecutor(WORKERS) as threads:
        sound, cache = Path(folder) / "sound", Path(folder) / "machine-code"
        sound.mkdir()
        copy_tree(ROOT, sound)
        package = Package(sound)
        edits = [package.edit(fault) for fault in faults]
        check_suite(faults, sound, cache)
        trees = SimpleQueue[Path]()
        for number in range(WORKERS):
            trees.put(Path(folder) / f"tree-{number}")
        outcomes = threads.map(partial(is_caught, sound=sound, cache=cache, trees=trees), faults, edits)
        for fault, seen in zip(faults, outcomes, strict=True):
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
    options = parser.parse_args()
    faults = [fault for fault in FAULTS if any(some in fault["name"] for some in options.only or [""])]
    if not faults:
        parser.error(f"no fault has {' or '.join(options.only)} in its name")
    if invalid := find_invalid_faults(faults, ROOT):
        sys.stderr.write("".join(f"{one}\n" for one in invalid))
        return 1
    if options.check:
        sys.stdout.write(f"{len(faults)} faults have their places\n")
        return 0
    survived = find_survivors(faults)
    sys.stdout.write(f"{len(faults) - len(survived)} of {len(faults)} faults caught\n")
    sys.stdout.write("".join(f"no test catches: {name}\n" for name in survived))
    return 1 if survived else 0


if __name__ == "__main__":
    raise SystemExit(main())
