"""Shapes that condense a `System`: everything follows statically from few motions."""

from __future__ import annotations

import numpy as np

from flexcam.checks import refuse
from flexcam.linalg import DENSE_LIMIT, FloatArray
from flexcam.system import System

_UNSEEN = 1e-9
"""Singular value below which a motion without strain is not seen by what is kept."""


def static_shapes(system: System, rows: FloatArray) -> FloatArray:
    """Return how everything follows when some motions are given and nothing else is loaded."""
    n, m = system.size, len(rows)
    if n > 2 * DENSE_LIMIT:
        raise refuse(
            "chain", f"a model of {n} unknowns", f"up to {2 * DENSE_LIMIT}", "shapes are full", "fewer elements"
        )
    still = _unseen(np.zeros((n, 0)) if system.free is None else system.free, rows)
    held = np.concatenate([rows, still.T])
    K = system.stiffness.dense()
    scale = float(np.abs(np.diagonal(K)).max(initial=0.0)) or 1.0
    whole = np.block([[K / scale, held.T], [held, np.zeros((len(held), len(held)))]])
    given = np.zeros((n + len(held), m))
    given[n : n + m] = np.eye(m)
    return np.asarray(np.linalg.solve(whole, given)[:n], dtype=np.float64)


def _unseen(free: FloatArray, rows: FloatArray) -> FloatArray:
    """Return the motions without strain that rows do not see, orthonormal, shape (n, k)."""
    basis = np.linalg.qr(free)[0]
    _, values, vectors = np.linalg.svd(rows @ basis)
    seen = int(np.count_nonzero(values > _UNSEEN))
    return np.asarray(basis @ vectors[seen:].T, dtype=np.float64)


def rigid_lumped(mass: FloatArray, moved: FloatArray, count: int) -> FloatArray:
    """Return a mass matrix whose first unknowns have a mass each, with the same momentum in a rigid motion."""
    lump = mass.copy()
    own = moved[:count]
    lump[:count, :count] = np.diag(mass[:count, :count] @ own / own)
    return lump
