"""What rooms say of themselves is true, and what pages say of them: what each is, imports, and where to add things."""

from __future__ import annotations

import ast
import re
import tomllib
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
CONTRACTS = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["tool"]["importlinter"]["contracts"]
LAYERS = [re.findall(r"flexcam\.(\w+)", layer) for layer in CONTRACTS[0]["layers"]]
ROOMS = [room for layer in LAYERS for room in layer]
PACKAGES = [room for room in ROOMS if (ROOT / "flexcam" / room / "__init__.py").exists()]
LONGEST = 6
"""Lines of a docstring: about three sentences."""


def docstring(room):
    package, module = ROOT / "flexcam" / room / "__init__.py", ROOT / "flexcam" / f"{room}.py"
    return ast.get_docstring(ast.parse((package if package.exists() else module).read_text(encoding="utf-8"))) or ""


def files(room):
    folder = ROOT / "flexcam" / room
    return list(folder.rglob("*.py")) if folder.is_dir() else [folder.with_suffix(".py")]


def imported(room):
    """Return the rooms that the files of a room import, wherever in the file."""
    found = set()
    for path in files(room):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.ImportFrom) and (node.module or "").startswith("flexcam."):
                found.add(node.module.split(".")[1])
    return found - {room}


def below(room):
    at = next(i for i, layer in enumerate(LAYERS) if room in layer)
    return {other for layer in LAYERS[at + 1 :] for other in layer}


def named(room):
    """Return the rooms that a docstring names where it says what may be imported."""
    sentence = re.search(r"(?:[Mm]ay import|[Ii]mports) (.*?)(?:;|\.\s|\.$|\n\n|\Z)", docstring(room), re.S)
    return set(re.findall(r"`(\w+)`", sentence[1] if sentence else "")) & set(ROOMS)


def test_every_file_of_the_package_belongs_to_a_room():
    found = {
        path.stem for path in (ROOT / "flexcam").iterdir() if path.suffix == ".py" or (path / "__init__.py").exists()
    }
    assert found - {"__init__"} == set(ROOMS)


@pytest.mark.parametrize("room", PACKAGES)
def test_a_room_says_what_it_is_what_it_may_import_and_where_to_add(room):
    lines = [line for line in docstring(room).splitlines() if line.strip()]
    assert 2 < len(lines) <= LONGEST
    text = " ".join(lines)
    assert re.search(r"\b([Mm]ay import|[Ii]mports)\b", text)
    assert re.search(r"\b([Nn]ew|[Aa]nother)\b", text), "where to add things"


@pytest.mark.parametrize("room", PACKAGES)
def test_a_room_imports_what_it_says_and_only_from_below(room):
    says = named(room)
    assert says
    assert says <= below(room)
    everything = re.search(r"(everything|what is)\s+below", docstring(room))
    assert imported(room) <= (below(room) if everything else says)


@pytest.mark.parametrize("room", PACKAGES)
def test_files_that_a_room_names_exist(room):
    known = {path.stem for path in files(room)} | {path.parent.name for path in files(room)} | set(ROOMS)
    source = " ".join(path.read_text(encoding="utf-8") for path in files(room))
    for name in re.findall(r"`(\w+)`", docstring(room)):
        assert name in known or re.search(rf"\b(class|def|import) {name}\b|^{name}\b", source, re.M), name


ARCHITECTURE = (ROOT / "docs/architecture.md").read_text(encoding="utf-8")


def test_the_page_of_the_architecture_has_every_room_in_the_order_of_the_contract():
    table = re.search(r"^\| room \|.*?\n\|[-|]+\|\n(.*?)\n\n", ARCHITECTURE, re.S | re.M)[1]
    rows = [re.findall(r"`(\w+)`", line.split("|")[1]) for line in table.splitlines()]
    told = [room for row in rows for room in row]
    assert sorted(told) == sorted(room for room in ROOMS if room != "__main__")
    place = {room: i for i, layer in enumerate(LAYERS) for room in layer}
    assert [place[room] for room in told] == sorted(place[room] for room in told)


@pytest.mark.parametrize("page", ["docs/architecture.md", "CONTRIBUTING.md", "docs/release.md"])
def test_paths_that_the_pages_of_the_house_name_exist(page):
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
