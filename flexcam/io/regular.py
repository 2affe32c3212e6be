"""Files that are read: regular ones, of a size that a file of that kind can have."""

from __future__ import annotations

from pathlib import Path
from stat import S_ISREG

_LARGEST_TEXT = 1 << 28
"""Bytes of a text that is read as a whole."""


def size_of(path: Path) -> int:
    """Return the size of a file; a device or a pipe has none, and reading it might never end."""
    found = path.stat()
    if not S_ISREG(found.st_mode):
        raise OSError("a folder, a device or a pipe stands there")
    return found.st_size


def text_of(path: Path, encoding: str = "utf-8-sig") -> str:
    """Return the text of a file."""
    size = size_of(path)
    if size > _LARGEST_TEXT:
        raise OSError(f"it has {size} bytes, more than any such file")
    return path.read_text(encoding=encoding)


def lines_of(path: Path) -> list[str]:
    """Return the lines of a file as an editor counts them.

    No letter but the ends of lines of Unix, Windows and old Macs ends one: `str.splitlines` would count
    others, such as U+0085 and U+2028, and name a wrong line from there on.
    """
    return text_of(path).split("\n")  # all three ends are read as this one
