"""Checks of input and output paths: regular files of a plausible size, files named in a case, and output folders."""

from __future__ import annotations

import os
import tempfile
from contextlib import suppress
from pathlib import Path
from stat import S_ISREG

from flexcam.core.errors import refuse, system_message

_MAX_TEXT_SIZE = 1 << 28
"""Maximum size of a text file read into memory, bytes."""


def file_size(path: Path) -> int:
    """Return the size of a regular file; devices and pipes are rejected because reading them may never end."""
    found = path.stat()
    if not S_ISREG(found.st_mode):
        raise OSError("a folder, a device or a pipe stands there")
    return found.st_size


def read_text(path: Path, encoding: str = "utf-8-sig") -> str:
    """Return the text of a file."""
    size = file_size(path)
    if size > _MAX_TEXT_SIZE:
        raise OSError(f"it has {size} bytes, more than any such file")
    return path.read_text(encoding=encoding)


def read_lines(path: Path) -> list[str]:
    """Return the lines of a file as counted by a text editor.

    Only the line endings of Unix, Windows and old Macs count: `str.splitlines` also splits at characters such as
    U+0085 and U+2028, which would shift the reported line numbers.
    """
    return read_text(path).split("\n")  # universal newlines convert all three endings


_MAX_PARENTS = 2
"""Number of parent folders of a case in which files may lie: ``cases/engine/a.toml`` finds ``meshes/a.msh``."""

ALLOWED_FOLDERS_VARIABLE = "FLEXCAM_FILES"
"""Environment variable with further allowed folders, separated as in PATH."""

_MAX_FILE_SIZE = 1 << 30
"""Maximum size of a file read into memory, bytes."""


def find_referenced_file(case: Path, name: str) -> Path | None:
    """Return the file named by a string of a case, in any folder; None if the string is not a file name."""
    try:
        path = _base_folder(case, name) / name
        return path if path.is_file() else None
    except (OSError, ValueError):  # not a valid file name
        return None


def _base_folder(case: Path, name: str) -> Path:
    """Return the folder to which a name in a case is relative."""
    folders = _search_folders(case)
    return next((one for one in folders if (one / name).exists()), folders[0])


def _search_folders(case: Path) -> list[Path]:
    """Return the folders searched for names in a case, in order."""
    return [case.parent, case.resolve().parent] if case.is_symlink() else [case.parent]


def resolve_file(case: Path, name: str, where: str) -> Path:
    """Return the path of a file named in a case."""
    try:
        folder = _base_folder(case, name)
        path = folder / name
        target, home = path.resolve(), folder.resolve()
        there, regular = path.exists(), path.is_file()
        size = path.stat().st_size if regular else 0
    except (OSError, ValueError, RuntimeError) as fault:
        raise refuse(where, repr(name), "the path of a file", system_message(fault)) from None
    besides = [Path(one).resolve() for one in os.environ.get(ALLOWED_FOLDERS_VARIABLE, "").split(os.pathsep) if one]
    if not any(
        target.is_relative_to(one) for one in [home.parents[:_MAX_PARENTS][-1] if home.parents else home, *besides]
    ):
        allowed = "a file in the case's folder, up to two folders above it, or below these"
        why = "a case from elsewhere must not open any file"
        raise refuse(where, repr(name), allowed, why, f"move it, or name its folder in {ALLOWED_FOLDERS_VARIABLE}")
    if there and not regular:
        raise refuse(where, repr(name), "a regular file", "a folder or a device is none")
    if size > _MAX_FILE_SIZE:
        raise refuse(where, f"{name!r} of {size} bytes", f"up to {_MAX_FILE_SIZE} bytes", "it is read as a whole")
    if not there and len(tried := _search_folders(case)) > 1:
        allowed, why = f"a file from {tried[0]} or from {tried[1]}", f"{case} is a symbolic link, and neither has it"
        raise refuse(where, repr(name), allowed, why, "put it beside the link or beside the case")
    return path


_REMEDY = "overwrite it by --overwrite or overwrite=True"


def check_writable(where: str, path: Path, *, overwrite: bool, remedy: str = _REMEDY) -> None:
    """Raise an error if an output file exists and may not be overwritten."""
    if path.is_symlink() and not path.exists():  # a dangling link: writing would create an unknown target
        remedy = "remove the link, or name another file"
        raise refuse(where, str(path), "a file that does not exist yet", _DANGLING_LINK, remedy)
    if path.is_dir():
        raise refuse(where, str(path), "a file", "a folder stands there", "move it, or name another folder")
    if path.exists() and not overwrite:
        raise refuse(where, str(path), "a file that does not exist yet", "nothing is written over", remedy)
    if why := _describe_obstacle(path.parent):
        raise refuse("folder", str(path.parent), _CREATABLE, why, "name another")
    if (path.is_file() or not path.exists()) and not os.access(_nearest_existing(path.parent), os.W_OK | os.X_OK):
        raise refuse("folder", str(path.parent), _WRITABLE, "it may not be written", "name another")


_CREATABLE, _WRITABLE = "a folder that can be made", "a folder that takes files"
_DANGLING_LINK = "a symbolic link stands there that leads nowhere"


def _nearest_existing(folder: Path) -> Path:
    """Return the nearest existing folder: the given one or a parent."""
    whole = folder.absolute()
    return next(one for one in (whole, *whole.parents) if os.path.lexists(one))


def _describe_obstacle(folder: Path) -> str:
    """Describe a file in the place of a folder or one of its parents; empty if there is none."""
    above = _nearest_existing(folder)
    if above.is_dir():
        return ""
    return f"{above} is a symbolic link that leads nowhere" if above.is_symlink() else f"{above} is a file"


_FILE_SUFFIXES = frozenset((
    ".h5", ".hdf5", ".vtkhdf", ".csv", ".parquet", ".toml", ".json", ".html", ".svg", ".png", ".pdf", ".pvd", ".vtp",
    ".dxf", ".msh", ".inp",
))  # fmt: skip


def check_folder_name(path: Path) -> Path:
    """Return the path of an output folder; raise an error for a name with the suffix of an output file."""
    if path.suffix.lower() not in _FILE_SUFFIXES or path.exists():
        return path
    allowed, why = "a folder", "its files have names of their own, after the case"
    raise refuse("folder", str(path), allowed, why, f"name a folder, such as -o {path.with_suffix('')}")


def create_folder(path: Path) -> Path:
    """Create a folder with its parents if necessary and return it."""
    try:
        path.mkdir(parents=True, exist_ok=True)
    except OSError as fault:
        why = _describe_obstacle(path) or system_message(fault)
        raise refuse("folder", str(path), _CREATABLE, why, "name another with -o") from None
    return path


def check_folder_writable(folder: Path) -> None:
    """Raise an error if no file can be created in a folder; called before a computation, leaves no files."""
    missing = [one for one in (folder, *folder.parents) if not one.exists()]
    try:
        with tempfile.TemporaryFile(dir=create_folder(folder)):
            pass
    except OSError as fault:
        why = system_message(fault)
        raise refuse("folder", str(folder), _WRITABLE, why, "name another with -o") from None
    finally:
        for one in missing:
            with suppress(OSError):
                one.rmdir()
