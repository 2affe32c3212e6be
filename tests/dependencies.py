"""Run the suite with the lowest and the newest dependencies: ``python tests/dependencies.py [lowest|newest] [PYTHON]``.

The lowest dependencies are the minimum versions in pyproject.toml, also of the tests, on the oldest Python. The newest
are those that pip selects, on every installed Python. Each combination has an environment in ``build/dependencies``.
"""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
import tomllib
from collections.abc import Iterator
from pathlib import Path

ROOT = Path(__file__).parents[1]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
PYTHONS = [
    f"python3.{match[1]}"
    for match in map(re.compile(r".* :: Python :: 3\.(\d+)").fullmatch, PROJECT["classifiers"])
    if match
]
UNUSED = ("dev", "peers")
"""Extras that the test suite does not need."""


def floors() -> list[str]:
    """Return a constraint ``package==version`` for every dependency with a minimum version."""
    extras = [group for extra, group in PROJECT["optional-dependencies"].items() if extra not in UNUSED]
    requirements = [*PROJECT["dependencies"], *(requirement for group in extras for requirement in group)]
    matches = (re.match(r"([\w.-]+)>=([\w.]+)", requirement) for requirement in requirements)
    return [f"{match[1]}=={match[2]}" for match in matches if match]


def combinations(which: str, python: str) -> Iterator[tuple[str, str]]:
    """Yield the requested combinations of dependencies, `lowest` or `newest`, and Python."""
    pythons = [python] if python else [name for name in PYTHONS if is_installed(name)]
    if which in ("", "lowest"):
        yield "lowest", pythons[0]
    if which in ("", "newest"):
        yield from (("newest", name) for name in pythons)


def is_installed(python: str) -> bool:
    """Return whether a Python is installed and runs."""
    return (
        bool(shutil.which(python))
        and not subprocess.run([python, "--version"], capture_output=True, check=False).returncode
    )


def run(which: str, python: str) -> int:
    """Create an environment, run the test suite in it and return the exit code."""
    folder = ROOT / "build/dependencies" / f"{which}-{Path(python).name}"
    shutil.rmtree(folder, ignore_errors=True)
    subprocess.run([python, "-m", "venv", folder], check=True)
    constraints = folder / "constraints.txt"
    constraints.write_text("\n".join(floors() if which == "lowest" else []), encoding="utf-8")
    pip = [folder / "bin/python", "-m", "pip", "--quiet", "--disable-pip-version-check"]
    subprocess.run([*pip, "install", "--constraint", constraints, "--editable", f"{ROOT}[test,docs]"], check=True)
    environment = os.environ | {"OPENBLAS_NUM_THREADS": "1", "FLEXCAM_CACHE": str(folder)}
    suite = [folder / "bin/python", "-m", "pytest", "-q", "-n", os.environ.get("JOBS", "2"), "--dist", "worksteal"]
    if which == "lowest":  # old packages cause deprecation warnings in others
        suite += ["-W", "default"]
    return subprocess.run(suite, cwd=ROOT, env=environment, check=False).returncode


def main(which: str = "", python: str = "") -> int:
    codes = {combination: run(*combination) for combination in combinations(which, python)}
    for (dependencies, python_name), code in codes.items():
        sys.stdout.write(f"{dependencies} dependencies, {Path(python_name).name}: {'failed' if code else 'passed'}\n")
    return int(any(codes.values()))


if __name__ == "__main__":
    raise SystemExit(main(*sys.argv[1:]))
