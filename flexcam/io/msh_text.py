"""Text of Gmsh files of format 2.2."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence

from flexcam.io.msh import LINE
from flexcam.linalg import FloatArray, IntArray

Group = tuple[int, str, IntArray]
"""Gmsh's type of its elements, its name, and the places of their nodes, shape (k, m)."""


def msh_text(nodes: FloatArray, groups: Sequence[Group]) -> str:
    r"""Return a Gmsh file of format 2.2, in which every number keeps all of its digits."""
    named = [f'{int(kind == LINE)} {tag} "{name}"' for tag, (kind, name, _) in enumerate(groups, start=1)]
    placed = [f"{i} {' '.join(map(repr, place))}" for i, place in enumerate(nodes.tolist(), start=1)]
    joined = [f"{i} {one}" for i, one in enumerate(_elements(groups), start=1)]
    return "".join([
        "$MeshFormat\n2.2 0 8\n$EndMeshFormat\n",
        _section("PhysicalNames", named), _section("Nodes", placed), _section("Elements", joined),
    ])  # fmt: skip


def _elements(groups: Sequence[Group]) -> Iterator[str]:
    """Yield type, two tags and nodes of every element; the curve or point it lies on has the number of the group."""
    for tag, (kind, _, nodes) in enumerate(groups, start=1):
        for row in (nodes + 1).tolist():
            yield f"{kind} 2 {tag} {tag} {' '.join(map(str, row))}"


def _section(name: str, lines: Iterable[str]) -> str:
    rows = list(lines)
    return "\n".join([f"${name}", str(len(rows)), *rows, f"$End{name}", ""])
