"""Files that are read: regular ones, of a size that a file of that kind can have."""

from __future__ import annotations

from pathlib import Path
from stat import S_ISREG

_LARGEST_TEXT = 1 << 28
"""Bytes of a text that is read as a whole."""


def size_of(path: Path) -> int:
    """Return the size of a file; a device or a pipe has none, and reading it might never end.

    Parameters
    ----------
    path
        The file.

    Returns
    -------
    int
        Bytes.

    Raises
    ------
    OSError
        If there is no such file, or it is no regular one.

    Examples
    --------
    >>> size_of(Path(__file__)) > 0
    True
    """
    found = path.stat()
    if not S_ISREG(found.st_mode):
        raise OSError("a folder, a device or a pipe stands there")
    return found.st_size


def text_of(path: Path, encoding: str = "utf-8-sig") -> str:
    """Return the text of a file.

    Parameters
    ----------
    path
        The file.
    encoding
        Of its characters; a mark of their order at the beginning, which editors of Windows write, is left out.

    Returns
    -------
    str
        All of it.

    Raises
    ------
    OSError
        If there is no such file, it is no regular one, or far larger than any text of flexcam.
    UnicodeDecodeError
        If it is no text.
    """
    size = size_of(path)
    if size > _LARGEST_TEXT:
        raise OSError(f"it has {size} bytes, more than any such file")
    return path.read_text(encoding=encoding)


def lines_of(path: Path) -> list[str]:
    """Return the lines of a file as an editor counts them.

    No letter but the ends of lines of Unix, Windows and old Macs ends one: `str.splitlines` would count
    others, such as U+0085 and U+2028, and name a wrong line from there on.

    Parameters
    ----------
    path
        The file.

    Returns
    -------
    list
        Without their ends.

    Raises
    ------
    OSError, UnicodeDecodeError
        As `text_of`.
    """
    return text_of(path).split("\n")  # all three ends are read as this one
