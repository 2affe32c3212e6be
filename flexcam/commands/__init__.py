"""The commands: read, call, print. Nothing is computed here; each returns the status of its run, or None.

May import `report` and everything below it.
A new command is a function in the file of its kind and a name in `FILES`; its tables are a file of `console`.
What it does not act on of a case is a row of `unused.UNUSED`, and so is told.
"""

from collections.abc import Sequence
from importlib import import_module

from flexcam.commands.app import app, running

__all__ = ["FILES", "app", "load", "running"]

FILES = {
    "cams": ("cam", "lift"),
    "cases": ("check", "modes"),
    "compare": ("compare",),
    "fidelity": ("trade",),
    "files": ("export", "info", "schema"),
    "laws": ("law", "laws"),
    "limits": ("limits", "parting", "stability"),
    "new": ("new",),
    "plot": ("plot",),
    "report": ("report",),
    "run": ("run",),
    "selftest": ("selftest",),
    "settings": ("settings",),
    "speeds": ("campbell", "orders"),
    "studies": ("sensitivity", "optimize"),
    "sweep": ("sweep",),
    "synthesize": ("synthesize",),
    "view": ("view",),
}
"""Files of this room and the commands that each defines."""


def load(words: Sequence[str]) -> None:
    """Load the file of the command that is called, or all of them where none is known by that name, as for help."""
    running.command = words[0] if words else ""
    called = [file for file, commands in FILES.items() if words and words[0] in commands]
    for file in called or FILES:
        import_module(f"flexcam.commands.{file}")
