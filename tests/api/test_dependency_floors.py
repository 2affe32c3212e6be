"""The script that tests the minimum versions of dependencies covers all of pyproject.toml."""

import runpy
import tomllib
from pathlib import Path

ROOT = Path(__file__).parents[2]


def test_all_dependencies_have_pinned_minimum_version():
    pinned = dict(one.split("==") for one in runpy.run_path(str(ROOT / "tests/dependencies.py"))["floors"]())
    needed = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]["dependencies"]
    assert set(pinned) >= {one.partition(">=")[0] for one in needed} | {"asammdf", "distributed", "pytest", "sphinx"}
