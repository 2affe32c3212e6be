"""Recipes that add to flexcam, followed in a copy of the tree: files written, changes laid over, commands run there."""

from __future__ import annotations

import os
import shlex
import shutil
import subprocess
import sys

import pytest

from tests.docs.pages import PAGES, ROOT, adds, assert_shown, blocks, keep, name_of

RECIPES = [page for page in PAGES if adds(page)]
KEPT = ("cases", "docs", "flexcam", "meshes", "tests")
LEFT = shutil.ignore_patterns("__pycache__", "*.png", "*.svg")


@pytest.fixture
def tree(tmp_path):
    """Return a copy of what the recipes change and run."""
    for name in KEPT:
        shutil.copytree(ROOT / name, tmp_path / name, ignore=LEFT)
    shutil.copy(ROOT / "pyproject.toml", tmp_path)
    return tmp_path


def run(words, tree, given=None):
    """Run Python in the copy, whose flexcam goes before the one that is installed."""
    surroundings = {**os.environ, "PYTHONPATH": str(tree)}
    return subprocess.run(
        [sys.executable, *words], cwd=tree, env=surroundings, input=given, capture_output=True, text=True, check=False
    )


def shell(text, tree):
    """Run the commands of a block: Python's, and flexcam's."""
    printed = ""
    for line in text.replace("\\\n", " ").splitlines():
        first, *words = shlex.split(line)
        done = run(words if first == "python" else ["-m", first, *words], tree)
        assert done.returncode == 0, f"{line}\n{done.stdout}\n{done.stderr}"
        printed += done.stdout
    return printed


@pytest.mark.parametrize("page", RECIPES, ids=name_of)
def test_the_changes_of_a_recipe_fit_the_tree(page, tmp_path):
    for block in blocks(page):
        if block.caption:
            there = tmp_path / block.caption
            if (ROOT / block.caption).exists() and not there.exists():
                there.parent.mkdir(parents=True, exist_ok=True)
                shutil.copy(ROOT / block.caption, there)
            keep(there, block)


@pytest.mark.slow
@pytest.mark.parametrize("page", RECIPES, ids=name_of)
def test_recipe(page, tree):
    printed = ""
    for block in blocks(page):
        where = f"{page.name}:{block.line}"
        if block.language == "text":
            assert_shown(block.text, printed, where)
        elif block.caption:
            keep(tree / block.caption, block)
        elif block.language == "python":
            done = run(["-W", "error", "-"], tree, block.text)
            assert done.returncode == 0, f"{where}\n{done.stderr}"
            printed = done.stdout
        elif block.language == "sh":
            printed = shell(block.text, tree)


TOUCHED = {  # new files of flexcam, changed ones, changed ones of tests
    "add-a-force-law": (0, 5, 2), "add-a-law": (1, 1, 1), "add-an-element": (1, 2, 1), "add-an-integrator": (1, 2, 1),
    "add-an-output": (1, 1, 1),
}  # fmt: skip
"""Number of files that each recipe adds and changes."""


@pytest.mark.parametrize("page", RECIPES, ids=name_of)
def test_how_many_files_an_addition_touches(page):
    files = {block.caption for block in blocks(page) if block.caption.startswith(("flexcam/", "tests/"))}
    new = {name for name in files if not (ROOT / name).exists()}
    tests = {name for name in files if name.startswith("tests/")}
    assert (len(new), len(files - new - tests), len(tests)) == TOUCHED[page.stem]


def test_every_recipe_is_counted():
    assert {page.stem for page in RECIPES} == set(TOUCHED)
