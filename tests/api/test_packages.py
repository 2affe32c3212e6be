"""Docstrings, imports and documentation pages of the twelve packages agree with the import contract."""

import ast
import importlib.util
import re
import tomllib
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
CONTRACTS = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["tool"]["importlinter"]["contracts"]
LAYERS = [re.findall(r"flexcam\.(\w+)", layer) for layer in CONTRACTS[0]["layers"]]
PACKAGES = [name for layer in LAYERS for name in layer if name != "__main__"]
MAX_LINES = 6
"""Maximum number of lines of a docstring, about three sentences."""


def docstring(package):
    text = (ROOT / "flexcam" / package / "__init__.py").read_text(encoding="utf-8")
    return ast.get_docstring(ast.parse(text)) or ""


def files(package):
    return list((ROOT / "flexcam" / package).rglob("*.py"))


def imported_packages(package):
    """Return the packages that the files of a package import at run time, anywhere in a file."""
    found = set()
    for path in files(package):
        tree = ast.parse(path.read_text(encoding="utf-8"))
        tree.body = [node for node in tree.body if not (isinstance(node, ast.If) and "TYPE_CHECKING" in ast.dump(node))]
        for node in ast.walk(tree):
            if isinstance(node, ast.ImportFrom) and (node.module or "").startswith("flexcam."):
                found.add(node.module.split(".")[1])
            elif isinstance(node, ast.ImportFrom) and node.module == "flexcam":
                found |= {name.name for name in node.names} & set(PACKAGES)
            elif isinstance(node, ast.Import):
                found |= {name.name.split(".")[1] for name in node.names if name.name.startswith("flexcam.")}
    return found - {package}


def lower_packages(package):
    at = next(i for i, layer in enumerate(LAYERS) if package in layer)
    return {other for layer in LAYERS[at + 1 :] for other in layer}


def allowed_packages(package):
    """Return the packages that a docstring names as allowed imports."""
    sentence = re.search(r"May import (.*?)(?:;|\.\s|\.$|\n\n|\Z)", docstring(package), re.S)
    return set(re.findall(r"`(\w+)`", sentence[1] if sentence else "")) & set(PACKAGES)


def test_contract_lists_all_packages():
    found = {
        path.stem for path in (ROOT / "flexcam").iterdir() if path.suffix == ".py" or (path / "__init__.py").exists()
    }
    assert found - {"__init__", "__main__"} == set(PACKAGES)
    assert len(PACKAGES) == 12


@pytest.mark.parametrize("package", PACKAGES)
def test_docstring_states_imports_and_extension_points(package):
    lines = [line for line in docstring(package).splitlines() if line.strip()]
    assert 2 < len(lines) <= MAX_LINES
    text = " ".join(lines)
    assert re.search(r"\b(May import|Imports no)\b", text)
    assert re.search(r"\b[Aa] new\b", text), "the docstring does not state where to add code"


@pytest.mark.parametrize("package", PACKAGES)
def test_imports_match_docstring_and_contract(package):
    named = allowed_packages(package)
    assert bool(named) == bool(lower_packages(package))
    assert named <= lower_packages(package)
    everything = re.search(r"everything\s+below", docstring(package))
    assert imported_packages(package) <= (lower_packages(package) if everything else named)


@pytest.mark.parametrize("package", PACKAGES)
def test_names_in_docstring_exist(package):
    known = {path.stem for path in files(package)} | {path.parent.name for path in files(package)} | set(PACKAGES)
    source = " ".join(path.read_text(encoding="utf-8") for path in files(package))
    for name in re.findall(r"`(\w+)`", docstring(package)):
        assert name in known or re.search(rf"\b(class|def|import) {name}\b|^{name}\b", source, re.M), name


ARCHITECTURE = (ROOT / "docs/architecture.md").read_text(encoding="utf-8")


def test_architecture_page_lists_packages_in_order():
    table = re.search(r"^\| level \| package \|.*?\n\|[-|]+\|\n(.*?)\n\n", ARCHITECTURE, re.S | re.M)[1]
    rows = [[cell.strip() for cell in line.strip("|").split("|")] for line in table.splitlines()]
    named = [re.fullmatch(r"`(\w+)`", row[1])[1] for row in rows]
    assert sorted(named) == sorted(PACKAGES)
    place = {package: len(LAYERS) - i for i, layer in enumerate(LAYERS) for package in layer}
    assert [int(row[0]) for row in rows] == [place[package] for package in named]
    assert [place[package] for package in named] == sorted((place[package] for package in named), reverse=True)


def test_architecture_page_lists_all_force_laws():
    table = re.search(r"^\| law \| function \|.*?\n\|[-|]+\|\n(.*?)\n\n", ARCHITECTURE, re.S | re.M)[1]
    named = re.findall(r"^\| `([A-Z_]+)` \| `(\w+)` \|", table, re.M)
    text = (ROOT / "flexcam/dynamics/force_laws.py").read_text(encoding="utf-8")
    assert named == re.findall(r"^    ([A-Z_]+): LawKind\(\s*\"(\w+)\"", text, re.M)


@pytest.mark.parametrize("page", ["docs/architecture.md", "CONTRIBUTING.md", "docs/release.md"])
def test_paths_in_developer_pages_exist(page):
    text = (ROOT / page).read_text(encoding="utf-8")
    for name in set(re.findall(r"`((?:[\w.-]+/)*[\w.-]+\.(?:py|toml|md|yaml|cff|j2))`", text)):
        places = [
            ROOT / name,
            ROOT / "flexcam" / name,
            *ROOT.glob(f"flexcam/**/{name}"),
            *ROOT.glob(f"tests/**/{name}"),
        ]
        assert any(path.exists() for path in places), name


def test_scripts_import_existing_names():
    """The examples run only when the pages are built, and the benchmarks on request."""
    missing = []
    for folder in ("examples", "docs", "benchmarks", "meshes"):
        for path in (ROOT / folder).rglob("*.py"):
            for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
                if isinstance(node, ast.ImportFrom) and (node.module or "").partition(".")[0] == "flexcam":
                    module = importlib.import_module(node.module)
                    names = [alias.name for alias in node.names]
                    missing += [f"{path.name}: {node.module}.{name}" for name in names if not has_name(module, name)]
    assert not missing


def has_name(module, name):
    is_package = hasattr(module, "__path__")
    return hasattr(module, name) or (is_package and importlib.util.find_spec(f"{module.__name__}.{name}") is not None)


def test_make_targets_in_pages_exist():
    known = set(re.findall(r"^([\w-]+):", (ROOT / "Makefile").read_text(encoding="utf-8"), re.M))
    for page in (*ROOT.glob("*.md"), *(ROOT / "docs").glob("*.md"), ROOT / ".pre-commit-config.yaml"):
        called = set(
            re.findall(
                r"\bmake ([a-z][\w-]+)", " ".join(re.findall(r"`[^`]*`|entry:.*", page.read_text(encoding="utf-8")))
            )
        )
        assert called <= known, page.name


def test_citation_version_equals_package_version():
    """The check of the wheel requires this."""
    cited = re.search(r"^version: (.+)$", (ROOT / "CITATION.cff").read_text(encoding="utf-8"), re.M)[1]
    assert cited == tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]["version"]
