"""Files that a case names: they lie near the case, so that a case from a stranger opens nothing else."""

from __future__ import annotations

import os
from pathlib import Path

from flexcam.checks import refuse

_UP = 2
"""Folders above that of the case in which files may lie, so that ``cases/engine/a.toml`` finds ``meshes/a.msh``."""

ALLOWED_BESIDES = "FLEXCAM_FILES"
"""Environment variable with further folders, divided as those of PATH are."""

_LARGEST = 1 << 30
"""Bytes of a file that is read as a whole."""


def named_file(folder: Path, name: str, where: str) -> Path:
    """Return the path of a file that a case names.

    Parameters
    ----------
    folder
        Of the case.
    name
        As the case gives it.
    where
        What the file is, for the message.

    Returns
    -------
    Path
        Of the file, which need not exist.

    Raises
    ------
    InputError
        If it lies more than two folders above the case's (also by a symbolic link) and in none of the folders of
        ``FLEXCAM_FILES``, is no regular file, or is larger than any such file.

    Examples
    --------
    >>> named_file(Path("cases/tayeb"), "../../meshes/tayeb-3.msh", "mesh").name
    'tayeb-3.msh'
    """
    path = folder / name
    try:
        target, home = path.resolve(), folder.resolve()
        there, regular = path.exists(), path.is_file()
        size = path.stat().st_size if regular else 0
    except (OSError, ValueError, RuntimeError) as fault:
        raise refuse(where, repr(name), "the path of a file", str(fault)) from None
    besides = [Path(one).resolve() for one in os.environ.get(ALLOWED_BESIDES, "").split(os.pathsep) if one]
    if not any(target.is_relative_to(one) for one in [home.parents[:_UP][-1] if home.parents else home, *besides]):
        allowed = "a file in the case's folder, up to two folders above it, or below these"
        why = "a case from elsewhere must not open any file"
        raise refuse(where, repr(name), allowed, why, f"move it, or name its folder in {ALLOWED_BESIDES}")
    if there and not regular:
        raise refuse(where, repr(name), "a regular file", "a folder or a device is none")
    if size > _LARGEST:
        raise refuse(where, f"{name!r} of {size} bytes", f"up to {_LARGEST} bytes", "it is read as a whole")
    return path
