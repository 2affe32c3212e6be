"""The commands: read, call, print. Nothing is computed here; each returns the status of its run, or None.

May import everything below the command line. A new command is a function in the file of its kind.
"""

from flexcam.commands import cams, cases, fidelity, files, laws, limits, settings, synthesize
from flexcam.commands.app import app, running

__all__ = ["app", "cams", "cases", "fidelity", "files", "laws", "limits", "running", "settings", "synthesize"]
