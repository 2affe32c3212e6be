"""Gmsh mesh files: line groups become members (each must be one chain), point groups become named points.

Error messages use the node and element tags of the file.
"""

from __future__ import annotations

import io
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from flexcam.core import IntArray
from flexcam.core.errors import NAME, NAMES, Fault, InputError, refuse, suggest_name
from flexcam.fem.mesh import Mesh
from flexcam.io.files import write_text
from flexcam.io.gmsh import LINE, POINT, ElementGroup, GmshMesh, msh_text, read_msh

_MAX_FAULTS = 20
"""Maximum number of reported faults of one kind: a mesh with thousands has one cause."""

_COINCIDENCE_TOLERANCE = 1e-9
"""Distance, relative to the mesh size, below which nodes count as coincident (rounding)."""


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
        raise refuse("mesh", path.name, "a Gmsh file (.msh)", "other formats lose the names of groups")
    if not path.is_file():
        near = suggest_name(path.name, [other.name for other in path.parent.glob("*.msh")])
        raise refuse("mesh", str(path), "an existing file", "the path is relative to the case file", near)
    raw = read_msh(path)
    groups = _groups(raw)
    faults = [*_node_faults(raw), *_reference_faults(raw)]
    faults += [fault for group in groups for fault in _group_faults(group, raw)]
    if not faults:
        faults = [*_length_faults(raw)]
    if not faults and not any(group.kind == LINE for group in groups):
        faults.append(Fault("mesh", "no lines", "at least one line group", "", "add a physical curve"))
    if faults:
        raise InputError(faults)
    place = np.argsort(raw.numbers, kind="stable")

    def index(numbers: IntArray) -> IntArray:
        return place[np.searchsorted(raw.numbers, numbers, sorter=place)]

    lines = {_name(group, raw): index(chain) for group in groups if (chain := _member(group)) is not None}
    points = {_name(g, raw): np.unique(index(g.nodes)) for g in groups if g.kind == POINT and _name(g, raw)}
    return Mesh(raw.points, lines, points)


def _name(group: ElementGroup, raw: GmshMesh) -> str:
    return raw.names.get((1 if group.kind == LINE else 0, group.group), "")


def _member(group: ElementGroup) -> IntArray | None:
    return _order_chain(group.nodes) if group.kind == LINE else None


def _groups(raw: GmshMesh) -> list[ElementGroup]:
    """Merge elements of one type and group; a group may consist of several curves."""
    parts: dict[tuple[int, int], list[ElementGroup]] = {}
    for one in raw.elements:
        if len(one.numbers):
            parts.setdefault((one.kind, one.group), []).append(one)
    return [
        ElementGroup(kind, group, *(np.concatenate([getattr(one, key) for one in its]) for key in ("numbers", "nodes")))
        for (kind, group), its in parts.items()
    ]


def _node_faults(raw: GmshMesh) -> Iterator[Fault]:
    for i in np.flatnonzero(~np.isfinite(raw.points).all(axis=1))[:_MAX_FAULTS].tolist():
        given = ", ".join(f"{x:g}" for x in raw.points[i].tolist())
        yield Fault(f"mesh node {raw.numbers[i]}", given, "finite coordinates", "", "export it again from Gmsh")
    numbers, counts = np.unique(raw.numbers, return_counts=True)
    for number in numbers[counts > 1][:_MAX_FAULTS].tolist():
        yield Fault(
            f"mesh node {number}", "several nodes", "one node of a number", "which one is meant is not known", ""
        )


def _reference_faults(raw: GmshMesh) -> Iterator[Fault]:
    for one in raw.elements:
        bad = np.flatnonzero(~np.isin(one.nodes, raw.numbers).all(axis=1))
        for i in bad[:_MAX_FAULTS].tolist():
            missing = [n for n in one.nodes[i].tolist() if n not in raw.numbers]
            where, given = f"mesh element {one.numbers[i]}", f"node {missing[0]}"
            yield Fault(where, given, "a node of the file", "there is no such node", "export it again from Gmsh")


def _format_tags(numbers: IntArray) -> str:
    """Return a shortened list of element tags."""
    told = ", ".join(map(str, numbers[:3].tolist()))
    return f"{told}, ..." if len(numbers) > 3 else told


def _group_faults(group: ElementGroup, raw: GmshMesh) -> Iterator[Fault]:
    what = f"{len(group.numbers)} cells (elements {_format_tags(group.numbers)})"
    if group.kind not in (LINE, POINT):
        shape = f"{len(group.numbers)} cells of {group.nodes.shape[1]} nodes (elements {_format_tags(group.numbers)})"
        why, remedy = "members are beams", "mesh only curves, in order 1"
        yield Fault("mesh", shape, "lines of two nodes and points", why, remedy)
    elif group.kind == LINE and not _name(group, raw):
        why, remedy = "the group names the member", "add a physical curve"
        yield Fault("mesh", f"{what} without a physical group", "named line groups", why, remedy)
    elif _name(group, raw) and not re.fullmatch(NAME, _name(group, raw)):
        where, why = f"mesh group {_name(group, raw)!r}", "cases and results name the group"
        yield Fault(where, repr(_name(group, raw)), NAMES, why, "rename the physical group in Gmsh")
    elif group.kind == LINE and _member(group) is None:
        why = f"a member is a chain without branches, loops or gaps{_describe_breaks(group.nodes)}"
        where, remedy = f"mesh group {_name(group, raw)!r}", "give each chain its own group"
        yield Fault(where, what, "one open chain", why, remedy)


def _describe_breaks(pairs: IntArray) -> str:
    """Describe the nodes at which lines do not form a chain."""
    nodes, counts = np.unique(pairs, return_counts=True)
    if branches := nodes[counts > 2].tolist():
        return f"; node {branches[0]} has {int(counts[nodes == branches[0]][0])} lines"
    ends = nodes[counts == 1].tolist()
    return f"; it ends at nodes {', '.join(map(str, ends[:6]))}" if len(ends) > 2 else "; it has a loop"


def _length_faults(raw: GmshMesh) -> Iterator[Fault]:
    """Yield lines of zero length and coincident nodes."""
    size = float(np.ptp(raw.points, axis=0).max(initial=0.0)) or 1.0
    grid = np.round(raw.points / (_COINCIDENCE_TOLERANCE * size))
    _, place, counts = np.unique(grid, axis=0, return_inverse=True, return_counts=True)
    at = dict(zip(raw.numbers.tolist(), place.ravel().tolist(), strict=True))
    flat = [
        (number, a, b)
        for one in raw.elements
        if one.kind == LINE
        for number, (a, b) in zip(one.numbers.tolist(), one.nodes.tolist(), strict=True)
        if at[a] == at[b]
    ]
    for number, a, b in flat[:_MAX_FAULTS]:
        given, why = f"nodes {a} and {b} at the same place", "an element has a length"
        yield Fault(f"mesh element {number}", given, "two nodes apart", why, "merge the nodes or move one")
    inside = {at[a] for _, a, _ in flat}
    twice = [i for i in np.flatnonzero(counts > 1).tolist() if i not in inside]
    for i in twice[:_MAX_FAULTS]:
        here = raw.numbers[place.ravel() == i].tolist()
        given = ", ".join(f"{x:g}" for x in raw.points[raw.numbers == here[0]][0].tolist())
        where = f"mesh nodes {' and '.join(map(str, here[:3]))}"
        yield Fault(
            where, f"all at {given}", "one node at one place", "members meet only at a shared node", "merge them"
        )


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
    before = -1
    while following := [node for node in neighbours[order[-1]] if node != before]:
        before = order[-1]
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
    if path.suffix.lower() == ".inp":
        write_text(path, _format_inp(mesh), overwrite=overwrite)
        return
    groups = [(LINE, name, np.column_stack([line[:-1], line[1:]])) for name, line in mesh.lines.items()]
    groups += [(POINT, name, index[:, None]) for name, index in mesh.points.items()]
    write_text(path, msh_text(mesh.nodes, groups), overwrite=overwrite)


def _format_inp(mesh: Mesh) -> str:
    """Return nodes, elements, a set of elements per member and a set of nodes per named point."""
    import meshio  # pyright: ignore[reportMissingTypeStubs]

    blocks: Any = [("line", np.column_stack([line[:-1], line[1:]])) for line in mesh.lines.values()]
    nothing = np.zeros(0, dtype=np.intp)
    sets: Any = {
        name: [np.arange(len(pairs)) if i == k else nothing for i, (_, pairs) in enumerate(blocks)]
        for k, name in enumerate(mesh.lines)
    }
    points: Any = dict(mesh.points)
    text = io.StringIO()
    whole = meshio.Mesh(mesh.nodes, blocks, cell_sets=sets, point_sets=points)
    meshio.abaqus.write(text, whole)  # pyright: ignore
    return text.getvalue().replace("TYPE=B31H", "TYPE=B31")  # the two-node beam element that Abaqus and CalculiX share
