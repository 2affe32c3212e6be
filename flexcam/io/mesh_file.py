"""Gmsh mesh files, read and written through meshio with its traps caught.

Line groups become members (each must be one chain), point groups become named points. meshio's own `read` ends the
process on a bad file; its Gmsh module raises instead and is called here directly.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from flexcam.checks import Fault, InputError, refuse
from flexcam.fem import Mesh
from flexcam.linalg import IntArray


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
    """
    if path.suffix.lower() != ".msh":
        raise refuse("mesh", path.name, "a Gmsh file (.msh)", "other formats lose the names of groups")
    if not path.is_file():
        raise refuse("mesh", str(path), "an existing file", "", "paths are relative to the case file")
    raw = _gmsh(path)
    names = {(int(d), int(tag)): str(name) for name, (tag, d) in raw.field_data.items()}
    lines, points, faults = _groups(raw, names)
    if faults:
        raise InputError(faults)
    return Mesh(raw.points, lines, points)


def _gmsh(path: Path) -> Any:  # noqa: ANN401 - meshio has no types
    from meshio import ReadError, gmsh  # noqa: PLC0415 - only cases with a mesh file need it

    try:
        return gmsh.read(path)
    except (ReadError, OSError, ValueError, IndexError, KeyError, AssertionError, UnicodeDecodeError) as fault:
        why = str(fault) or type(fault).__name__
        raise refuse("mesh", str(path), "a Gmsh file of format 2.2 or 4.1", why, "export it again from Gmsh") from None


def _groups(raw: Any, names: dict[tuple[int, int], str]) -> tuple[dict[str, IntArray], dict[str, IntArray], list[Fault]]:  # noqa: ANN401
    lines: dict[str, IntArray] = {}
    points: dict[str, IntArray] = {}
    faults: list[Fault] = []
    cells = _cells_by_group(raw)
    for (dimension, tag), nodes in cells.items():
        name = names.get((dimension, tag))
        if dimension > 1:
            faults.append(Fault("mesh", f"cells of dimension {dimension}", "lines and points", "members are beams", "mesh only curves"))
        elif dimension == 1 and name is None:
            faults.append(Fault("mesh", "lines without a physical group", "named line groups", "the group names the member", "add a physical curve"))
        elif dimension == 1 and name is not None:
            chain = _chain(nodes)
            lines[name] = chain if chain is not None else nodes[:, 0]
            if chain is None:
                why = "a member is a chain without branches, loops or gaps"
                faults.append(Fault(f"mesh group {name!r}", f"{len(nodes)} lines", "one open chain", why, "give each chain its own group"))
        elif name is not None:
            points[name] = np.unique(nodes)
    if not lines and not faults:
        faults.append(Fault("mesh", "no lines", "at least one line group", "", "add a physical curve"))
    return lines, points, faults


def _cells_by_group(raw: Any) -> dict[tuple[int, int], IntArray]:  # noqa: ANN401
    tags = raw.cell_data.get("gmsh:physical", [np.zeros(len(block.data), int) for block in raw.cells])
    parts: dict[tuple[int, int], list[IntArray]] = {}
    for block, block_tags in zip(raw.cells, tags, strict=True):
        dimension = {"vertex": 0, "line": 1}.get(block.type, 2)
        if dimension == 1 and block.data.shape[1] != 2:
            dimension = 2
        for tag in np.unique(block_tags).tolist():
            parts.setdefault((dimension, int(tag)), []).append(np.asarray(block.data)[block_tags == tag])
    return {key: np.concatenate(blocks) for key, blocks in parts.items() if key[0] > 1 or len({b.shape[1] for b in blocks}) == 1}


def _chain(pairs: IntArray) -> IntArray | None:
    """Return the nodes of an open chain in order, starting where the first line of the file points away from."""
    neighbours: dict[int, list[int]] = {}
    for a, b in pairs.tolist():
        neighbours.setdefault(a, []).append(b)
        neighbours.setdefault(b, []).append(a)
    ends = [node for node, near in neighbours.items() if len(near) == 1]
    if len(ends) != 2 or any(len(near) > 2 for near in neighbours.values()):
        return None
    starts = set(pairs[:, 0].tolist())
    start = next((e for e in ends if e in starts), ends[0])
    order = [start]
    while len(order) <= len(pairs):
        following = [n for n in neighbours[order[-1]] if len(order) < 2 or n != order[-2]]
        if not following:
            break
        order.append(following[0])
    return np.array(order, dtype=np.intp) if len(order) == len(pairs) + 1 else None


def write_mesh(mesh: Mesh, path: Path) -> None:
    """Write a mesh as Gmsh 2.2 text, the format in which meshio keeps all group names.

    Parameters
    ----------
    mesh
        The mesh.
    path
        The file; its folder exists.

    Raises
    ------
    InputError
        If the file exists.
    """
    import meshio  # noqa: PLC0415

    if path.exists():
        raise refuse("mesh file", str(path), "a file that does not exist yet", "nothing is written over", "remove it first")
    cells: list[tuple[str, IntArray]] = []
    tags: list[IntArray] = []
    fields: dict[str, IntArray] = {}
    groups = [(1, name, np.column_stack([line[:-1], line[1:]])) for name, line in mesh.lines.items()]
    groups += [(0, name, index[:, None]) for name, index in mesh.points.items()]
    for tag, (dimension, name, nodes) in enumerate(groups, start=1):
        fields[name] = np.array([tag, dimension])
        cells.append(("line" if dimension else "vertex", nodes))
        tags.append(np.full(len(nodes), tag))
    data = {"gmsh:physical": tags, "gmsh:geometrical": tags}
    meshio.Mesh(mesh.nodes, cells, cell_data=data, field_data=fields).write(path, file_format="gmsh22", binary=False)
