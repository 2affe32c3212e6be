"""Generate pages of the reference from the code: one per package or module, and one per command."""

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
from flexcam.cli.app import COMMAND_FILES, COMMANDS, app
from flexcam.cli.main import load_commands

GROUPS = {
    "Start here": ("flexcam",),
    "Cases and files": ("case", "io"),
    "Cams": ("cams",),
    "Structures": ("fem",),
    "Equations and their solution": ("dynamics", "dynamics.force_laws", "core", "core.errors", "core.units"),
    "Valve trains": ("valvetrain",),
    "Analyses of a case": ("analysis",),
    "Many runs": ("studies", "io.sweep_table"),
    "Pictures and reports": ("plotting", "report"),
}
"""Packages by subject. A package without exported names also has a page per module, see `modules_of`."""

OWN = frozenset({"cli"})
"""Packages for commands only."""

INTERNAL = frozenset(
    {
        "case.cross_checks", "case.fault_report", "case.case",
        "plotting.rendering", "plotting.scene.mechanism", "plotting.scene.motion",
        "plotting.scene.parts", "plotting.scene.solids", "plotting.solid_files", "report.content",
        "report.fidelity_tables", "report.figures", "report.tables", "report.terminal",
    }
)  # fmt: skip
"""Modules without a page, for internal use of their package and the commands."""

INDEX = """API
===

All public names, package by package. The names of the first page are enough for most scripts. Import ``flexcam`` or a
package: ``from flexcam import dynamics``, ``from flexcam.cams import Polynomial``, ``from flexcam.fem.mesh import Mesh``.

"""


@cache
def modules_of(package: str) -> tuple[str, ...]:
    """Return the modules of a package with pages; none for a package with exported names."""
    module = module_of(package)
    if hasattr(module, "__all__") or not hasattr(module, "__path__"):
        return ()
    found = (m.name for m in pkgutil.walk_packages(module.__path__, f"{package}.") if not m.ispkg)
    return tuple(name for name in found if name not in INTERNAL and names_of(module_of(name)))


@cache
def groups() -> dict[str, tuple[str, ...]]:
    """Return the names of all pages by subject."""
    known = {name for names in GROUPS.values() for name in names}
    missing = {m.name for m in pkgutil.iter_modules(flexcam.__path__)} - known - OWN - {"__main__"}
    if missing:
        message = f"packages without a page of the reference: {sorted(missing)}"
        raise ValueError(message)
    return {
        title: tuple(page for name in names for page in (name, *modules_of(name))) for title, names in GROUPS.items()
    }


def pages() -> list[str]:
    """Return the names of all pages: packages and modules, without the leading ``flexcam.``."""
    return [name for names in groups().values() for name in names]


def module_of(name: str) -> ModuleType:
    return importlib.import_module("flexcam" if name == "flexcam" else f"flexcam.{name}")


def names_of(module: ModuleType) -> list[str]:
    """Return the public names of a package or module: ``__all__``, or else its own definitions."""
    if hasattr(module, "__all__"):
        return [name for name in module.__all__ if not inspect.ismodule(getattr(module, name))]
    own = {name: value for name, value in vars(module).items() if getattr(value, "__module__", None) == module.__name__}
    return sorted(name for name, value in own.items() if not name.startswith("_") and not isinstance(value, TypeVar))


def constant_text(module: ModuleType, name: str) -> str:
    """Return the docstring of a constant, in the file that defines it."""
    for source in (module.__name__, *(m for m in _files(module) if hasattr(importlib.import_module(m), name))):
        if lines := ModuleAnalyzer.for_module(source).find_attr_docs().get(("", name)):
            return " ".join(lines).strip()
    message = f"{module.__name__}.{name} has no docstring below it"
    raise ValueError(message)


def _files(module: ModuleType) -> list[str]:
    folders = [Path(folder) for folder in getattr(module, "__path__", [])]
    if module is flexcam:
        return [f"flexcam.{name}" for name in flexcam._MODULES] + _files(importlib.import_module("flexcam.cams"))
    return [f"{module.__name__}.{file.stem}" for folder in folders for file in sorted(folder.glob("[!_]*.py"))]


def entry(module: ModuleType, name: str) -> str:
    """Return the directive that documents one name."""
    value, full = getattr(module, name), f"{module.__name__}.{name}"
    if inspect.isclass(value):
        return f".. autoclass:: {full}\n   :members:\n"
    if inspect.isroutine(value):
        return f".. autofunction:: {full}\n"
    return f".. py:data:: {name}\n   :module: {module.__name__}\n\n   {constant_text(module, name)}\n"


@cache
def homes() -> dict[int, str]:
    """Return the full name of each public object on its first page, by the id of the object."""
    found: dict[int, str] = {}
    for page in pages():
        module = module_of(page)
        for name in names_of(module):
            found.setdefault(id(getattr(module, name)), f"{module.__name__}.{name}")
    return found


def module_page(page: str, entries: dict[int, str]) -> str:
    """Return a page: docstring of the module, table of its names, and the entries of names without an earlier one."""
    module = module_of(page)
    title, names = module.__name__, names_of(module)
    full = {name: entries[id(getattr(module, name))] for name in names}
    own = [name for name in names if full[name] == f"{title}.{name}"]
    calls = [
        name for name in names if inspect.isclass(getattr(module, name)) or inspect.isroutine(getattr(module, name))
    ]
    lines = [title, "=" * len(title), "", f".. automodule:: {title}", "   :no-members:", ""]
    lines += [f"* :doc:`flexcam.{name} <{name}>`" for name in modules_of(page)]
    if calls:
        lines += [".. autosummary::", "", *(f"   {n if n in own else '~' + full[n]}" for n in calls), ""]
    return "\n".join(lines + [entry(module, name) for name in own])


def module_pages() -> dict[str, str]:
    """Return all pages of packages and modules by name."""
    entries = homes()
    return {page: module_page(page, entries) for page in pages()}


def module_index() -> str:
    parts = [
        f".. toctree::\n   :caption: {title}\n\n   " + "\n   ".join(f"{page} <{page}>" for page in names)
        for title, names in groups().items()
    ]
    return INDEX + "\n\n".join(parts) + "\n"


def command_page(name: str, app: App) -> str:
    """Return the help of a command as a page."""
    text = generate_rst_docs(app, command_chain=["flexcam", name], generate_toc=False)
    usage, _, rest = text.partition("::\n")[2].strip().partition("\n")
    usage = re.sub(r" -m \S+", "", usage.strip())  # cyclopts includes the Python option -m in the usage
    title, examples = f"flexcam {name}", (app.help_prologue or "").strip().splitlines()
    block = [".. code-block:: text", "", f"   {usage}", ""]
    if examples:
        block += [".. code-block:: sh", "", *(f"   {line}" for line in examples), ""]
    return "\n".join([title, "=" * len(title), "", *block, rest.strip(), ""])


def command_pages() -> dict[str, str]:
    load_commands([])
    return {name: command_page(name, app[name]) for name in COMMAND_FILES}


def command_list() -> str:
    """Return a Markdown table of all commands, as in ``flexcam --help``."""
    lines = ["| command | |", "|---|---|"]
    for panel, commands in COMMANDS.items():
        lines.append(f"| **{panel}** | |")
        lines += [f"| {{doc}}`{name} <commands/{name}>` | {purpose(app[name])} |" for name in commands]
    return "\n".join([*lines, ""])


def purpose(command: App) -> str:
    """Return the first sentence of a command's help."""
    sentence = " ".join((command.help or "").split("\n\n")[0].split())
    return sentence.replace("``", "`").replace("|", "\\|")


def write(folder: Path, pages: dict[str, str]) -> None:
    """Write changed pages and remove old ones; Sphinx reads unchanged files only once."""
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
    write(reference / "api", module_pages() | {"index": module_index()})
    write(reference / "commands", command_pages())
    (reference / "commands/list.inc").write_text(command_list(), encoding="utf-8")


def setup(app: Sphinx) -> dict[str, bool]:
    app.connect("builder-inited", write_pages)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
