"""Registry of commands by file, so that a command imports only its own file."""

from collections.abc import Sequence
from importlib import import_module

from flexcam.cli.app import run_state

COMMAND_FILES = {
    "cams": ("cam", "lift"),
    "cases": ("check", "modes"),
    "compare": ("compare",),
    "trade": ("trade",),
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
"""Files of this package and their commands."""


def load_commands(words: Sequence[str]) -> None:
    """Import the file of the given command, or all files for an unknown one, such as help."""
    run_state.command = words[0] if words else ""
    called = [file for file, commands in COMMAND_FILES.items() if words and words[0] in commands]
    for file in called or COMMAND_FILES:
        import_module(f"flexcam.cli.{file}")
