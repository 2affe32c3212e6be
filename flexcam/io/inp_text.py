"""Text of Abaqus and CalculiX input files."""

from __future__ import annotations

import io
from typing import Any

import numpy as np

from flexcam.fem import Mesh


def inp_text(mesh: Mesh) -> str:
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
    return text.getvalue().replace("TYPE=B31H", "TYPE=B31")  # the one beam of two nodes that both programs know
