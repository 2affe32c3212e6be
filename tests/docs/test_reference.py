"""The reference of the site describes all public names and all commands."""

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
def reference():
    before = list(sys.path)
    yield runpy.run_path(str(DOCS / "extensions/reference.py"))
    sys.path[:] = before


@pytest.fixture(scope="module")
def pages(reference):
    return reference["module_pages"]()


def test_public_names_have_entries(pages):
    lacking = [name for name in flexcam.__all__ if not has_entry(pages["flexcam"], "flexcam", name)]
    assert not lacking


def has_entry(page, module, name):
    return any(line in page for line in (f":: {module}.{name}\n", f":: {name}\n   :module: {module}\n"))


def test_packages_have_pages(reference, pages):
    known = {m.name for m in pkgutil.iter_modules(flexcam.__path__)} - {"__main__"}
    assert known - reference["OWN"] <= set(pages)
    assert reference["OWN"] <= known
    assert all(f"<{page}>" in reference["module_index"]() for page in pages)


def test_modules_without_a_page_exist(reference):
    """A renamed module must be removed from the list."""
    for name in reference["INTERNAL"]:
        importlib.import_module(f"flexcam.{name}")


@pytest.mark.parametrize("package", [m.name for m in pkgutil.iter_modules(flexcam.__path__) if m.ispkg])
def test_names_of_package_are_described_or_linked(reference, pages, package):
    """A name on two pages is described on one of them and linked on the other."""
    if package in reference["OWN"]:
        return
    shown = [package, *reference["modules_of"](package)]
    assert any(reference["names_of"](importlib.import_module(f"flexcam.{name}")) for name in shown)
    homes = reference["homes"]()
    for page in shown:
        title = f"flexcam.{page}"
        module = importlib.import_module(title)
        for name in reference["names_of"](module):
            home = homes[id(getattr(module, name))]
            linked = home != f"{title}.{name}" and (
                f"   ~{home}\n" in pages[page] or not callable(getattr(module, name))
            )
            assert linked or has_entry(pages[page], title, name), f"{title}.{name}"


def test_commands_have_pages(reference):
    found = reference["command_pages"]()
    assert set(found) == set(COMMAND_FILES)
    for name, page in found.items():
        assert f"flexcam {name}" in page
        assert "--json" in page or name in ("new", "schema"), name


def test_bibliography_entries_are_cited():
    """A work that is no longer cited must be removed from the list."""
    entries = re.findall(r"^@\w+\{([\w-]+),\n  author = \{\{?([\w-]+(?: [a-z][\w-]+| Loan| Boor)?)", BIBLIOGRAPHY, re.M)
    assert len(entries) == BIBLIOGRAPHY.count("\n@")
    text = strip_accents(
        "\n".join(
            file.read_text(encoding="utf-8")
            for folder, kind in (("flexcam", "py"), ("tests", "py"), ("docs", "md"))
            for file in (DOCS.parent / folder).rglob(f"*.{kind}")
        )
    )
    assert not [key for key, author in entries if strip_accents(author) not in text]


def strip_accents(text):
    """Return a text without accents, since some names are written both with and without them."""
    return "".join(c for c in unicodedata.normalize("NFD", text) if not unicodedata.combining(c)).replace("ø", "o")
