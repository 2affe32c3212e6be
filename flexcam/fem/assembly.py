"""Assemble element matrices, many at once, into the matrix of the free components."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from flexcam.fem.dofs import DofMap
from flexcam.fem.elements import beam
from flexcam.fem.elements.beam import Beams
from flexcam.linalg import FloatArray, IntArray, Triplets

_AT_ONCE = 1000
"""Elements whose matrices are in memory together: as many as the processor's cache holds."""


def assemble(beams: Beams, local: FloatArray, dofs: DofMap) -> Triplets:
    """Return the matrix of the free components from element matrices in local axes."""
    return _assembled(beams, lambda part: local[part], dofs)


def _assembled(beams: Beams, local: Callable[[slice], FloatArray], dofs: DofMap) -> Triplets:
    """Return the assembled matrix of element matrices that are made part by part.

    The triplets are written where they stay; what full element matrices would need beyond is reserved, never touched.
    """
    most = 144 * len(beams)
    rows, cols, values = np.empty(most, np.intp), np.empty(most, np.intp), np.empty(most)
    end = 0
    for first in range(0, len(beams), _AT_ONCE):
        part = slice(first, first + _AT_ONCE)
        found = _entries(beams.part(part), local(part), dofs)
        begin, end = end, end + len(found[0])
        for whole, one in zip((rows, cols, values), found, strict=True):
            whole[begin:end] = one
    return Triplets(dofs.size, rows[:end], cols[:end], values[:end])


def _entries(beams: Beams, local: FloatArray, dofs: DofMap) -> tuple[IntArray, IntArray, FloatArray]:
    """Return rows, columns and values of the entries of some elements."""
    matrices = beam.to_global(beams, local)
    unknowns = dofs.numbers[beams.nodes].reshape(-1, 12)
    free = unknowns >= 0
    keep = (matrices != 0.0) & free[:, :, None] & free[:, None, :]
    rows = np.broadcast_to(unknowns[:, :, None], matrices.shape)
    cols = np.broadcast_to(unknowns[:, None, :], matrices.shape)
    return rows[keep], cols[keep], matrices[keep]


def stiffness(beams: Beams, dofs: DofMap) -> Triplets:
    """Return the assembled elastic stiffness, SI."""
    return _assembled(beams, lambda part: beam.stiffness(beams.part(part)), dofs)


def mass(beams: Beams, dofs: DofMap) -> Triplets:
    """Return the assembled mass of the beams, SI."""
    return _assembled(beams, lambda part: beam.mass(beams.part(part)), dofs)


def geometric(beams: Beams, axial_force: FloatArray, dofs: DofMap) -> Triplets:
    """Return the assembled geometric stiffness under given axial forces."""
    return _assembled(beams, lambda part: beam.geometric(beams.part(part), axial_force[part]), dofs)
