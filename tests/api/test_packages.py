"""The twelve packages: their docstrings, imports, and the pages about them agree with the code and the contract."""

from __future__ import annotations

import ast
import re
import tomllib
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
CONTRACTS = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["tool"]["importlinter"]["contracts"]
LAYERS = [re.findall(r"flexcam\.(\w+)", layer) for layer in CONTRACTS[0]["layers"]]
PACKAGES = [name for layer in LAYERS for name in layer if name != "__main__"]
LONGEST = 6
"""Lines of a docstring: about three sentences."""


def docstring(package):
    text = (ROOT / "flexcam" / package / "__init__.py").read_text(encoding="utf-8")
    return ast.get_docstring(ast.parse(text)) or ""


def files(package):
    return list((ROOT / "flexcam" / package).rglob("*.py"))


def imported(package):
    """Return the packages that the files of a package import, wherever in the file."""
    found = set()
    for path in files(package):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.ImportFrom) and (node.module or "").startswith("flexcam."):
                found.add(node.module.split(".")[1])
            elif isinstance(node, ast.ImportFrom) and node.module == "flexcam":
                found |= {name.name for name in node.names} & set(PACKAGES)
            elif isinstance(node, ast.Import):
                found |= {name.name.split(".")[1] for name in node.names if name.name.startswith("flexcam.")}
    return found - {package}


def below(package):
    at = next(i for i, layer in enumerate(LAYERS) if package in layer)
    return {other for layer in LAYERS[at + 1 :] for other in layer}


def allowed(package):
    """Return the packages that a docstring names where it says what may be imported."""
    sentence = re.search(r"May import (.*?)(?:;|\.\s|\.$|\n\n|\Z)", docstring(package), re.S)
    return set(re.findall(r"`(\w+)`", sentence[1] if sentence else "")) & set(PACKAGES)


def test_every_file_and_folder_of_flexcam_belongs_to_a_package():
    found = {
        path.stem for path in (ROOT / "flexcam").iterdir() if path.suffix == ".py" or (path / "__init__.py").exists()
    }
    assert found - {"__init__", "__main__"} == set(PACKAGES)
    assert len(PACKAGES) == 12


@pytest.mark.parametrize("package", PACKAGES)
def test_a_package_describes_itself_its_imports_and_where_to_add(package):
    lines = [line for line in docstring(package).splitlines() if line.strip()]
    assert 2 < len(lines) <= LONGEST
    text = " ".join(lines)
    assert re.search(r"\b(May import|Imports no)\b", text)
    assert re.search(r"\b[Aa] new\b", text), "where to add things"


@pytest.mark.parametrize("package", PACKAGES)
def test_a_package_imports_what_its_docstring_allows_and_only_from_below(package):
    named = allowed(package)
    assert bool(named) == bool(below(package))
    assert named <= below(package)
    everything = re.search(r"everything\s+below", docstring(package))
    assert imported(package) <= (below(package) if everything else named)


@pytest.mark.parametrize("package", PACKAGES)
def test_names_in_the_docstring_of_a_package_exist(package):
    known = {path.stem for path in files(package)} | {path.parent.name for path in files(package)} | set(PACKAGES)
    source = " ".join(path.read_text(encoding="utf-8") for path in files(package))
    for name in re.findall(r"`(\w+)`", docstring(package)):
        assert name in known or re.search(rf"\b(class|def|import) {name}\b|^{name}\b", source, re.M), name


ARCHITECTURE = (ROOT / "docs/architecture.md").read_text(encoding="utf-8")


def test_the_architecture_page_lists_all_packages_in_the_order_of_the_contract():
    table = re.search(r"^\| level \| package \|.*?\n\|[-|]+\|\n(.*?)\n\n", ARCHITECTURE, re.S | re.M)[1]
    rows = [[cell.strip() for cell in line.strip("|").split("|")] for line in table.splitlines()]
    named = [re.fullmatch(r"`(\w+)`", row[1])[1] for row in rows]
    assert sorted(named) == sorted(PACKAGES)
    place = {package: len(LAYERS) - i for i, layer in enumerate(LAYERS) for package in layer}
    assert [int(row[0]) for row in rows] == [place[package] for package in named]
    assert [place[package] for package in named] == sorted((place[package] for package in named), reverse=True)


def test_the_architecture_page_has_every_force_law():
    """A row per law of the table, in its order."""
    table = re.search(r"^\| law \| function \|.*?\n\|[-|]+\|\n(.*?)\n\n", ARCHITECTURE, re.S | re.M)[1]
    named = re.findall(r"^\| `([A-Z_]+)` \| `(\w+)` \|", table, re.M)
    text = (ROOT / "flexcam/dynamics/force_laws.py").read_text(encoding="utf-8")
    assert named == re.findall(r"^    ([A-Z_]+): LawKind\(\s*\"(\w+)\"", text, re.M)


@pytest.mark.parametrize("page", ["docs/architecture.md", "CONTRIBUTING.md", "docs/release.md"])
def test_paths_that_pages_for_developers_name_exist(page):
    text = (ROOT / page).read_text(encoding="utf-8")
    for name in set(re.findall(r"`((?:[\w.-]+/)*[\w.-]+\.(?:py|toml|md|yaml|cff|j2))`", text)):
        places = [
            ROOT / name,
            ROOT / "flexcam" / name,
            *ROOT.glob(f"flexcam/**/{name}"),
            *ROOT.glob(f"tests/**/{name}"),
        ]
        assert any(path.exists() for path in places), name


def test_make_targets_that_the_pages_name_exist():
    known = set(re.findall(r"^([\w-]+):", (ROOT / "Makefile").read_text(encoding="utf-8"), re.M))
    for page in (*ROOT.glob("*.md"), *(ROOT / "docs").glob("*.md"), ROOT / ".pre-commit-config.yaml"):
        called = set(
            re.findall(
                r"\bmake ([a-z][\w-]+)", " ".join(re.findall(r"`[^`]*`|entry:.*", page.read_text(encoding="utf-8")))
            )
        )
        assert called <= known, page.name


def test_one_version():
    """As the check of the wheel asks."""
    cited = re.search(r"^version: (.+)$", (ROOT / "CITATION.cff").read_text(encoding="utf-8"), re.M)[1]
    assert cited == tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]["version"]
