"""The commands: read, call, print. Nothing is computed here; each returns the status of its run, or None.

May import `report` and everything below it.
A new command is a function in the file of its kind and a name in `FILES`; its tables are a file of `console`.
What it does not act on of a case is a row of `unused.UNUSED`, and so is told.
"""

from flexcam.commands.app import app, running
from flexcam.commands.registry import FILES, load

__all__ = ["FILES", "app", "load", "running"]
