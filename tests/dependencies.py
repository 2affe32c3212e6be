"""Run the suite with the lowest and the newest dependencies: ``python tests/dependencies.py [lowest|newest] [PYTHON]``.

The lowest are the floors of pyproject.toml, those of the tests included, on the oldest Python; the newest are what pip
selects, on every Python that is found. Each combination has an environment in ``build/dependencies``.
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
    f"python3.{one[1]}" for one in map(re.compile(r".* :: Python :: 3\.(\d+)").fullmatch, PROJECT["classifiers"]) if one
]
UNUSED = ("dev", "peers")
"""Extras that the suite does not install."""


def floors() -> list[str]:
    """Return a constraint ``package==floor`` for every dependency with a floor."""
    extras = [group for extra, group in PROJECT["optional-dependencies"].items() if extra not in UNUSED]
    wanted = [*PROJECT["dependencies"], *(one for group in extras for one in group)]
    found = (re.match(r"([\w.-]+)>=([\w.]+)", one) for one in wanted)
    return [f"{one[1]}=={one[2]}" for one in found if one]


def combinations(which: str, python: str) -> Iterator[tuple[str, str]]:
    """Yield what is asked for: which dependencies, and on which Python."""
    pythons = [python] if python else [one for one in PYTHONS if starts(one)]
    if which in ("", "lowest"):
        yield "lowest", pythons[0]
    if which in ("", "newest"):
        yield from (("newest", one) for one in pythons)


def starts(python: str) -> bool:
    """Return whether a Python is installed and runs."""
    return (
        bool(shutil.which(python))
        and not subprocess.run([python, "--version"], capture_output=True, check=False).returncode
    )


def run(which: str, python: str) -> int:
    """Make the environment and return the exit code of its suite."""
    folder = ROOT / "build/dependencies" / f"{which}-{Path(python).name}"
    shutil.rmtree(folder, ignore_errors=True)
    subprocess.run([python, "-m", "venv", folder], check=True)
    constraints = folder / "constraints.txt"
    constraints.write_text("\n".join(floors() if which == "lowest" else []), encoding="utf-8")
    pip = [folder / "bin/python", "-m", "pip", "--quiet", "--disable-pip-version-check"]
    subprocess.run([*pip, "install", "--constraint", constraints, "--editable", f"{ROOT}[test,docs]"], check=True)
    environment = os.environ | {"OPENBLAS_NUM_THREADS": "1", "FLEXCAM_CACHE": str(folder)}
    suite = [folder / "bin/python", "-m", "pytest", "-q", "-n", os.environ.get("JOBS", "2"), "--dist", "worksteal"]
    if which == "lowest":  # old packages warn of newer ones that they themselves need
        suite += ["-W", "default"]
    return subprocess.run(suite, cwd=ROOT, env=environment, check=False).returncode


def main(which: str = "", python: str = "") -> int:
    codes = {one: run(*one) for one in combinations(which, python)}
    for (chosen, its), code in codes.items():
        sys.stdout.write(f"{chosen} dependencies, {Path(its).name}: {'failed' if code else 'passed'}\n")
    return int(any(codes.values()))


if __name__ == "__main__":
    raise SystemExit(main(*sys.argv[1:]))
