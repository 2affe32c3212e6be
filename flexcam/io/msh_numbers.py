"""The numbers of a Gmsh file, as text or binary: taken in turn, never more than there are."""

from __future__ import annotations

import re
from typing import Any, Protocol

import numpy as np

from flexcam.checks import InputError, refuse

ALLOWED = "a Gmsh file (.msh) of format 2.2 or 4.1"


def malformed(given: str, why: str = "") -> InputError:
    """Return the refusal of a file that is not what it says it is."""
    return refuse("mesh", given, ALLOWED, why, "export it again from Gmsh")


class Numbers(Protocol):
    """The numbers of one section."""

    def heading(self) -> int:
        """Return the number on the section's first line, which is text in format 2.2."""
        ...

    def take(self, kind: str, count: int) -> Any:  # noqa: ANN401 - an array of that kind
        """Return the next numbers: of kind ``i`` (whole), ``u`` (a size) or ``f``."""
        ...

    def end(self) -> None:
        """Refuse the section if it holds more."""
        ...


class Words:
    """The numbers of a section that is text.

    Parameters
    ----------
    name
        Of the section.
    text
        Between its marks.
    """

    def __init__(self, name: str, text: bytes) -> None:
        self._name, self._words, self._next = name, text.split(), 0

    def heading(self) -> int:
        """Return the next whole number."""
        return int(self.take("u", 1)[0])

    def take(self, kind: str, count: int) -> Any:  # noqa: ANN401
        """Return the next numbers."""
        words = self._words[self._next : self._next + count]
        if count < 0 or len(words) < count:
            raise malformed(f"{len(self._words)} numbers in ${self._name}", "it ends before what it announces")
        self._next += count
        try:
            return np.array(words, dtype="S").astype(float if kind == "f" else np.int64)
        except (ValueError, OverflowError):
            text = b" ".join(words[:6]).decode("ascii", "replace")
            raise malformed(f"{text!r} in ${self._name}", "numbers stand there") from None

    def end(self) -> None:
        """Refuse the section if it holds more."""
        if self._next != len(self._words):
            raise malformed(f"more in ${self._name} than it announces", "a line has too many numbers or too few")


class Binary:
    """The numbers of a section that is binary.

    Parameters
    ----------
    name
        Of the section.
    data
        From its first line on.
    size
        Bytes of a size, 4 or 8.
    """

    def __init__(self, name: str, data: bytes, size: int) -> None:
        self._name, self._data, self._next = name, data, 0
        self._kinds = {"i": "<i4", "u": f"<u{size}", "f": "<f8"}

    def heading(self) -> int:
        """Return the number on the section's first line."""
        found = re.compile(rb"\s*(\d{1,12})[ \t\r]*\n").match(self._data, self._next)
        if found is None:
            raise malformed(f"no number at the head of ${self._name}")
        self._next = found.end()
        return int(found[1])

    def take(self, kind: str, count: int) -> Any:  # noqa: ANN401
        """Return the next numbers."""
        item = np.dtype(self._kinds[kind])
        if count < 0 or self._next + count * item.itemsize > len(self._data):
            raise malformed(f"{len(self._data)} bytes from ${self._name} on", "it ends before what it announces")
        values = np.frombuffer(self._data, item, count, self._next)
        self._next += count * item.itemsize
        return values if kind == "f" else values.astype(np.int64)

    def end(self) -> None:
        """Refuse the section if its end mark does not follow."""
        if not self._data[self._next :].lstrip().startswith(f"$End{self._name}".encode()):
            raise malformed(f"no $End{self._name} after ${self._name}", "it holds more than it announces")
