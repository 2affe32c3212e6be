"""Meshes in and out: Gmsh, Abaqus, CalculiX and MED.

Line groups become members (each must be one chain), point groups become named points.
"""

from __future__ import annotations

import io
import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import redirect_stderr, redirect_stdout
from pathlib import Path
from typing import Any, cast

import numpy as np

from flexcam.core import FloatArray, IntArray
from flexcam.core.errors import NAME, NAMES, Fault, InputError, refuse, suggest_name
from flexcam.fem.mesh import Mesh
from flexcam.io.files import READ_ERRORS, write_text
from flexcam.io.gmsh_file import LINE, OTHER, POINT, ElementGroup, MeshContent, format_gmsh, read_gmsh

_MAX_FAULTS = 20  # maximum number of reported faults of one kind: a mesh with thousands has one cause
_MAX_COORDINATE = 1e12  # maximum absolute coordinate, m: squares of larger ones overflow
_COINCIDENCE_TOLERANCE = 1e-9  # distance, relative to the mesh size, below which nodes count as coincident (rounding)


def read_mesh(path: Path) -> Mesh:
    """Read a mesh of Gmsh (2.2 or 4.1, text or binary), Abaqus or CalculiX, or of Salome in MED format.

    Parameters
    ----------
    path
        The file, ``.msh``, ``.inp`` or ``.med``; coordinates in m.

    Returns
    -------
    Mesh
        Nodes in the order of the file.

    Raises
    ------
    InputError
        If the file does not exist or cannot be read, or its groups do not form members; the message lists node and
        element tags of a Gmsh file, and numbers in the order of other files.

    Examples
    --------
    ``read_mesh(Path("meshes/tayeb-3.msh")).lines["camshaft"]`` are the nodes of the camshaft in order.
    """
    suffix = path.suffix.lower()
    if suffix not in _FORMATS:
        allowed = ", ".join(f"{ending} ({program})" for ending, program in _FORMATS.items())
        raise refuse("mesh", path.name, f"a mesh file: {allowed}", "other formats lose the names of groups")
    if not path.is_file():
        meshes = [file.name for file in path.parent.glob("*.*") if file.suffix.lower() in _FORMATS]
        near = suggest_name(path.name, meshes)
        raise refuse("mesh", str(path), "an existing file", "the path is relative to the case file", near)
    raw = read_gmsh(path) if suffix == ".msh" else _read_by_meshio(path)
    faults = [*_number_faults(raw), *(fault for group in raw.groups for fault in _group_faults(group))]
    members = [group for group in raw.groups if group.kind == LINE]
    if not (faults or members):
        raise refuse("mesh", "no lines", "line elements in named groups", "", "add a physical curve")
    if faults or (faults := [*_length_faults(raw)]):
        raise InputError(faults)
    place = np.argsort(raw.numbers, kind="stable")

    def index(numbers: IntArray) -> IntArray:
        return place[np.searchsorted(raw.numbers, numbers, sorter=place)]

    chains = ((group.name, _order_chain(group.nodes)) for group in members)
    lines = {name: index(chain) for name, chain in chains if chain is not None}
    points = {g.name: np.unique(index(g.nodes)) for g in raw.groups if g.kind == POINT and g.name}
    return Mesh(raw.points, lines, points)


_FORMATS = {".msh": "Gmsh", ".inp": "Abaqus, CalculiX", ".med": "Salome"}
_INCLUDE = re.compile(rb"^\s*\*\s*include\b", re.I | re.M)
_KINDS = {"line": LINE, "vertex": POINT}  # names of meshio


def _read_by_meshio(path: Path) -> MeshContent:
    """Read elements and nodes with their sets.

    meshio describes a damaged file on the terminal and may end the process.
    """
    import meshio  # pyright: ignore[reportMissingTypeStubs]

    try:
        if path.suffix.lower() == ".inp" and _INCLUDE.search(path.read_bytes()):
            why, remedy = "*INCLUDE refers to another file", "export the mesh without *INCLUDE"
            raise refuse("mesh", path.name, "a mesh in one file", why, remedy)
        with redirect_stdout(io.StringIO()), redirect_stderr(io.StringIO()):
            mesh = cast("Any", meshio.read(path))  # pyright: ignore[reportUnknownMemberType]
        points: FloatArray = np.asarray(mesh.points, dtype=float).reshape(-1, 3)
        tagged = _tagged_entries(getattr(mesh, "point_tags", {}), mesh.point_data.get("point_tags", []))
        groups = _group_elements(mesh)
    except InputError:
        raise
    except (*READ_ERRORS, SystemExit, meshio.ReadError):
        allowed, remedy = f"a mesh of {_FORMATS[path.suffix.lower()]}", "export it again, or as a Gmsh file (.msh)"
        raise refuse("mesh", path.name, allowed, "meshio cannot read it", remedy) from None
    numbers = np.arange(1, len(points) + 1)
    sets: dict[str, IntArray] = {**mesh.point_sets, **tagged}
    groups += [ElementGroup(POINT, name, index, numbers[index][:, None]) for name, index in sets.items() if len(index)]
    return MeshContent(numbers, points, groups)


def _group_elements(mesh: Any) -> list[ElementGroup]:  # noqa: ANN401 - meshio has no types
    """Return the elements by type and set, without sets that contain a whole other set, such as all elements."""
    starts = np.cumsum([0, *(len(block.data) for block in mesh.cells)])
    tags = np.concatenate([np.zeros(0), *mesh.cell_data.get("cell_tags", [])])
    indices: dict[str, IntArray] = _tagged_entries(getattr(mesh, "cell_tags", {}), tags)
    for name, parts in mesh.cell_sets.items():
        indices[name] = np.concatenate([np.add(*pair) for pair in zip(parts, starts, strict=False)])
    sets = {name: frozenset(index.tolist()) for name, index in indices.items() if len(index)}
    sets = {name: own for name, own in sets.items() if not any(other < own for other in sets.values())}
    sets[""] = frozenset(range(starts[-1])).difference(*sets.values())
    groups: list[ElementGroup] = []
    for kind in dict.fromkeys(block.type for block in mesh.cells):
        places = [k for k, block in enumerate(mesh.cells) if block.type == kind]
        numbers = np.concatenate([np.arange(starts[k], starts[k + 1], dtype=np.intp) for k in places])
        nodes: IntArray = np.concatenate([np.asarray(mesh.cells[k].data, dtype=np.intp) for k in places])
        for name, own in sets.items():
            chosen = np.isin(numbers, sorted(own))
            if chosen.any() and (name or kind != "vertex"):
                groups.append(ElementGroup(_KINDS.get(kind, OTHER), name, numbers[chosen] + 1, nodes[chosen] + 1))
    return groups


def _tagged_entries(names: Mapping[int, Sequence[str]], tags: Iterable[float]) -> dict[str, IntArray]:
    """Return the indices of the entries of each name: a tag may have several names."""
    found: dict[str, list[int]] = {}
    for i, tag in enumerate(tags):
        for name in names.get(int(tag), ()):
            found.setdefault(name, []).append(i)
    return {name: np.array(index, dtype=np.intp) for name, index in found.items()}


def _number_faults(raw: MeshContent) -> Iterator[Fault]:
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


def _group_faults(group: ElementGroup) -> Iterator[Fault]:
    count = len(group.numbers)
    tags = ", ".join(map(str, group.numbers[:3].tolist())) + (", ..." if count > 3 else "")
    what = f"{count} elements ({tags})"
    if group.kind not in (LINE, POINT):
        elements = f"{count} elements" if count > 1 else "an element"
        shape = f"{elements} of {group.nodes.shape[1]} nodes (element{'s' * (count > 1)} {tags})"
        why, remedy = "members are beams", "mesh only curves, in order 1"
        yield Fault("mesh", shape, "only points and two-node lines", why, remedy)
    elif group.kind == LINE and not group.name:
        why = "each member has the elements of the physical curve of its name"
        yield Fault("mesh", f"{what} in no named group", "line elements in named groups", why, "add a physical curve")
    elif group.name and not re.fullmatch(NAME, group.name):
        where, why = f"mesh group {group.name!r}", "cases and results name the group"
        yield Fault(where, repr(group.name), NAMES, why, "rename the physical group in Gmsh")
    elif group.kind == LINE and _order_chain(group.nodes) is None:
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


def _length_faults(raw: MeshContent) -> Iterator[Fault]:
    """Yield lines of zero length and coincident nodes."""
    size = float(np.ptp(raw.points, axis=0).max(initial=0.0)) or 1.0
    grid = np.round(raw.points / (_COINCIDENCE_TOLERANCE * size))
    _, place, counts = np.unique(grid, axis=0, return_inverse=True, return_counts=True)
    places = dict(zip(raw.numbers.tolist(), place.ravel().tolist(), strict=True))
    lines = [group for group in raw.groups if group.kind == LINE]
    pairs = [pair for group in lines for pair in zip(group.numbers.tolist(), group.nodes.tolist(), strict=True)]
    zero_length = [(number, a, b) for number, (a, b) in pairs if places[a] == places[b]]
    for number, a, b in zero_length[:_MAX_FAULTS]:
        given, why = f"nodes {a} and {b} at the same place", "an element needs a length"
        yield Fault(f"mesh element {number}", given, "two nodes apart", why, "merge the nodes or move one")
    reported = {places[a] for _, a, _ in zero_length}
    coincident = [i for i in np.flatnonzero(counts > 1).tolist() if i not in reported]
    for i in coincident[:_MAX_FAULTS]:
        tags = raw.numbers[place.ravel() == i].tolist()
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
    text = _format_inp(mesh) if path.suffix.lower() == ".inp" else format_gmsh(mesh)
    write_text(path, text, overwrite=overwrite)


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
