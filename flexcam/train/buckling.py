"""How much compression the members of a train bear, and how much of it a run uses."""

from __future__ import annotations

import math

import numpy as np

from flexcam import fem
from flexcam.linalg import null_space, pins
from flexcam.train.structure import Structure


def buckling_load(structure: Structure, member: str) -> float:
    """Return the axial compression at which a member buckles by itself in its supports.

    The lowest P of ``K + P Kg(-1)`` over the member's own elements, held where the model holds its nodes; what other
    members add is left out, so that the load is Euler's for a pushrod between guides.

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
    K, G = K.part(used), G.part(used)
    free = null_space(K)
    kept = np.setdiff1d(np.arange(len(used)), pins(np.linalg.qr(free)[0]) if free.shape[1] else [])
    if not len(kept):
        return math.inf
    root = np.linalg.cholesky(K.part(kept).dense())
    scaled = np.linalg.solve(root, np.linalg.solve(root, -G.part(kept).dense()).T)
    largest = float(np.linalg.eigvalsh(0.5 * (scaled + scaled.T)).max())
    return 1.0 / largest if largest > 1e-12 * float(np.abs(scaled).max(initial=1.0)) else math.inf
