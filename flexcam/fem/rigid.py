"""Motions of a structure without strain: exact, from its connections, supports and springs.

A beam joined rigidly to others has no strain only when its whole part moves as a rigid body. So the stiffness of any
structure leaves free just those of six motions per connected part that no support and no spring resists; a node on no
member that moves by itself is such a part. They are found
from that small set, not from eigenvalues of the stiffness: on a fine mesh its lowest true eigenvalue falls like n^-4
into rounding, and would be taken for a mechanism.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np

from flexcam.fem.dofs import DofMap
from flexcam.fem.mesh import Mesh
from flexcam.linalg import FloatArray, IntArray

_HELD = 1e-10
"""Singular values of the constraints below this are rounding: their rows are of size 1."""


def free_motions(mesh: Mesh, dofs: DofMap, springs: Iterable[FloatArray]) -> FloatArray:
    """Return a basis of the motions that cost no strain energy."""
    moved = mesh.on_members() | (dofs.numbers >= 0).any(axis=1)
    single = np.flatnonzero(moved & ~mesh.on_members())
    rigid = _rigid_motions(mesh, [*mesh.parts, *single[:, None]])
    nodal = int(np.count_nonzero(dofs.numbers >= 0))
    further = dofs.size - nodal  # unknowns behind the nodes': each is free by itself
    held = np.pad(rigid[moved[:, None] & (dofs.numbers < 0)], ((0, 0), (0, further)))
    free = np.zeros((dofs.size, rigid.shape[-1] + further))
    free[dofs.numbers[dofs.numbers >= 0], : rigid.shape[-1]] = rigid[dofs.numbers >= 0]
    free[nodal:, rigid.shape[-1] :] = np.eye(further)
    rows = np.concatenate([held, *(_stretched(row, free) for row in springs)])
    size = np.abs(rows).max(axis=1, initial=0.0)
    rows = rows[size > 0.0] / size[size > 0.0, None]
    small = np.linalg.qr(rows, mode="r")  # the same null space in few rows
    _, values, vectors = np.linalg.svd(small)
    rank = int(np.count_nonzero(values > _HELD * max(1.0, float(values.max(initial=0.0)))))
    return free @ vectors[rank:].T


def _stretched(row: FloatArray, free: FloatArray) -> FloatArray:
    """Return the product of a row of few entries with motions, shape (1, k)."""
    at = np.flatnonzero(row != 0.0)
    return row[None, at] @ free[at]


def _rigid_motions(mesh: Mesh, parts: Sequence[IntArray]) -> FloatArray:
    """Return six motions per part, shape (nodes, 6, 6 parts); rotations about the part's middle, scaled by its size."""
    motions = np.zeros((len(mesh.nodes), 6, 6 * len(parts)))
    for p, nodes in enumerate(parts):
        arm = mesh.nodes[nodes] - mesh.nodes[nodes].mean(axis=0)
        size = float(np.linalg.norm(arm, axis=1).max()) or 1.0  # of a node by itself
        for i, unit in enumerate(np.eye(3)):
            motions[nodes, i, 6 * p + i] = 1.0
            motions[nodes, :3, 6 * p + 3 + i] = np.cross(unit, arm) / size
            motions[nodes, 3 + i, 6 * p + 3 + i] = 1.0 / size
    return motions
