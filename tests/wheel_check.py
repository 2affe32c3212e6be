"""Build wheel and source archive, install the wheel where nothing of the tree is, and use it there as a stranger would.

``python tests/wheel_check.py [FOLDER]``; archives go to FOLDER (default ``dist``). See docs/release.md.
"""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
import tarfile
import tempfile
import venv
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
CASE, MESH = "cases/tayeb/model-3-shm.toml", "meshes/tayeb-3.msh"
DEMO = (
    ("compare", CASE),
    ("run", CASE, "-o", "results"),
    ("info", "results/model-3-shm.vtkhdf"),
    ("export", "results/model-3-shm.vtkhdf", "--format", "pvd"),
    ("report", "results/model-3-shm.vtkhdf", "-o", "results/model-3-shm.html"),
    ("new", "pushrod-engine", "-o", "mine.toml"),
    ("check", "mine.toml"),
)
SOURCES = (
    "README.md",
    "LICENSE",
    "CHANGELOG.md",
    "CITATION.cff",
    "tests/conftest.py",
    CASE,
    MESH,
    "docs/architecture.md",
)
"""What the source archive must hold, among all else: it is built from, tested and cited without the repository."""


def versions() -> set[str]:
    """Return the version as each place says it; they must be one."""
    places = {
        "pyproject.toml": r'^version = "(.+)"',
        "flexcam/__init__.py": r'^__version__ = "(.+)"',
        "CITATION.cff": r"^version: (.+)",
    }
    return {re.findall(found, (ROOT / name).read_text(encoding="utf-8"), re.M)[0] for name, found in places.items()}


def call(*words: object, folder: Path) -> str:
    """Run a command apart from this tree and its environment; end with what it said if it fails."""
    apart = {name: value for name, value in os.environ.items() if not name.startswith(("PYTHON", "VIRTUAL_ENV"))}
    done = subprocess.run([str(w) for w in words], cwd=folder, env=apart, capture_output=True, text=True, check=False)
    if done.returncode:
        message = f"{' '.join(map(str, words))} ended with {done.returncode}\n{done.stdout}{done.stderr}"
        raise SystemExit(message)
    return done.stdout


def built(into: Path) -> tuple[Path, Path]:
    """Return wheel and source archive; the wheel is built from the archive, which so proves complete."""
    shutil.rmtree(into, ignore_errors=True)
    call(sys.executable, "-m", "build", "--outdir", into, ROOT, folder=ROOT)
    return next(into.glob("*.whl")), next(into.glob("*.tar.gz"))


def lacking(archive: Path) -> list[str]:
    with tarfile.open(archive) as packed:
        names = {name.partition("/")[2] for name in packed.getnames()}
    return [name for name in SOURCES if name not in names]


def used(wheel: Path, away: Path) -> None:
    """Install the wheel in an empty environment and run the demo there."""
    venv.create(away / "venv", with_pip=True)
    scripts = away / "venv/bin"
    call(scripts / "python", "-m", "pip", "install", "--quiet", "--disable-pip-version-check", wheel, folder=away)
    where = call(scripts / "python", "-c", "import flexcam; print(flexcam.__file__)", folder=away).strip()
    if not Path(where).is_relative_to(away):
        message = f"{where} is not what was installed"
        raise SystemExit(message)
    for name in (CASE, MESH):
        (away / name).parent.mkdir(parents=True, exist_ok=True)
        shutil.copy(ROOT / name, away / name)
    for words in (("--version",), ("selftest",), *DEMO):
        sys.stdout.write(f"flexcam {' '.join(words)}\n{call(scripts / 'flexcam', *words, folder=away)}\n")


def main(into: Path) -> None:
    if len(found := versions()) != 1:
        message = f"the version is said in several ways: {sorted(found)}"
        raise SystemExit(message)
    wheel, archive = built(into.resolve())
    if names := lacking(archive):
        message = f"{archive.name} lacks {', '.join(names)}"
        raise SystemExit(message)
    with tempfile.TemporaryDirectory(prefix="flexcam-wheel-") as away:
        used(wheel, Path(away))
    sys.stdout.write(f"{wheel.name} and {archive.name} hold; both lie in {into}\n")


if __name__ == "__main__":
    main(Path(sys.argv[1] if len(sys.argv) > 1 else ROOT / "dist"))
