"""Gmsh meshes (formats 2.2 and 4.1, text and binary) in, and Gmsh and Abaqus meshes out.

Line groups become members (each must be one chain), point groups become named points. Error messages use the node and
element tags of the file.
"""

from __future__ import annotations

import io
import re
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from flexcam.core import FloatArray, IntArray
from flexcam.core.errors import NAME, NAMES, Fault, InputError, refuse, suggest_name, system_message
from flexcam.fem.mesh import Mesh, number_places
from flexcam.io.files import write_text

_MAX_FAULTS = 20  # maximum number of reported faults of one kind: a mesh with thousands has one cause
_MAX_COORDINATE = 1e12  # maximum absolute coordinate, m: squares of larger ones overflow


def read_mesh(path: Path) -> Mesh:
    """Read a Gmsh file (2.2 or 4.1, text or binary).

    Parameters
    ----------
    path
        The file, ``.msh``; coordinates in m.

    Returns
    -------
    Mesh
        Nodes in the order of the file.

    Raises
    ------
    InputError
        If the file does not exist, is not a Gmsh file, or its groups do not form members; the message lists node and
        element tags.

    Examples
    --------
    ``read_mesh(Path("meshes/tayeb-3.msh")).lines["camshaft"]`` are the nodes of the camshaft in order.
    """
    if path.suffix.lower() != ".msh":
        raise refuse("mesh", path.name, "a Gmsh file (.msh)", "flexcam reads no other mesh format", "convert it")
    if not path.is_file():
        near = suggest_name(path.name, [file.name for file in path.parent.glob("*.msh")])
        raise refuse("mesh", str(path), "an existing file", "the path is relative to the case file", near)
    raw = _read_msh(path)
    faults = [*_number_faults(raw), *(fault for group in raw.groups for fault in _group_faults(group))]
    if faults or (faults := [*_length_faults(raw)]):
        raise InputError(faults)
    members = [group for group in raw.groups if group.kind == _LINE]
    if not members:
        raise refuse("mesh", "no lines", "line elements in named groups", "", "add a physical curve")
    place = np.argsort(raw.numbers, kind="stable")

    def index(numbers: IntArray) -> IntArray:
        return place[np.searchsorted(raw.numbers, numbers, sorter=place)]

    chains = ((group.name, _order_chain(group.nodes)) for group in members)
    lines = {name: index(chain) for name, chain in chains if chain is not None}
    points = {g.name: np.unique(index(g.nodes)) for g in raw.groups if g.kind == _POINT and g.name}
    return Mesh(raw.points, lines, points)


def _number_faults(raw: _GmshMesh) -> Iterator[Fault]:
    for i in np.flatnonzero(~(np.abs(raw.points) <= _MAX_COORDINATE).all(axis=1))[:_MAX_FAULTS].tolist():
        given, allowed = ", ".join(f"{x:g}" for x in raw.points[i].tolist()), f"finite, up to {_MAX_COORDINATE:g} m"
        yield Fault(f"mesh node {raw.numbers[i]}", given, allowed, "", "export it again from Gmsh")
    numbers, counts = np.unique(raw.numbers, return_counts=True)
    for number in numbers[counts > 1][:_MAX_FAULTS].tolist():
        why = "elements refer to a node by its number"
        yield Fault(f"mesh node {number}", "several nodes of this number", "one", why, "")
    for group in raw.groups:
        bad = np.flatnonzero(~np.isin(group.nodes, raw.numbers).all(axis=1))
        for i in bad[:_MAX_FAULTS].tolist():
            missing = [n for n in group.nodes[i].tolist() if n not in raw.numbers]
            where, given = f"mesh element {group.numbers[i]}", f"node {missing[0]}"
            yield Fault(where, given, "a node of the file", "there is no such node", "export it again from Gmsh")


def _group_faults(group: _ElementGroup) -> Iterator[Fault]:
    count = len(group.numbers)
    tags = ", ".join(map(str, group.numbers[:3].tolist())) + (", ..." if count > 3 else "")
    what = f"{count} elements ({tags})"
    if group.kind not in (_LINE, _POINT):
        elements = f"{count} elements" if count > 1 else "an element"
        shape = f"{elements} of {group.nodes.shape[1]} nodes (element{'s' * (count > 1)} {tags})"
        why, remedy = "members are beams", "mesh only curves, in order 1"
        yield Fault("mesh", shape, "only points and two-node lines", why, remedy)
    elif group.kind == _LINE and not group.name:
        why = "each member has the elements of the physical curve of its name"
        yield Fault("mesh", f"{what} in no named group", "line elements in named groups", why, "add a physical curve")
    elif group.name and not re.fullmatch(NAME, group.name):
        where, why = f"mesh group {group.name!r}", "cases and results name the group"
        yield Fault(where, repr(group.name), NAMES, why, "rename the physical group in Gmsh")
    elif group.kind == _LINE and _order_chain(group.nodes) is None:
        why = f"a member is a chain without branches, loops or gaps{_describe_breaks(group.nodes)}"
        where, remedy = f"mesh group {group.name!r}", "give each chain its own group"
        yield Fault(where, what, "one open chain", why, remedy)


def _describe_breaks(pairs: IntArray) -> str:
    """Describe the nodes at which lines do not form a chain."""
    nodes, counts = np.unique(pairs, return_counts=True)
    if branches := nodes[counts > 2].tolist():
        return f"; node {branches[0]} has {int(counts[nodes == branches[0]][0])} lines"
    ends = nodes[counts == 1].tolist()
    return f"; it ends at nodes {', '.join(map(str, ends[:6]))}" if len(ends) > 2 else "; it has a loop"


def _length_faults(raw: _GmshMesh) -> Iterator[Fault]:
    """Yield lines of zero length and coincident nodes."""
    place = number_places(raw.points)
    places = dict(zip(raw.numbers.tolist(), place.tolist(), strict=True))
    lines = [group for group in raw.groups if group.kind == _LINE]
    pairs = [pair for group in lines for pair in zip(group.numbers.tolist(), group.nodes.tolist(), strict=True)]
    zero_length = [(number, a, b) for number, (a, b) in pairs if places[a] == places[b]]
    for number, a, b in zero_length[:_MAX_FAULTS]:
        given, why = f"nodes {a} and {b} at the same place", "an element needs a length"
        yield Fault(f"mesh element {number}", given, "two nodes apart", why, "merge the nodes or move one")
    reported = {places[a] for _, a, _ in zero_length}
    coincident = [i for i in np.flatnonzero(np.bincount(place) > 1).tolist() if i not in reported]
    for i in coincident[:_MAX_FAULTS]:
        tags = raw.numbers[place == i].tolist()
        given = ", ".join(f"{x:g}" for x in raw.points[raw.numbers == tags[0]][0].tolist())
        where, why = f"mesh nodes {' and '.join(map(str, tags[:3]))}", "members meet only at a shared node"
        yield Fault(where, f"all at {given}", "one node at one place", why, "merge them")


def _order_chain(pairs: IntArray) -> IntArray | None:
    """Return the nodes of an open chain in the direction of its lines; None if the lines do not form one."""
    neighbours: dict[int, list[int]] = {}
    for a, b in pairs.tolist():
        neighbours.setdefault(a, []).append(b)
        neighbours.setdefault(b, []).append(a)
    ends = [node for node, near in neighbours.items() if len(near) == 1]
    if len(ends) != 2 or any(len(near) > 2 for near in neighbours.values()):
        return None
    order = [ends[0] if ends[0] in pairs[:, 0] else ends[1]]
    previous = -1
    while following := [node for node in neighbours[order[-1]] if node != previous]:
        previous = order[-1]
        order.append(following[0])
    return np.array(order, dtype=np.intp) if len(order) == len(pairs) + 1 else None


def write_mesh(mesh: Mesh, path: Path, *, overwrite: bool = False) -> None:
    """Write a mesh as Gmsh 2.2 text or for Abaqus and CalculiX; a member and a point may share a name.

    Parameters
    ----------
    mesh
        The mesh.
    path
        The file, ``.inp`` for Abaqus and CalculiX; its folder exists.
    overwrite
        Whether an existing file may be replaced.

    Raises
    ------
    InputError
        If the file exists and may not be replaced.

    Examples
    --------
    ``write_mesh(read_mesh(Path("train.msh")), Path("train.inp"))``
    """
    text = _format_inp(mesh) if path.suffix.lower() == ".inp" else _format_msh(mesh)
    write_text(path, text, overwrite=overwrite)


def _format_msh(mesh: Mesh) -> str:
    """Return a mesh in Gmsh format 2.2, with numbers in full precision and the tag of the group as entity tag."""
    groups = [(_LINE, name, np.column_stack([line[:-1], line[1:]])) for name, line in mesh.lines.items()]
    groups += [(_POINT, name, index[:, None]) for name, index in mesh.points.items()]
    names = [f'{int(kind == _LINE)} {tag} "{name}"' for tag, (kind, name, _) in enumerate(groups, start=1)]
    nodes = [f"{i} {' '.join(map(repr, place))}" for i, place in enumerate(mesh.nodes.tolist(), start=1)]
    elements: list[str] = []
    for tag, (kind, _, index) in enumerate(groups, start=1):
        for row in (index + 1).tolist():
            elements.append(f"{len(elements) + 1} {kind} 2 {tag} {tag} {' '.join(map(str, row))}")
    text = "$MeshFormat\n2.2 0 8\n$EndMeshFormat\n"
    for section, lines in (("PhysicalNames", names), ("Nodes", nodes), ("Elements", elements)):
        text += "\n".join([f"${section}", str(len(lines)), *lines, f"$End{section}", ""])
    return text


def _format_inp(mesh: Mesh) -> str:
    """Return nodes, elements, a set of elements per member and a set of nodes per named point."""
    import meshio  # pyright: ignore[reportMissingTypeStubs]

    blocks: Any = [("line", np.column_stack([line[:-1], line[1:]])) for line in mesh.lines.values()]
    empty = np.zeros(0, dtype=np.intp)
    sets: Any = {
        name: [np.arange(len(pairs)) if i == k else empty for i, (_, pairs) in enumerate(blocks)]
        for k, name in enumerate(mesh.lines)
    }
    points: Any = dict(mesh.points)
    text = io.StringIO()
    copy = meshio.Mesh(mesh.nodes, blocks, cell_sets=sets, point_sets=points)
    meshio.abaqus.write(text, copy)  # pyright: ignore
    return text.getvalue().replace("TYPE=B31H", "TYPE=B31")  # the two-node beam element that Abaqus and CalculiX share


def _invalid(given: str, allowed: str, why: str = "") -> InputError:
    return refuse("mesh", given, allowed, why, "export it again from Gmsh")


class _TextReader:
    def __init__(self, name: str, text: bytes) -> None:
        self._name, self._words, self._next = name, text.split(), 0

    def read_count(self) -> int:
        """Return the number on the first line of the section."""
        return int(self.read("u", 1)[0])

    def read(self, kind: str, count: int) -> Any:  # noqa: ANN401 - an array of that kind
        """Return the next `count` numbers of kind ``i`` (integer), ``u`` (size) or ``f`` (float)."""
        words = self._words[self._next : self._next + count]
        if count < 0 or len(words) < count:
            allowed, why = f"{self._next + count} or more by its counts", "entries or numbers are missing"
            raise _invalid(f"{len(self._words)} numbers in ${self._name}", allowed, why)
        self._next += count
        number = np.float64 if kind == "f" else np.int64
        values = np.empty(count, number)
        for i, word in enumerate(words):
            try:
                values[i] = number(word)
            except (ValueError, OverflowError):
                wrong = word.decode("ascii", "replace")
                raise _invalid(f"{wrong!r} in ${self._name}", f"a {'' if kind == 'f' else 'whole '}number") from None
        return values

    def end(self) -> None:
        """Raise an error if the section contains more numbers."""
        if self._next != len(self._words):
            raise _invalid(f"{len(self._words)} numbers in ${self._name}", f"{self._next} by its counts")


class _BinaryReader:
    """Reader of the numbers of a binary section; `size` is that of Gmsh's ``size_t``, 4 or 8 bytes."""

    def __init__(self, name: str, data: bytes, size: int) -> None:
        self._name, self._data, self._next = name, data, 0
        self._kinds = {"i": "<i4", "u": f"<u{size}", "f": "<f8"}

    def read_count(self) -> int:
        """Return the number on the first line of the section, which is text in format 2.2."""
        match = re.compile(rb"\s*(\d{1,12})[ \t\r]*\n").match(self._data, self._next)
        if match is None:
            raise _invalid(f"${self._name} without a count", "the number of its entries in its first line")
        self._next = match.end()
        return int(match[1])

    def read(self, kind: str, count: int) -> Any:  # noqa: ANN401
        """Return the next numbers."""
        item = np.dtype(self._kinds[kind])
        if count < 0 or self._next + count * item.itemsize > len(self._data):
            given = f"{len(self._data)} bytes from ${self._name} on"
            raise _invalid(given, f"{self._next + count * item.itemsize} or more by its counts")
        values = np.frombuffer(self._data, item, count, self._next)
        self._next += count * item.itemsize
        return values if kind == "f" else values.astype(np.int64)

    def end(self) -> None:
        """Raise an error if the end mark of the section does not follow."""
        if not self._data[self._next :].lstrip().startswith(f"$End{self._name}".encode()):
            raise _invalid(f"no $End{self._name} after the entries of ${self._name}", "as many entries as it declares")


_Reader = _TextReader | _BinaryReader

_LINE, _POINT = 1, 15  # Gmsh element types of members and named points

_NODES = {
    1: 2, 2: 3, 3: 4, 4: 4, 5: 8, 6: 6, 7: 5, 8: 3, 9: 6, 10: 9, 11: 10, 12: 27, 13: 18, 14: 14, 15: 1, 16: 8, 17: 20,
    18: 15, 19: 13, 20: 9, 21: 10, 22: 12, 23: 15, 24: 15, 25: 21, 26: 4, 27: 5, 28: 6,
}  # fmt: skip
"""Number of nodes by Gmsh element type."""


@dataclass(frozen=True, eq=False)
class _ElementGroup:
    """Elements of one Gmsh type in one physical group: its name, tags, shape (k,), and node tags, shape (k, m)."""

    kind: int
    name: str
    numbers: IntArray
    nodes: IntArray


@dataclass(frozen=True, eq=False)
class _GmshMesh:
    """Content of a Gmsh file: node tags, coordinates and groups of elements."""

    numbers: IntArray
    points: FloatArray
    groups: list[_ElementGroup]


Elements = tuple[int, int, IntArray, IntArray]
"""Type, physical group (0 for none), tags and nodes of some elements."""


def _read_msh(path: Path) -> _GmshMesh:
    try:
        data = path.read_bytes()
    except OSError as fault:
        raise refuse("mesh", str(path), "a readable file", system_message(fault)) from None
    first = 0
    while comments := _COMMENTS.match(data, first):
        first = comments.end()
    head = _HEAD.match(data, first)
    if head is None:
        raise _invalid(path.name, "a Gmsh file (.msh) of format 2.2 or 4.1", "it does not begin with $MeshFormat")
    version, binary, size = head[1].decode("ascii", "replace"), head[2] == b"1", int(head[3])
    newer = version in ("4", "4.1")
    if not (newer or version in ("2", "2.1", "2.2")) or size not in (4, 8):
        raise refuse("mesh", f"format {version}", "a Gmsh file of format 2.2 or 4.1", "", "save it as version 4.1")
    if binary and data[head.end() : head.end() + 4] != b"\x01\x00\x00\x00":
        why = "the header says binary, but the data are text or have another byte order"
        raise _invalid(path.name, "binary data of this machine", why)

    def section(name: str) -> _Reader:
        start = data.find(b"\n$%s" % name.encode(), head.end() - 1)
        if start < 0:
            raise _invalid(f"a file without ${name}", "a Gmsh file with this section")
        first = data.find(b"\n", start + 1) + 1
        if binary:
            return _BinaryReader(name, data[first:] if first else b"", size)
        end = data.find(b"$End%s" % name.encode(), first)
        if end < 0 or not first:
            raise _invalid(f"${name} without $End{name}", "both", "the file is cut off")
        return _TextReader(name, data[first:end])

    if newer:
        groups = _read_entities(section("Entities"))
        numbers, points = _read_nodes_4(section("Nodes"))
        blocks = list(_read_elements_4(section("Elements"), groups))
    else:
        numbers, points = _read_nodes_2(section("Nodes"), binary)
        blocks = list(_read_elements_2(section("Elements"), binary))
    text = data.partition(b"$PhysicalNames")[2].partition(b"$EndPhysicalNames")[0].decode("utf-8", "replace")
    names = {(int(dimension), int(tag)): name for dimension, tag, name in _PHYSICAL_NAME.findall(text)}
    parts: dict[tuple[int, int], list[Elements]] = {}  # a group may consist of several curves
    for block in blocks:
        if len(block[2]):
            parts.setdefault(block[:2], []).append(block)
    merged: list[_ElementGroup] = []
    for (kind, group), sections in parts.items():
        tags, nodes = (np.concatenate([block[column] for block in sections]) for column in (2, 3))
        merged.append(_ElementGroup(kind, names.get((int(kind == _LINE), group), ""), tags, nodes))
    return _GmshMesh(numbers, points, merged)


_COMMENTS = re.compile(rb"\s*\$Comments\b.*?\$EndComments", re.S)
_HEAD = re.compile(rb"\s*\$MeshFormat\s+(\S{1,8})\s+([01])\s+(\d)\s*?\n")
_PHYSICAL_NAME = re.compile(r'^[ \t]*(\d{1,9})[ \t]+(\d{1,9})[ \t]+"(.*)"[ \t\r]*$', re.M)


def _read_nodes_2(nodes: _Reader, binary: bool) -> tuple[IntArray, FloatArray]:
    count = nodes.read_count()
    if binary:
        rows = nodes.read("i", 7 * count).astype("<i4").reshape(count, 7)
        points: FloatArray = np.ascontiguousarray(rows[:, 1:]).view("<f8").astype(float)
    else:
        rows = nodes.read("f", 4 * count).reshape(count, 4)
        tags: FloatArray = rows[:, 0]
        if not (tags == np.round(tags)).all() or (np.abs(tags) > 2.0**53).any():
            raise _invalid("a node whose number is not whole", "whole numbers of nodes")
        points = rows[:, 1:]
    nodes.end()
    return rows[:, 0].astype(np.intp), points


def _read_elements_2(elements: _Reader, binary: bool) -> Iterator[Elements]:
    count, done = elements.read_count(), 0
    while done < count:
        # In binary files a header serves several elements, and the tag of each precedes its row.
        first, second, tags = elements.read("i", 3).tolist()
        kind, block_size = (first, second) if binary else (second, 1)
        if kind not in _NODES or tags < 0 or block_size < 1:
            raise _invalid(f"an element of type {kind} with {tags} tags", "an element type of Gmsh")
        offset = int(binary)
        width = offset + tags + _NODES[kind]
        for row in elements.read("i", block_size * width).reshape(block_size, width):
            number = row[:1] if binary else np.array([first])
            yield kind, int(row[offset]) if tags else 0, number, row[None, offset + tags :]
        done += block_size
    elements.end()


def _read_entities(entities: _Reader) -> dict[tuple[int, int], list[int]]:
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


def _read_nodes_4(nodes: _Reader) -> tuple[IntArray, FloatArray]:
    blocks, total, _, _ = nodes.read("u", 4).tolist()
    numbers: list[Any] = []
    points: list[Any] = []
    for _ in range(blocks):
        dimension, _, parametric = nodes.read("i", 3).tolist()
        (count,) = nodes.read("u", 1).tolist()
        if dimension not in range(4):
            raise _invalid(f"nodes of dimension {dimension}", "a dimension from 0 to 3")
        width = 3 + (dimension if parametric else 0)
        numbers.append(nodes.read("u", count))
        points.append(nodes.read("f", count * width).reshape(count, width)[:, :3])
    nodes.end()
    if sum(map(len, numbers)) != total:
        raise _invalid(f"{sum(map(len, numbers))} nodes in $Nodes", f"{total}, as it declares")
    return np.concatenate([np.zeros(0, np.intp), *numbers]), np.concatenate([np.zeros((0, 3)), *points])


def _read_elements_4(elements: _Reader, groups: dict[tuple[int, int], list[int]]) -> Iterator[Elements]:
    blocks, total, _, _ = elements.read("u", 4).tolist()
    done = 0
    for _ in range(blocks):
        dimension, entity, kind = elements.read("i", 3).tolist()
        (count,) = elements.read("u", 1).tolist()
        if kind not in _NODES:
            raise _invalid(f"elements of type {kind}", "an element type of Gmsh")
        rows = elements.read("u", count * (1 + _NODES[kind])).reshape(count, 1 + _NODES[kind])
        done += count
        for group in groups.get((dimension, entity), []) or [0]:
            yield kind, group, rows[:, 0], rows[:, 1:]
    elements.end()
    if done != total:
        raise _invalid(f"{done} elements in $Elements", f"{total}, as it declares")
