"""The reference of the site tells every public name and every command."""

from __future__ import annotations

import importlib
import pkgutil
import re
import runpy
import sys
import unicodedata
from pathlib import Path

import pytest

import flexcam
from flexcam.cli.app import COMMAND_FILES

DOCS = Path(__file__).parents[2] / "docs"
BIBLIOGRAPHY = (DOCS / "references.bib").read_text(encoding="utf-8")


@pytest.fixture(scope="module")
def made():
    before = list(sys.path)
    yield runpy.run_path(str(DOCS / "extensions/reference.py"))
    sys.path[:] = before


@pytest.fixture(scope="module")
def pages(made):
    return made["module_pages"]()


def test_every_public_name_has_an_entry(pages):
    lacking = [name for name in flexcam.__all__ if not told(pages["flexcam"], "flexcam", name)]
    assert not lacking


def told(page, module, name):
    return any(line in page for line in (f":: {module}.{name}\n", f":: {name}\n   :module: {module}\n"))


def test_every_package_has_a_page(made, pages):
    known = {m.name for m in pkgutil.iter_modules(flexcam.__path__)} - {"__main__"}
    assert known - made["OWN"] <= set(pages)
    assert made["OWN"] <= known
    assert all(f"<{page}>" in made["module_index"]() for page in pages)


def test_modules_without_a_page_exist(made):
    """A module that is renamed leaves the list."""
    for name in made["INTERNAL"]:
        importlib.import_module(f"flexcam.{name}")


@pytest.mark.parametrize("package", [m.name for m in pkgutil.iter_modules(flexcam.__path__) if m.ispkg])
def test_every_name_of_a_package_is_described_or_linked(made, pages, package):
    """A name that two pages have is described on one and linked on the other."""
    if package in made["OWN"]:
        return
    shown = [package, *made["modules_of"](package)]
    assert any(made["names_of"](importlib.import_module(f"flexcam.{name}")) for name in shown)
    homes = made["homes"]()
    for page in shown:
        title = f"flexcam.{page}"
        module = importlib.import_module(title)
        for name in made["names_of"](module):
            home = homes[id(getattr(module, name))]
            linked = home != f"{title}.{name}" and (
                f"   ~{home}\n" in pages[page] or not callable(getattr(module, name))
            )
            assert linked or told(pages[page], title, name), f"{title}.{name}"


def test_every_command_has_a_page(made):
    found = made["command_pages"]()
    assert set(found) == set(COMMAND_FILES)
    for name, page in found.items():
        assert f"flexcam {name}" in page
        assert "--json" in page or name in ("new", "schema"), name


def test_every_source_is_named_somewhere():
    """A work that nothing draws on any more leaves the list."""
    entries = re.findall(r"^@\w+\{([\w-]+),\n  author = \{\{?([\w-]+(?: [a-z][\w-]+| Loan| Boor)?)", BIBLIOGRAPHY, re.M)
    assert len(entries) == BIBLIOGRAPHY.count("\n@")
    text = plain(
        "\n".join(
            file.read_text(encoding="utf-8")
            for folder, kind in (("flexcam", "py"), ("tests", "py"), ("docs", "md"))
            for file in (DOCS.parent / folder).rglob(f"*.{kind}")
        )
    )
    assert not [key for key, author in entries if plain(author) not in text]


def plain(text):
    """Return a text without accents, with which names are written in one place and without them in another."""
    return "".join(c for c in unicodedata.normalize("NFD", text) if not unicodedata.combining(c)).replace("ø", "o")
