"""Files that a case names: they lie near the case, so that a case from a stranger opens nothing else."""

from __future__ import annotations

import os
from pathlib import Path

from flexcam.checks import refuse, said

_UP = 2
"""Folders above that of the case in which files may lie, so that ``cases/engine/a.toml`` finds ``meshes/a.msh``."""

ALLOWED_BESIDES = "FLEXCAM_FILES"
"""Environment variable with further folders, divided as those of PATH are."""

_LARGEST = 1 << 30
"""Bytes of a file that is read as a whole."""


def file_beside(case: Path, name: str) -> Path | None:
    """Return the file that a text of a case names, wherever it lies; None where it names none."""
    try:
        path = _folder(case, name) / name
        return path if path.is_file() else None
    except (OSError, ValueError):  # no name of a file
        return None


def _folder(case: Path, name: str) -> Path:
    """Return the folder from which a name in a case is meant."""
    folders = _folders(case)
    return next((one for one in folders if (one / name).exists()), folders[0])


def _folders(case: Path) -> list[Path]:
    """Return where names in a case are looked up, in this order."""
    return [case.parent, case.resolve().parent] if case.is_symlink() else [case.parent]


def named_file(case: Path, name: str, where: str) -> Path:
    """Return the path of a file that a case names."""
    try:
        folder = _folder(case, name)
        path = folder / name
        target, home = path.resolve(), folder.resolve()
        there, regular = path.exists(), path.is_file()
        size = path.stat().st_size if regular else 0
    except (OSError, ValueError, RuntimeError) as fault:
        raise refuse(where, repr(name), "the path of a file", said(fault)) from None
    besides = [Path(one).resolve() for one in os.environ.get(ALLOWED_BESIDES, "").split(os.pathsep) if one]
    if not any(target.is_relative_to(one) for one in [home.parents[:_UP][-1] if home.parents else home, *besides]):
        allowed = "a file in the case's folder, up to two folders above it, or below these"
        why = "a case from elsewhere must not open any file"
        raise refuse(where, repr(name), allowed, why, f"move it, or name its folder in {ALLOWED_BESIDES}")
    if there and not regular:
        raise refuse(where, repr(name), "a regular file", "a folder or a device is none")
    if size > _LARGEST:
        raise refuse(where, f"{name!r} of {size} bytes", f"up to {_LARGEST} bytes", "it is read as a whole")
    if not there and len(tried := _folders(case)) > 1:
        allowed, why = f"a file from {tried[0]} or from {tried[1]}", f"{case} is a symbolic link, and neither has it"
        raise refuse(where, repr(name), allowed, why, "put it beside the link or beside the case")
    return path
