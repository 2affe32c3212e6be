"""Public names of the package: snapshot, access, and functions that are not hidden by modules."""

# ruff: noqa: E501 - tables, a row to a line

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

import flexcam

NAMES = {
    "LAWS", "Case", "ConstantSpeed", "Damping", "FlexcamError", "InputError", "LiftEvent", "Material", "Member", "Mesh", "Model",
    "PointMass", "Problem", "Response", "Result", "RunFailedError", "SaveAt", "Section", "Status", "System", "build_model", "check_response", "compare",
    "generalized_alpha", "hht", "modes", "newmark", "prepare", "read_case", "read_mesh", "read_result", "run", "solve", "write_mesh",
}  # fmt: skip
"""Public interface; changes of it are in the changelog."""


def test_public_names_match_snapshot():
    assert set(flexcam.__all__) == NAMES
    assert len(flexcam.__all__) == len(NAMES) <= 40


def test_all_public_names_are_accessible():
    found = {name: getattr(flexcam, name) for name in NAMES}
    assert {getattr(value, "__name__", name) for name, value in found.items()} == NAMES
    assert [name for name, value in found.items() if hasattr(value, "__path__")] == [], "not modules"


def test_star_import_gives_public_names():
    space: dict[str, object] = {}
    exec("from flexcam import *", space)  # noqa: S102 - what users may write
    assert set(space) - {"__builtins__"} == NAMES


def test_dir_shows_public_names():
    assert set(dir(flexcam)) - {"__version__"} == NAMES


def test_unknown_name_raises_attribute_error():
    with pytest.raises(AttributeError, match="nosuch"):
        _ = flexcam.nosuch


FIRST = ["from flexcam.analysis.comparison import compare", "import flexcam.dynamics.solve"]


HIDDEN_NAMES = """
import os, sys, types
import numpy, h5py, pydantic  # what flexcam imports is imported once, and flexcam itself by each child anew
assert not [name for name in sys.modules if name.partition(".")[0] == "flexcam"]
for first in sys.argv[1:]:
    if not os.fork():
        exec(first)
        import flexcam
        hidden = [n for n in flexcam.__all__ if isinstance(getattr(flexcam, n), types.ModuleType)]
        called = (flexcam.run, flexcam.modes, flexcam.compare, flexcam.solve, flexcam.prepare)
        if hidden or not all(callable(one) for one in called):
            print(first, hidden, file=sys.stderr, flush=True)
        os._exit(0)
    if os.wait()[1]:
        print(first, "failed", file=sys.stderr, flush=True)
"""


@pytest.mark.parametrize("path", ["case.toml", Path("case.toml")])
@pytest.mark.parametrize("name", ["build_model", "check_response", "modes", "prepare", "run"])
def test_path_instead_of_case_is_refused(name, path):
    others = (None,) if name == "check_response" else ()
    with pytest.raises(flexcam.InputError, match=r"case: got 'case.toml', .*read_case\('case.toml'\)"):
        getattr(flexcam, name)(path, *others)


def test_modes_with_prestress_refuse_path():
    with pytest.raises(flexcam.InputError, match="read_case"):
        flexcam.modes("case.toml", prestress="rest")


def test_functions_are_not_hidden_by_modules():
    """An imported submodule becomes an attribute of its package and may hide a function of the same name."""
    done = subprocess.run([sys.executable, "-c", HIDDEN_NAMES, *FIRST], capture_output=True, text=True, timeout=60)
    assert (done.returncode, done.stderr) == (0, "")


def test_version_equals_package_metadata():
    from importlib.metadata import version

    assert flexcam.__version__ == version("flexcam")
