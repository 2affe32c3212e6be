"""Gmsh mesh files, read and written through meshio with its traps caught.

Line groups become members (each must be one chain), point groups become named points. meshio's own `read` ends the
process on a bad file; its Gmsh module raises instead and is called here directly.
"""

from __future__ import annotations

import io
import re
from contextlib import redirect_stderr, redirect_stdout
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from flexcam.checks import Fault, InputError, did_you_mean, refuse
from flexcam.fem import Mesh
from flexcam.io.target import free_to_write
from flexcam.linalg import IntArray

_DIMENSIONS = {"vertex": 0, "line": 1}
"""Cells a mesh of members may have; anything else is a curve of higher order, a surface or a solid."""


def read_mesh(path: Path) -> Mesh:
    """Read a Gmsh file (2.2 or 4.1).

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
        If there is no such file, it is no Gmsh file, or its groups make no members.

    Examples
    --------
    ``read_mesh(Path("meshes/tayeb-3.msh")).lines["camshaft"]`` are the nodes of the camshaft in order.
    """
    if path.suffix.lower() != ".msh":
        raise refuse("mesh", path.name, "a Gmsh file (.msh)", "other formats lose the names of groups")
    if not path.is_file():
        near = did_you_mean(path.name, [other.name for other in path.parent.glob("*.msh")])
        raise refuse("mesh", str(path), "an existing file", "the path is relative to the case file", near)
    raw = _gmsh(path)
    groups = _groups(raw, _physical_names(path))
    faults = [fault for group in groups for fault in _group_faults(group)]
    lines = {group.name: _chain(group.nodes) for group in groups if group.dimension == 1}
    points = {group.name: np.unique(group.nodes) for group in groups if group.dimension == 0 and group.name}
    if not lines and not faults:
        faults.append(Fault("mesh", "no lines", "at least one line group", "", "add a physical curve"))
    if faults:
        raise InputError(faults)
    return Mesh(raw.points, {name: chain for name, chain in lines.items() if chain is not None}, points)


def _gmsh(path: Path) -> Any:  # noqa: ANN401 - meshio has no types
    from meshio import ReadError, gmsh  # pyright: ignore[reportMissingTypeStubs] - only a mesh file needs it

    try:
        with redirect_stdout(io.StringIO()), redirect_stderr(io.StringIO()):  # meshio talks
            return gmsh.read(path)  # pyright: ignore[reportUnknownMemberType, reportUnknownVariableType]
    except (ReadError, OSError, ValueError, LookupError, AssertionError, TypeError) as fault:  # what bad files raise
        why = str(fault) or type(fault).__name__
        raise refuse("mesh", str(path), "a Gmsh file of format 2.2 or 4.1", why, "export it again from Gmsh") from None


@dataclass(frozen=True, eq=False)
class _Group:
    """Cells of one physical group: its name (empty if unnamed), dimension (2 for all else) and nodes per cell."""

    name: str
    dimension: int
    nodes: IntArray


def _physical_names(path: Path) -> dict[tuple[int, int], str]:
    """Return dimension and tag to name; meshio keeps only one of a member and a point of the same name."""
    section = path.read_bytes().partition(b"$PhysicalNames")[2].partition(b"$EndPhysicalNames")[0]
    rows = re.findall(r'^\s*(\d+)\s+(\d+)\s+"(.*)"\s*$', section.decode("utf-8", "replace"), re.M)
    return {(int(dimension), int(tag)): name for dimension, tag, name in rows}


def _groups(raw: Any, names: dict[tuple[int, int], str]) -> list[_Group]:  # noqa: ANN401
    tags = raw.cell_data.get("gmsh:physical", [np.zeros(len(block.data), int) for block in raw.cells])
    parts: dict[tuple[int, int, int], list[IntArray]] = {}
    for block, block_tags in zip(raw.cells, tags, strict=True):
        cells = np.asarray(block.data)
        key = (_DIMENSIONS.get(block.type, 2), cells.shape[1])
        for tag in np.unique(block_tags).tolist():
            parts.setdefault((*key, int(tag)), []).append(cells[block_tags == tag])
    return [_Group(names.get((d, tag), ""), d, np.concatenate(cells)) for (d, _, tag), cells in parts.items()]


def _group_faults(group: _Group) -> list[Fault]:
    what = f"{len(group.nodes)} cells"
    if group.dimension > 1:
        shape = f"{what} of {group.nodes.shape[1]} nodes"
        return [
            Fault("mesh", shape, "lines of two nodes and points", "members are beams", "mesh only curves, in order 1")
        ]
    if group.dimension == 1 and not group.name:
        why = "the group names the member"
        return [Fault("mesh", f"{what} without a physical group", "named line groups", why, "add a physical curve")]
    if group.dimension == 1 and _chain(group.nodes) is None:
        why = "a member is a chain without branches, loops or gaps"
        return [Fault(f"mesh group {group.name!r}", what, "one open chain", why, "give each chain its own group")]
    return []


def _chain(pairs: IntArray) -> IntArray | None:
    """Return the nodes of an open chain in order, in the direction of its lines; None if it is no such chain."""
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
    """Write a mesh as Gmsh 2.2 text, the format in which meshio keeps all group names.

    Parameters
    ----------
    mesh
        The mesh.
    path
        The file; its folder exists.
    overwrite
        Whether an existing file may be replaced.

    Raises
    ------
    InputError
        If the file exists and may not be replaced, or a member and a point have one name, which Gmsh 2.2 cannot say.

    Examples
    --------
    ``write_mesh(flexcam.fem.generate.published_model(3), Path("tayeb-3.msh"))``
    """
    import meshio  # pyright: ignore[reportMissingTypeStubs]

    free_to_write("mesh file", path, overwrite=overwrite)
    if both := sorted(set(mesh.lines) & set(mesh.points)):
        raise refuse("mesh file", f"a member and a point named {both[0]!r}", "different names", "", "rename one")
    groups = [(1, name, np.column_stack([line[:-1], line[1:]])) for name, line in mesh.lines.items()]
    groups += [(0, name, index[:, None]) for name, index in mesh.points.items()]
    cells: Any = [("line" if dimension else "vertex", nodes) for dimension, _, nodes in groups]
    tags: Any = [np.full(len(nodes), tag) for tag, (_, _, nodes) in enumerate(groups, start=1)]
    fields = {name: np.array([tag, dimension]) for tag, (dimension, name, _) in enumerate(groups, start=1)}
    data = {"gmsh:physical": tags, "gmsh:geometrical": tags}
    file = meshio.Mesh(mesh.nodes, cells, cell_data=data, field_data=fields)
    file.write(path, file_format="gmsh22", binary=False)  # pyright: ignore[reportUnknownMemberType]
