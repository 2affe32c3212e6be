"""Write the pages of the reference that follow from the code: one per room with its public names, one per command."""

from __future__ import annotations

import importlib
import inspect
import pkgutil
import re
from functools import cache
from pathlib import Path
from types import ModuleType
from typing import TypeVar

from cyclopts import App
from cyclopts.docs.rst import generate_rst_docs
from sphinx.application import Sphinx
from sphinx.pycode import ModuleAnalyzer

import flexcam
from flexcam.cli.app import app
from flexcam.cli.registry import FILES, load

ROOMS = {
    "The easy door": ("flexcam", "runner", "starting", "response"),
    "Cases, results, units": ("case", "io", "units", "checks"),
    "Laws and cams": ("motion", "cam", "synthesis", "cams", "design"),
    "Structures and their equations": (
        "fem",
        "fem.elements.beam",
        "fem.elements.bending",
        "fem.elements.axial",
        "system",
        "train",
        "linalg",
    ),
    "Solving": ("integrate", "modal"),
    "Questions to a case": ("fidelity", "limits", "parting", "stability", "orders", "budget", "reopened", "checkpoint"),
    "Many runs": ("sweep", "study"),
    "Pictures and reports": ("view", "scene", "report"),
}
"""Rooms by what they are for; what is not named here stands under Others."""

OWN = frozenset({"__main__", "cli", "commands", "console", "terminal"})
"""The command line's own, which are reached by commands."""

INDEX = """API
===

Everything that is public, room by room. The names of the first page are enough for most scripts; the others are the parts
behind them. What is imported is ``flexcam`` or a room: ``from flexcam import fem``, ``from flexcam.cams import Polynomial``.

"""


def groups() -> dict[str, tuple[str, ...]]:
    """Return all rooms by what they are for."""
    named = {room for some in ROOMS.values() for room in some}
    others = tuple(m.name for m in pkgutil.iter_modules(flexcam.__path__) if m.name not in named | OWN)
    return ROOMS | ({"Others": others} if others else {})


def rooms() -> list[str]:
    return [room for some in groups().values() for room in some]


def module_of(room: str) -> ModuleType:
    return importlib.import_module("flexcam" if room == "flexcam" else f"flexcam.{room}")


def names_of(module: ModuleType) -> list[str]:
    """Return the public names of a room: ``__all__``, or what a file of one's own defines."""
    if hasattr(module, "__all__"):
        return [name for name in module.__all__ if not inspect.ismodule(getattr(module, name))]
    own = {name: value for name, value in vars(module).items() if getattr(value, "__module__", None) == module.__name__}
    return sorted(name for name, value in own.items() if not name.startswith("_") and not isinstance(value, TypeVar))


def words_of(module: ModuleType, name: str) -> str:
    """Return the text below a constant, in the file that defines it."""
    for known in (module.__name__, *(m for m in _files(module) if hasattr(importlib.import_module(m), name))):
        if words := ModuleAnalyzer.for_module(known).find_attr_docs().get(("", name)):
            return " ".join(words).strip()
    message = f"{module.__name__}.{name} has no words below it"
    raise ValueError(message)


def _files(module: ModuleType) -> list[str]:
    folders = [Path(folder) for folder in getattr(module, "__path__", [])]
    if module is flexcam:
        return [f"flexcam.{room}" for room in flexcam._ROOMS] + _files(importlib.import_module("flexcam.cams"))
    return [f"{module.__name__}.{file.stem}" for folder in folders for file in sorted(folder.glob("[!_]*.py"))]


def entry(module: ModuleType, name: str) -> str:
    """Return the directive that documents one name."""
    value, full = getattr(module, name), f"{module.__name__}.{name}"
    if inspect.isclass(value):
        return f".. autoclass:: {full}\n   :members:\n"
    if inspect.isroutine(value):
        return f".. autofunction:: {full}\n"
    return f".. py:data:: {name}\n   :module: {module.__name__}\n\n   {words_of(module, name)}\n"


@cache
def homes() -> dict[int, str]:
    """Return where each public object is told, by its id: by the first room that hands it on."""
    told: dict[int, str] = {}
    for room in rooms():
        module = module_of(room)
        for name in names_of(module):
            told.setdefault(id(getattr(module, name)), f"{module.__name__}.{name}")
    return told


def room_page(room: str, told: dict[int, str]) -> str:
    """Return the page of a room: its purpose, a table of its names, and each name that is told here."""
    module = module_of(room)
    title, names = module.__name__, names_of(module)
    full = {name: told[id(getattr(module, name))] for name in names}
    own = [name for name in names if full[name] == f"{title}.{name}"]
    calls = [
        name for name in names if inspect.isclass(getattr(module, name)) or inspect.isroutine(getattr(module, name))
    ]
    lines = [title, "=" * len(title), "", f".. automodule:: {title}", "   :no-members:", ""]
    lines += [".. autosummary::", "", *(f"   {n if n in own else '~' + full[n]}" for n in calls), ""]
    return "\n".join(lines + [entry(module, name) for name in own])


def room_pages() -> dict[str, str]:
    told = homes()
    return {room: room_page(room, told) for room in rooms()}


def room_index() -> str:
    parts = [
        f".. toctree::\n   :caption: {title}\n\n   " + "\n   ".join(f"{room} <{room}>" for room in some)
        for title, some in groups().items()
    ]
    return INDEX + "\n\n".join(parts) + "\n"


def command_page(name: str, app: App) -> str:
    """Return what ``flexcam NAME --help`` says, as a page."""
    told = generate_rst_docs(app, command_chain=["flexcam", name], generate_toc=False)
    usage, _, rest = told.partition("::\n")[2].strip().partition("\n")
    usage = re.sub(r" -m \S+", "", usage.strip())  # cyclopts takes how Python was started for a part of the usage
    title, examples = f"flexcam {name}", (app.help_prologue or "").strip().splitlines()
    block = [".. code-block:: text", "", f"   {usage}", ""]
    if examples:
        block += [".. code-block:: sh", "", *(f"   {line}" for line in examples), ""]
    return "\n".join([title, "=" * len(title), "", *block, rest.strip(), ""])


def command_pages() -> dict[str, str]:
    load([])
    known = sorted(name for names in FILES.values() for name in names)
    return {name: command_page(name, app[name]) for name in known}


def command_list() -> str:
    """Return all commands with what they do, as ``flexcam --help`` lists them, in Markdown."""
    rows = [f"| {{doc}}`{name} <commands/{name}>` | {purpose(app[name])} |" for name in command_pages()]
    return "\n".join(["| command | |", "|---|---|", *rows, ""])


def purpose(command: App) -> str:
    """Return the first sentence of a command's help."""
    said = " ".join((command.help or "").split("\n\n")[0].split())
    return said.replace("``", "`").replace("|", "\\|")


def write(folder: Path, pages: dict[str, str]) -> None:
    """Write pages, leaving those alone that have not changed, so that Sphinx need not read them again."""
    folder.mkdir(exist_ok=True)
    for old in folder.glob("*.rst"):
        if old.stem not in pages:
            old.unlink()
    for name, text in pages.items():
        file = folder / f"{name}.rst"
        if not file.exists() or file.read_text(encoding="utf-8") != text:
            file.write_text(text, encoding="utf-8")


def write_pages(app: Sphinx) -> None:
    reference = Path(app.srcdir) / "reference"
    write(reference / "api", room_pages() | {"index": room_index()})
    write(reference / "commands", command_pages())
    (reference / "commands/list.inc").write_text(command_list(), encoding="utf-8")


def setup(app: Sphinx) -> dict[str, bool]:
    app.connect("builder-inited", write_pages)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
