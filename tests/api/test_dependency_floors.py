"""The script that runs the suite with the lowest dependencies pins every floor of pyproject.toml."""

import importlib.metadata
import runpy
from pathlib import Path

SCRIPT = Path(__file__).parents[1] / "dependencies.py"


def test_every_dependency_has_a_floor_that_is_pinned():
    pinned = dict(one.split("==") for one in runpy.run_path(str(SCRIPT))["floors"]())
    assert {"numpy", "scipy", "numba", "asammdf", "sphinx", "pytest"} <= set(pinned)
    named = importlib.metadata.requires("flexcam") or []
    plain = {one.split(">=")[0] for one in named if ";" not in one}
    assert plain <= set(pinned)
