"""Where files go: nothing is written over unless that was asked for."""

from __future__ import annotations

from pathlib import Path

from flexcam.checks import refuse

_REMEDY = "overwrite it by --overwrite or overwrite=True"


def free_to_write(where: str, path: Path, *, overwrite: bool, remedy: str = _REMEDY) -> None:
    """Refuse a target that exists.

    Parameters
    ----------
    where
        What is written, for the message.
    path
        The target.
    overwrite
        Whether it may be replaced.
    remedy
        What to do if it may not.

    Raises
    ------
    InputError
        If it exists and may not be replaced, is a folder, or its folder cannot be made.
    """
    if path.is_dir():
        raise refuse(where, str(path), "a file", "a folder stands there", "move it, or name another folder")
    if path.exists() and not overwrite:
        raise refuse(where, str(path), "a file that does not exist yet", "nothing is written over", remedy)
    above = next(folder for folder in path.absolute().parents if folder.exists())
    if not above.is_dir():
        raise refuse("folder", str(path.parent), "a folder that can be made", f"{above} is a file", "name another")


def made_folder(path: Path) -> Path:
    """Return a folder, made with its parents if it does not exist.

    Parameters
    ----------
    path
        The folder.

    Returns
    -------
    Path
        The same.

    Raises
    ------
    InputError
        If it cannot be made.
    """
    try:
        path.mkdir(parents=True, exist_ok=True)
    except OSError as fault:
        raise refuse("folder", str(path), "a folder that can be made", str(fault), "name another with -o") from None
    return path
