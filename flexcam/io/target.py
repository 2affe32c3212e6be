"""Where files go: nothing is written over unless that was asked for."""

from __future__ import annotations

import os
import tempfile
from contextlib import suppress
from pathlib import Path

from flexcam.checks import refuse, said

_REMEDY = "overwrite it by --overwrite or overwrite=True"


def free_to_write(where: str, path: Path, *, overwrite: bool, remedy: str = _REMEDY) -> None:
    """Refuse a target that exists."""
    if path.is_symlink() and not path.exists():  # whose target it would make is not known
        remedy = "remove the link, or name another file"
        raise refuse(where, str(path), "a file that does not exist yet", _NOWHERE, remedy)
    if path.is_dir():
        raise refuse(where, str(path), "a file", "a folder stands there", "move it, or name another folder")
    if path.exists() and not overwrite:
        raise refuse(where, str(path), "a file that does not exist yet", "nothing is written over", remedy)
    if why := _barred(path.parent):
        raise refuse("folder", str(path.parent), _MADE, why, "name another")
    if (path.is_file() or not path.exists()) and not os.access(_nearest(path.parent), os.W_OK | os.X_OK):
        raise refuse("folder", str(path.parent), _TAKES, "it may not be written", "name another")


_MADE, _TAKES = "a folder that can be made", "a folder that takes files"
_NOWHERE = "a symbolic link stands there that leads nowhere"


def _nearest(folder: Path) -> Path:
    """Return a folder, or the nearest above it of what is there."""
    whole = folder.absolute()
    return next(one for one in (whole, *whole.parents) if os.path.lexists(one))


def _barred(folder: Path) -> str:
    """Return what stands in the place of a folder or of one above it; nothing for an empty text."""
    above = _nearest(folder)
    if above.is_dir():
        return ""
    return f"{above} is a symbolic link that leads nowhere" if above.is_symlink() else f"{above} is a file"


_OF_FILES = frozenset((
    ".h5", ".hdf5", ".vtkhdf", ".csv", ".parquet", ".toml", ".json", ".html", ".svg", ".png", ".pdf", ".pvd", ".vtp",
    ".dxf", ".msh", ".inp",
))  # fmt: skip


def named_as_folder(path: Path) -> Path:
    """Return the name of a folder for files that are named after something else, such as the case."""
    if path.suffix.lower() not in _OF_FILES or path.exists():
        return path
    allowed, why = "a folder", "its files have names of their own, after the case"
    raise refuse("folder", str(path), allowed, why, f"name a folder, such as -o {path.with_suffix('')}")


def made_folder(path: Path) -> Path:
    """Return a folder, made with its parents if it does not exist."""
    try:
        path.mkdir(parents=True, exist_ok=True)
    except OSError as fault:
        why = _barred(path) or said(fault)
        raise refuse("folder", str(path), _MADE, why, "name another with -o") from None
    return path


def takes_files(folder: Path) -> None:
    """Refuse a folder in which no file can be made, before anything is computed for it; nothing is left behind."""
    missing = [one for one in (folder, *folder.parents) if not one.exists()]
    try:
        with tempfile.TemporaryFile(dir=made_folder(folder)):
            pass
    except OSError as fault:
        why = said(fault)
        raise refuse("folder", str(folder), _TAKES, why, "name another with -o") from None
    finally:
        for one in missing:
            with suppress(OSError):
                one.rmdir()
