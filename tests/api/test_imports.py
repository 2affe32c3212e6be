"""What is loaded when: ``import flexcam`` nothing heavy, a small run no scipy, a command what it needs."""

from __future__ import annotations

import resource
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


def modules(code):
    """Return the modules that a fresh process has loaded after some code."""
    tail = "\nimport sys\nsys.stderr.write(' '.join(sys.modules))"
    done = subprocess.run([sys.executable, "-c", code + tail], capture_output=True, text=True, timeout=60)
    assert done.returncode == 0, done.stderr
    return set(done.stderr.split())


def loaded(code):
    """Return the packages of those modules."""
    return {name.partition(".")[0] for name in modules(code)}


def test_the_import_and_its_parts_load_only_numpy():
    parts = ("newmark()", "Material(E=1.0, nu=0.3, density=1.0)", "ConstantSpeed(1.0)", "LAWS['shm']",
             "Mesh([[0, 0, 0], [1, 0, 0]], {'a': [0, 1]}, {})")  # fmt: skip
    assert not loaded("\n".join(["import flexcam", *(f"flexcam.{part}" for part in parts)])) & HEAVY


READ = {"numpy", "pydantic", "pydantic_core", "annotated_types", "typing_extensions", "typing_inspection", "h5py"}
PRINT = {"cyclopts", "attr", "attrs", "rich", "tomli_w"}
TAYEB = str(ROOT / "cases/tayeb/model-3-shm.toml")
NOT_ASKED = {"flexcam.studies", "flexcam.plotting.figures", "flexcam.report.page"} | {
    f"flexcam.analysis.{name}"
    for name in ("cam_design", "campbell", "limits", "model_divergence", "orders", "selftest", "stability")
}
BUDGETS = {
    "help": (["--help"], READ | PRINT | {"docstring_parser"}, {"flexcam.plotting.figures"}),
    "run": (["run", str(CASE), "-o", "."], READ | PRINT, NOT_ASKED),
    "run on a mesh": (["run", TAYEB, "--set", "run.revolutions=0.1", "-o", "."], READ | PRINT | {"meshio"}, NOT_ASKED),
}
"""Words of a command, the packages it may load, and the modules of flexcam that it may not."""


@pytest.fixture(scope="module")
def before():
    """Return the packages that Python and its installation load by themselves."""
    return loaded("pass")


@pytest.mark.parametrize(("words", "packages", "modules_not_asked"), BUDGETS.values(), ids=BUDGETS)
def test_a_command_keeps_to_its_budget(words, packages, modules_not_asked, before, tmp_path, monkeypatch):
    """Start-up is most of a short run: 0.1 s for numpy, 0.6 s for scipy's solvers, 0.8 s for matplotlib."""
    monkeypatch.chdir(tmp_path)
    call = "from flexcam.__main__ import start\ntry:\n    start()\nexcept SystemExit as end:\n    assert not end.code"
    found = modules(f"import sys\nsys.argv = ['flexcam', *{words!r}]\n{call}")
    foreign = {name.partition(".")[0] for name in found} - before - sys.stdlib_module_names - {"flexcam"}
    assert "flexcam.cli.app" in found
    assert {name for name in foreign if not name.startswith(("_", "cython"))} <= packages
    assert not found & modules_not_asked


def test_the_file_of_every_command_is_known():
    """One that is not listed works, but loads the files of all commands."""
    load_commands(["--help"])
    listed = {name: f"flexcam.cli.{file}" for name, file in COMMAND_FILES.items()}
    defined = {name: app[name].default_command for name in app if not name.startswith("-")}
    assert set(listed) == set(defined)
    assert {name: listed[name] for name, one in defined.items() if one} == {
        name: one.__module__ for name, one in defined.items() if one
    }


def spent():
    """Return the processor's time in all processes that ended, s: what else the machine does counts for little."""
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


def cheapest(code, times=3):
    found = []
    for _ in range(times):
        before = spent()
        subprocess.run([sys.executable, "-c", code], check=True, timeout=60)
        found.append(spent() - before)
    return min(found)


def test_the_import_is_light():
    """Nothing but Python's own modules: a tenth of what numpy alone costs; 0.1 s leaves room for a slow machine."""
    assert cheapest("import flexcam") - cheapest("pass") < 0.1
