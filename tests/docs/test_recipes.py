"""Recipes for extensions of flexcam are applied to a copy of the tree: files, diffs and commands."""

import os
import shlex
import shutil
import subprocess
import sys

import pytest

from tests.docs.pages import PAGES, ROOT, assert_shown, blocks, changes_package, page_name, write_block

RECIPES = [page for page in PAGES if changes_package(page)]
COPIED_FOLDERS = ("cases", "docs", "flexcam", "meshes", "tests")
IGNORED_FILES = shutil.ignore_patterns("__pycache__", "*.png", "*.svg")


@pytest.fixture
def tree(tmp_path):
    """Return a copy of the folders that the recipes change and run."""
    for name in COPIED_FOLDERS:
        shutil.copytree(ROOT / name, tmp_path / name, ignore=IGNORED_FILES)
    shutil.copy(ROOT / "pyproject.toml", tmp_path)
    return tmp_path


def run_python(words, tree, given=None):
    """Run Python in the copy, with its flexcam before the installed one on the path."""
    environment = {**os.environ, "PYTHONPATH": str(tree)}
    return subprocess.run(
        [sys.executable, *words], cwd=tree, env=environment, input=given, capture_output=True, text=True, check=False
    )


def run_shell_block(text, tree):
    """Run the Python and flexcam commands of a block."""
    printed = ""
    for line in text.replace("\\\n", " ").splitlines():
        first, *words = shlex.split(line)
        done = run_python(words if first == "python" else ["-m", first, *words], tree)
        assert done.returncode == 0, f"{line}\n{done.stdout}\n{done.stderr}"
        printed += done.stdout
    return printed


@pytest.mark.parametrize("page", RECIPES, ids=page_name)
def test_recipe_diffs_apply_to_tree(page, tmp_path):
    for block in blocks(page):
        if block.caption:
            target = tmp_path / block.caption
            if (ROOT / block.caption).exists() and not target.exists():
                target.parent.mkdir(parents=True, exist_ok=True)
                shutil.copy(ROOT / block.caption, target)
            write_block(target, block)


@pytest.mark.slow
@pytest.mark.parametrize("page", RECIPES, ids=page_name)
def test_recipe_runs_as_shown(page, tree):
    printed = ""
    for block in blocks(page):
        where = f"{page.name}:{block.line}"
        if block.language == "text":
            assert_shown(block.text, printed, where)
        elif block.caption:
            write_block(tree / block.caption, block)
        elif block.language == "python":
            done = run_python(["-W", "error", "-"], tree, block.text)
            assert done.returncode == 0, f"{where}\n{done.stderr}"
            printed = done.stdout
        elif block.language == "sh":
            printed = run_shell_block(block.text, tree)


FILE_COUNTS = {  # new files of flexcam, changed files of flexcam, changed files of tests
    "add-a-force-law": (0, 5, 2), "add-a-law": (1, 1, 1), "add-an-element": (1, 2, 1), "add-an-integrator": (1, 2, 1),
    "add-an-output": (1, 1, 1),
}  # fmt: skip
"""Number of files that each recipe adds and changes."""


@pytest.mark.parametrize("page", RECIPES, ids=page_name)
def test_recipe_changes_stated_number_of_files(page):
    files = {block.caption for block in blocks(page) if block.caption.startswith(("flexcam/", "tests/"))}
    new = {name for name in files if not (ROOT / name).exists()}
    tests = {name for name in files if name.startswith("tests/")}
    assert (len(new), len(files - new - tests), len(tests)) == FILE_COUNTS[page.stem]


def test_all_recipes_have_file_counts():
    assert {page.stem for page in RECIPES} == set(FILE_COUNTS)
