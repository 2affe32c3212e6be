"""How much compression the members of a train bear, and how much of it a run uses."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from flexcam import fem
from flexcam.linalg import FloatArray, null_space, pins
from flexcam.train.structure import Structure


def buckling_load(structure: Structure, member: str) -> float:
    """Return the axial compression at which a member buckles by itself in its supports.

    The lowest P of ``K + P Kg(-1)`` over the member's own elements, held where the model holds its nodes; what other
    members and springs add is left out, so that the load is Euler's for a pushrod between guides. A motion that the
    supports leave free bends nothing: its ends are taken as hinged there.

    Parameters
    ----------
    structure
        The structure.
    member
        Name of the member.

    Returns
    -------
    float
        N; infinite where the supports leave nothing to buckle.

    Examples
    --------
    A pushrod guided at both ends bears ``pi^2 E I/L^2``.
    """
    alone = structure.beams.part(structure.model.mesh.element_ranges()[member])
    K, G = fem.stiffness(alone, structure.dofs), fem.geometric(alone, np.full(len(alone), -1.0), structure.dofs)
    numbers = structure.dofs.numbers[np.unique(alone.nodes)]
    used = np.unique(numbers[numbers >= 0])
    K, squeezed = K.part(used), -G.part(used).dense()
    free = np.linalg.qr(null_space(K))[0]
    kept = np.setdiff1d(np.arange(len(used)), pins(free) if free.shape[1] else [])
    if not len(kept):
        return math.inf
    ends = np.isin(used, structure.dofs.numbers[[alone.nodes[0, 0], alone.nodes[-1, 1]], :3])
    pressed = _hinged(squeezed, free, ends)[np.ix_(kept, kept)]
    root = np.linalg.cholesky(K.part(kept).dense())
    scaled = np.linalg.solve(root, np.linalg.solve(root, pressed).T)
    largest = float(np.linalg.eigvalsh(0.5 * (scaled + scaled.T)).max())
    return 1.0 / largest if largest > 1e-12 * float(np.abs(scaled).max(initial=1.0)) else math.inf


def _hinged(pressed: FloatArray, free: FloatArray, ends: NDArray[np.bool_]) -> FloatArray:
    """Return a geometric stiffness where every deflection comes with the free motion that leaves the ends in place.

    A free motion costs no strain, so that it may be chosen: the least motion of the ends in the free motions' pattern
    is none. Twist does not move the ends; the pseudo-inverse leaves it out.
    """
    seen = free * ends[:, None]
    still = np.eye(len(free)) - free @ np.linalg.pinv(free.T @ seen, rcond=_UNMOVED, hermitian=True) @ seen.T
    return still.T @ pressed @ still


_UNMOVED = 1e-14
"""Part of the largest square of the ends' motion that counts as none."""
