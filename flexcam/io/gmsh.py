"""Gmsh files in formats 2.2 and 4.1, text and binary."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Protocol

import numpy as np

from flexcam.core import FloatArray, IntArray
from flexcam.core.errors import InputError, refuse

ALLOWED = "a Gmsh file (.msh) of format 2.2 or 4.1"


def invalid_file_error(given: str, why: str = "") -> InputError:
    """Return the error for an invalid Gmsh file."""
    return refuse("mesh", given, ALLOWED, why, "export it again from Gmsh")


class NumberReader(Protocol):
    """Sequential reader of the numbers of one section."""

    def read_count(self) -> int:
        """Return the number on the first line of the section, which is text in format 2.2."""
        ...

    def read(self, kind: str, count: int) -> Any:  # noqa: ANN401 - an array of that kind
        """Return the next `count` numbers of kind ``i`` (integer), ``u`` (size) or ``f`` (float)."""
        ...

    def end(self) -> None:
        """Raise an error if the section contains more numbers."""
        ...


class TextReader:
    """Reader of a text section.

    Parameters
    ----------
    name
        Name of the section.
    text
        Content between the start and end marks.
    """

    def __init__(self, name: str, text: bytes) -> None:
        self._name, self._words, self._next = name, text.split(), 0

    def read_count(self) -> int:
        """Return the next integer."""
        return int(self.read("u", 1)[0])

    def read(self, kind: str, count: int) -> Any:  # noqa: ANN401
        """Return the next numbers."""
        words = self._words[self._next : self._next + count]
        if count < 0 or len(words) < count:
            raise invalid_file_error(f"{len(self._words)} numbers in ${self._name}", "it ends before what it announces")
        self._next += count
        try:
            return np.array(words, dtype="S").astype(float if kind == "f" else np.int64)
        except (ValueError, OverflowError):
            text = b" ".join(words[:6]).decode("ascii", "replace")
            raise invalid_file_error(f"{text!r} in ${self._name}", "numbers stand there") from None

    def end(self) -> None:
        """Raise an error if the section contains more numbers."""
        if self._next != len(self._words):
            raise invalid_file_error(
                f"more in ${self._name} than it announces", "a line has too many numbers or too few"
            )


class BinaryReader:
    """Reader of a binary section.

    Parameters
    ----------
    name
        Name of the section.
    data
        Content from its first line on.
    size
        Size of Gmsh's ``size_t``, 4 or 8 bytes.
    """

    def __init__(self, name: str, data: bytes, size: int) -> None:
        self._name, self._data, self._next = name, data, 0
        self._kinds = {"i": "<i4", "u": f"<u{size}", "f": "<f8"}

    def read_count(self) -> int:
        """Return the number on the first line of the section."""
        found = re.compile(rb"\s*(\d{1,12})[ \t\r]*\n").match(self._data, self._next)
        if found is None:
            raise invalid_file_error(f"no number at the head of ${self._name}")
        self._next = found.end()
        return int(found[1])

    def read(self, kind: str, count: int) -> Any:  # noqa: ANN401
        """Return the next numbers."""
        item = np.dtype(self._kinds[kind])
        if count < 0 or self._next + count * item.itemsize > len(self._data):
            raise invalid_file_error(
                f"{len(self._data)} bytes from ${self._name} on", "it ends before what it announces"
            )
        values = np.frombuffer(self._data, item, count, self._next)
        self._next += count * item.itemsize
        return values if kind == "f" else values.astype(np.int64)

    def end(self) -> None:
        """Raise an error if the end mark of the section does not follow."""
        if not self._data[self._next :].lstrip().startswith(f"$End{self._name}".encode()):
            raise invalid_file_error(f"no $End{self._name} after ${self._name}", "it holds more than it announces")


LINE, POINT = 1, 15
"""Gmsh element types of members and named points."""

_NODES = {
    1: 2, 2: 3, 3: 4, 4: 4, 5: 8, 6: 6, 7: 5, 8: 3, 9: 6, 10: 9, 11: 10, 12: 27, 13: 18, 14: 14, 15: 1, 16: 8, 17: 20,
    18: 15, 19: 13, 20: 9, 21: 10, 22: 12, 23: 15, 24: 15, 25: 21, 26: 4, 27: 5, 28: 6,
}  # fmt: skip
"""Number of nodes by Gmsh element type."""


@dataclass(frozen=True, eq=False)
class ElementGroup:
    """Elements of one type in one physical group.

    Parameters
    ----------
    kind
        Gmsh element type: `LINE`, `POINT` or another.
    group
        Number of the physical group; 0 for none.
    numbers
        Element tags in the file, shape (k,).
    nodes
        Node tags of the elements, shape (k, m).
    """

    kind: int
    group: int
    numbers: IntArray
    nodes: IntArray


@dataclass(frozen=True, eq=False)
class GmshMesh:
    """Content of a Gmsh file.

    Parameters
    ----------
    numbers
        Node tags, shape (n,).
    points
        Coordinates, shape (n, 3).
    elements
        Elements in the order of the file.
    names
        Name by dimension and tag of the physical group.
    """

    numbers: IntArray
    points: FloatArray
    elements: list[ElementGroup]
    names: dict[tuple[int, int], str]


def read_msh(path: Path) -> GmshMesh:
    """Read a Gmsh file."""
    try:
        data = path.read_bytes()
    except OSError as fault:
        raise invalid_file_error(str(path), str(fault)) from None
    head = _HEAD.match(data)
    if head is None:
        raise invalid_file_error(path.name, "it does not begin with $MeshFormat")
    version, binary, size = head[1].decode("ascii", "replace"), head[2] == b"1", int(head[3])
    newer = version in ("4", "4.1")
    if not (newer or version in ("2", "2.1", "2.2")) or size not in (4, 8):
        raise invalid_file_error(f"format {version}", "save it as version 4.1")
    if binary and data[head.end() : head.end() + 4] != b"\x01\x00\x00\x00":
        raise invalid_file_error(path.name, "its bytes are in the order of another machine")
    sections = _SectionReader(data, head.end(), size if binary else 0)
    read = _read_4 if newer else _read_2
    numbers, points, elements = read(sections, binary)
    return GmshMesh(numbers, points, elements, _names(data))


_HEAD = re.compile(rb"\s*(?:\$Comments\b.*?\$EndComments\s*)*\$MeshFormat\s+(\S{1,8})\s+([01])\s+(\d)\s*?\n", re.S)
_PHYSICAL_NAME = re.compile(r'^\s*(\d{1,9})\s+(\d{1,9})\s+"(.*)"\s*$', re.M)


def _names(data: bytes) -> dict[tuple[int, int], str]:
    section = data.partition(b"$PhysicalNames")[2].partition(b"$EndPhysicalNames")[0].decode("utf-8", "replace")
    return {(int(dimension), int(number)): name for dimension, number, name in _PHYSICAL_NAME.findall(section)}


class _SectionReader:
    """Sequential reader of the sections of a file."""

    def __init__(self, data: bytes, first: int, size: int) -> None:
        self._data, self._first, self._size = data, first, size

    def numbers(self, name: str) -> NumberReader:
        """Return the reader of a section."""
        start = self._data.find(b"\n$%s" % name.encode(), self._first - 1)
        if start < 0:
            raise invalid_file_error(f"no ${name}", f"of {ALLOWED}")
        first = self._data.find(b"\n", start + 1) + 1
        if self._size:
            return BinaryReader(name, self._data[first:] if first else b"", self._size)
        end = self._data.find(b"$End%s" % name.encode(), first)
        if end < 0 or not first:
            raise invalid_file_error(f"no $End{name}", "the file is cut off")
        return TextReader(name, self._data[first:end])


Parts = tuple[IntArray, FloatArray, list[ElementGroup]]


def _read_2(sections: _SectionReader, binary: bool) -> Parts:
    nodes = sections.numbers("Nodes")
    count = nodes.read_count()
    numbers, points = _nodes_2(nodes, count, binary)
    nodes.end()
    elements = sections.numbers("Elements")
    found = list(_elements_2(elements, elements.read_count(), binary))
    elements.end()
    return numbers, points, _group_elements(found)


def _nodes_2(nodes: NumberReader, count: int, binary: bool) -> tuple[IntArray, FloatArray]:
    if binary:
        rows = nodes.read("i", 7 * count).astype("<i4").reshape(count, 7)
        return rows[:, 0].astype(np.intp), np.ascontiguousarray(rows[:, 1:]).view("<f8").astype(float)
    rows: FloatArray = nodes.read("f", 4 * count).reshape(count, 4)
    if not (rows[:, 0] == np.round(rows[:, 0])).all() or (np.abs(rows[:, 0]) > 2.0**53).any():
        raise invalid_file_error("a node whose number is not whole")
    return rows[:, 0].astype(np.intp), rows[:, 1:]


Row = tuple[int, int, int, tuple[int, ...]]
"""Type, physical group, tag and nodes of one element."""


def _elements_2(elements: NumberReader, count: int, binary: bool) -> Iterator[Row]:
    done = 0
    while done < count:
        if binary:
            kind, several, tags = elements.read("i", 3).tolist()
            numbers = None
        else:
            number, kind, tags = elements.read("i", 3).tolist()
            numbers, several = [number], 1
        if kind not in _NODES or tags < 0 or several < 1:
            raise invalid_file_error(f"an element of type {kind} with {tags} tags", "Gmsh has no such element")
        width = tags + _NODES[kind] + (numbers is None)
        for row in elements.read("i", several * width).reshape(several, width).tolist():
            number, *rest = row if numbers is None else [*numbers, *row]
            yield kind, rest[0] if tags else 0, number, tuple(rest[tags:])
        done += several


def _group_elements(rows: list[Row]) -> list[ElementGroup]:
    """Group elements by type and physical group, in the order of first appearance."""
    parts: dict[tuple[int, int], list[Row]] = {}
    for row in rows:
        parts.setdefault(row[:2], []).append(row)
    return [
        ElementGroup(kind, group, np.array([row[2] for row in its]), np.array([row[3] for row in its]))
        for (kind, group), its in parts.items()
    ]


def _read_4(sections: _SectionReader, binary: bool) -> Parts:
    del binary  # both forms have the same layout
    groups = _entities(sections.numbers("Entities"))
    numbers, points = _nodes_4(sections.numbers("Nodes"))
    return numbers, points, list(_elements_4(sections.numbers("Elements"), groups))


def _entities(entities: NumberReader) -> dict[tuple[int, int], list[int]]:
    """Return the physical groups by dimension and tag of the entity."""
    groups: dict[tuple[int, int], list[int]] = {}
    for dimension, count in enumerate(entities.read("u", 4).tolist()):
        for _ in range(count):
            (number,) = entities.read("i", 1).tolist()
            entities.read("f", 6 if dimension else 3)
            groups[dimension, number] = entities.read("i", *entities.read("u", 1).tolist()).tolist()
            if dimension:
                entities.read("i", *entities.read("u", 1).tolist())
    entities.end()
    return groups


def _nodes_4(nodes: NumberReader) -> tuple[IntArray, FloatArray]:
    blocks, total, _, _ = nodes.read("u", 4).tolist()
    numbers: list[Any] = []
    points: list[Any] = []
    for _ in range(blocks):
        dimension, _, parametric = nodes.read("i", 3).tolist()
        (count,) = nodes.read("u", 1).tolist()
        width = 3 + (dimension if parametric else 0)
        numbers.append(nodes.read("u", count))
        points.append(nodes.read("f", count * width).reshape(count, width)[:, :3])
    nodes.end()
    if sum(map(len, numbers)) != total:
        raise invalid_file_error(f"{sum(map(len, numbers))} nodes, {total} announced")
    if not total:
        return np.zeros(0, np.intp), np.zeros((0, 3))
    return np.concatenate(numbers), np.concatenate(points)


def _elements_4(elements: NumberReader, groups: dict[tuple[int, int], list[int]]) -> Iterator[ElementGroup]:
    blocks, total, _, _ = elements.read("u", 4).tolist()
    done = 0
    for _ in range(blocks):
        dimension, entity, kind = elements.read("i", 3).tolist()
        (count,) = elements.read("u", 1).tolist()
        if kind not in _NODES:
            raise invalid_file_error(f"elements of type {kind}", "Gmsh has no such element")
        rows = elements.read("u", count * (1 + _NODES[kind])).reshape(count, 1 + _NODES[kind])
        done += count
        for group in groups.get((dimension, entity), []) or [0]:
            yield ElementGroup(kind, group, rows[:, 0], rows[:, 1:])
    elements.end()
    if done != total:
        raise invalid_file_error(f"{done} elements, {total} announced")


Group = tuple[int, str, IntArray]
"""Gmsh element type, name and node indices of a physical group, shape (k, m)."""


def msh_text(nodes: FloatArray, groups: Sequence[Group]) -> str:
    r"""Return a mesh in Gmsh format 2.2, with numbers in full precision."""
    named = [f'{int(kind == LINE)} {tag} "{name}"' for tag, (kind, name, _) in enumerate(groups, start=1)]
    placed = [f"{i} {' '.join(map(repr, place))}" for i, place in enumerate(nodes.tolist(), start=1)]
    joined = [f"{i} {one}" for i, one in enumerate(_elements(groups), start=1)]
    return "".join([
        "$MeshFormat\n2.2 0 8\n$EndMeshFormat\n",
        _section("PhysicalNames", named), _section("Nodes", placed), _section("Elements", joined),
    ])  # fmt: skip


def _elements(groups: Sequence[Group]) -> Iterator[str]:
    """Yield type, two tags and nodes of every element; the entity tag equals the tag of the physical group."""
    for tag, (kind, _, nodes) in enumerate(groups, start=1):
        for row in (nodes + 1).tolist():
            yield f"{kind} 2 {tag} {tag} {' '.join(map(str, row))}"


def _section(name: str, lines: Iterable[str]) -> str:
    rows = list(lines)
    return "\n".join([f"${name}", str(len(rows)), *rows, f"$End{name}", ""])
