"""Build wheel and source archive, install the wheel in a separate environment, and run commands there.

``python tests/wheel_check.py [FOLDER]`` writes the archives to FOLDER (default ``dist``). See docs/release.md.
"""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
import sysconfig
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
CONTACT_CASE = "cases/pushrod-engine/intake.toml"
CONTACT_RUN = """
import sys
import flexcam
run = flexcam.run(flexcam.read_case("contact.toml"))
assert run.stats.engine == "kernel" and run.status.ok, run.status
assert "numba" not in sys.modules, "the wheel lacks the compiled kernel of this Python"
"""
"""Run with contacts, whose compiled code is part of the wheel."""
HAS_COMPILER = shutil.which("cc") is not None and Path(sysconfig.get_path("include"), "Python.h").exists()
SOURCES = (
    "hatch_build.py",
    "README.md",
    "LICENSE",
    "CHANGELOG.md",
    "CITATION.cff",
    "tests/conftest.py",
    CASE,
    MESH,
    "docs/architecture.md",
)
"""Files that the source archive must contain for build, tests and citation without the repository."""


def versions() -> set[str]:
    """Return the versions in all files; they must agree."""
    places = {
        "pyproject.toml": r'^version = "(.+)"',
        "flexcam/__init__.py": r'^__version__ = "(.+)"',
        "CITATION.cff": r"^version: (.+)",
    }
    return {re.findall(pattern, (ROOT / name).read_text(encoding="utf-8"), re.M)[0] for name, pattern in places.items()}


def call(*words: object, folder: Path) -> str:
    """Run a command without the Python environment of this process and return its output; exit if it fails."""
    env = {name: value for name, value in os.environ.items() if not name.startswith(("PYTHON", "VIRTUAL_ENV"))}
    process = subprocess.run([str(w) for w in words], cwd=folder, env=env, capture_output=True, text=True, check=False)
    if process.returncode:
        message = f"{' '.join(map(str, words))} ended with {process.returncode}\n{process.stdout}{process.stderr}"
        raise SystemExit(message)
    return process.stdout


def build(into: Path) -> tuple[Path, Path]:
    """Build wheel and source archive; the build of the wheel from the archive tests that the archive is complete.

    With a C compiler the wheel contains compiled code.
    """
    shutil.rmtree(into, ignore_errors=True)
    os.environ["FLEXCAM_COMPILE"] = str(int(HAS_COMPILER))
    call(sys.executable, "-m", "build", "--outdir", into, ROOT, folder=ROOT)
    return next(into.glob("*.whl")), next(into.glob("*.tar.gz"))


def missing_files(archive: Path) -> list[str]:
    with tarfile.open(archive) as file:
        names = {name.partition("/")[2] for name in file.getnames()}
    return [name for name in SOURCES if name not in names]


def check_wheel(wheel: Path, folder: Path) -> None:
    """Install the wheel in an empty environment and run the demo there."""
    venv.create(folder / "venv", with_pip=True)
    scripts = folder / "venv/bin"
    call(scripts / "python", "-m", "pip", "install", "--quiet", "--disable-pip-version-check", wheel, folder=folder)
    location = call(scripts / "python", "-c", "import flexcam; print(flexcam.__file__)", folder=folder).strip()
    if not Path(location).is_relative_to(folder):
        message = f"{location} is not the installed wheel"
        raise SystemExit(message)
    for name in (CASE, MESH):
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        shutil.copy(ROOT / name, folder / name)
    if HAS_COMPILER:
        shutil.copy(ROOT / CONTACT_CASE, folder / "contact.toml")
        call(scripts / "python", "-c", CONTACT_RUN, folder=folder)
    for words in (("--version",), ("selftest",), *DEMO):
        sys.stdout.write(f"flexcam {' '.join(words)}\n{call(scripts / 'flexcam', *words, folder=folder)}\n")


def main(into: Path) -> None:
    if len(found := versions()) != 1:
        message = f"the versions differ: {sorted(found)}"
        raise SystemExit(message)
    wheel, archive = build(into.resolve())
    if names := missing_files(archive):
        message = f"{archive.name} lacks {', '.join(names)}"
        raise SystemExit(message)
    with tempfile.TemporaryDirectory(prefix="flexcam-wheel-") as folder:
        check_wheel(wheel, Path(folder))
    code = "with" if HAS_COMPILER else "WITHOUT (no C compiler, or no header files of Python)"
    sys.stdout.write(f"{wheel.name} and {archive.name} are complete, in {into}, {code} the compiled kernel\n")


if __name__ == "__main__":
    main(Path(sys.argv[1] if len(sys.argv) > 1 else ROOT / "dist"))
