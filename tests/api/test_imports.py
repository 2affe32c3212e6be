"""Modules loaded by ``import flexcam``, by small objects and by commands."""

import subprocess
import sys
from pathlib import Path

import pytest

from flexcam.cli.app import COMMAND_FILES, app
from flexcam.cli.main import load_commands

HEAVY = {
    "scipy",
    "numba",
    "pyvista",
    "vtkmodules",
    "matplotlib",
    "plotly",
    "jinja2",
    "dask",
    "meshio",
    "h5py",
    "pydantic",
    "cyclopts",
    "rich",
    "pint",
}
CASE = Path(__file__).parents[1] / "data/inline.toml"
ROOT = Path(__file__).parents[2]


def loaded_modules(code):
    """Return the modules that a new process has loaded after some code."""
    tail = "\nimport sys\nsys.stderr.write(' '.join(sys.modules))"
    done = subprocess.run([sys.executable, "-c", code + tail], capture_output=True, text=True, timeout=60)
    assert done.returncode == 0, done.stderr
    return set(done.stderr.split())


def loaded_packages(code):
    """Return the packages that a new process has loaded after some code."""
    return {name.partition(".")[0] for name in loaded_modules(code)}


def test_import_and_small_objects_load_only_numpy():
    parts = ("newmark()", "Material(E=1.0, nu=0.3, density=1.0)", "ConstantSpeed(1.0)", "LAWS['shm']",
             "Mesh([[0, 0, 0], [1, 0, 0]], {'a': [0, 1]}, {})")  # fmt: skip
    assert not loaded_packages("\n".join(["import flexcam", *(f"flexcam.{part}" for part in parts)])) & HEAVY


READ = {"numpy", "pydantic", "pydantic_core", "annotated_types", "typing_extensions", "typing_inspection", "h5py"}
PRINT = {"cyclopts", "attr", "attrs", "rich", "tomli_w"}
TAYEB = str(ROOT / "cases/tayeb/model-3-shm.toml")
UNUSED_MODULES = {"flexcam.studies", "flexcam.plotting.figures", "flexcam.report.page"} | {
    f"flexcam.analysis.{name}"
    for name in ("cam_design", "campbell", "limits", "model_divergence", "orders", "selftest", "stability")
}
BUDGETS = {
    "help": (["--help"], READ | PRINT | {"docstring_parser"}, {"flexcam.plotting.figures"}),
    "run": (["run", str(CASE), "-o", "."], READ | PRINT, UNUSED_MODULES),
    "run on a mesh": (
        ["run", TAYEB, "--set", "run.revolutions=0.1", "-o", "."],
        READ | PRINT | {"meshio"},
        UNUSED_MODULES,
    ),
}
"""Words of a command, the packages that it may load, and the modules of flexcam that it must not load."""


@pytest.fixture(scope="module")
def startup_packages():
    """Return the packages that Python and its installation load at startup."""
    return loaded_packages("pass")


@pytest.mark.parametrize(("words", "packages", "modules_not_asked"), BUDGETS.values(), ids=BUDGETS)
def test_command_loads_only_allowed_packages(
    words, packages, modules_not_asked, startup_packages, tmp_path, monkeypatch
):
    """Start-up dominates a short run: 0.1 s for numpy, 0.6 s for scipy's solvers, 0.8 s for matplotlib."""
    monkeypatch.chdir(tmp_path)
    call = "from flexcam.__main__ import start\ntry:\n    start()\nexcept SystemExit as end:\n    assert not end.code"
    found = loaded_modules(f"import sys\nsys.argv = ['flexcam', *{words!r}]\n{call}")
    foreign = {name.partition(".")[0] for name in found} - startup_packages - sys.stdlib_module_names - {"flexcam"}
    assert "flexcam.cli.app" in found
    assert {name for name in foreign if not name.startswith(("_", "cython"))} <= packages
    assert not found & modules_not_asked


def test_all_commands_have_known_file():
    """A command that is not listed works, but loads the files of all commands."""
    load_commands(["--help"])
    listed = {name: f"flexcam.cli.{file}" for name, file in COMMAND_FILES.items()}
    defined = {name: app[name].default_command for name in app if not name.startswith("-")}
    assert set(listed) == set(defined)
    assert {name: listed[name] for name, one in defined.items() if one} == {
        name: one.__module__ for name, one in defined.items() if one
    }


def test_import_loads_only_standard_modules():
    assert not loaded_packages("import flexcam") & {"numpy", *HEAVY}
