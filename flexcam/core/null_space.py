"""Null space of a stiffness matrix: rigid-body motions and mechanisms."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from flexcam.core.factorization import Factor, diagonal_scale, factorize
from flexcam.core.matrices import DENSE_LIMIT, FloatArray, Triplets

_ROUNDING = 64.0 * np.finfo(float).eps
"""Eigenvalues of the diagonally scaled matrix below this are rounding: each entry of K has an error of one eps."""

_MAX_DIMENSION = 24
"""Maximum dimension searched in a sparse matrix: six rigid-body motions for each of four unconnected parts."""


def null_space(matrix: Triplets) -> FloatArray:
    """Return a basis of the null space of a symmetric matrix.

    For a beam structure `flexcam.fem.rigid_bodies.free_motions` gives the exact motions. This function returns the
    eigenvectors whose eigenvalues are rounding; on a mesh of thousands of elements this includes the softest elastic
    motions.

    The matrix is first scaled to a unit diagonal, so the result does not depend on units. Above a few hundred unknowns
    the smallest eigenvalues are computed by shift-invert Lanczos; the shift is not added to the stiffness.
    """
    if matrix.size == 0:
        return np.zeros((0, 0))
    scale = diagonal_scale(matrix)
    search = _dense_motions if matrix.size <= 2 * DENSE_LIMIT else _lanczos_motions
    return scale[:, None] * search(matrix, scale)


def _dense_motions(matrix: Triplets, scale: FloatArray) -> FloatArray:
    values, vectors = np.linalg.eigh(scale[:, None] * matrix.dense() * scale)
    return vectors[:, values < _ROUNDING]


def _lanczos_motions(matrix: Triplets, scale: FloatArray) -> FloatArray:
    from scipy.sparse import diags_array
    from scipy.sparse.linalg import eigsh

    spread = diags_array(scale)
    scaled = (spread @ matrix.csr() @ spread).tocsc()
    start = np.random.default_rng(0).standard_normal(matrix.size)
    shift = -1e-10
    values, vectors = eigsh(scaled, k=min(_MAX_DIMENSION, matrix.size - 2), sigma=shift, v0=start)
    return vectors[:, np.abs(values) < _ROUNDING]


def select_constraints(motions: FloatArray) -> list[int]:
    """Return one unknown per motion such that fixing these unknowns removes all the motions.

    Gaussian elimination with row pivots.
    """
    held: list[int] = []
    rest = motions.copy()
    for _ in range(motions.shape[1]):
        held.append(int(np.argmax(np.linalg.norm(rest, axis=1))))
        along = rest[held[-1]] / np.linalg.norm(rest[held[-1]])
        rest -= np.outer(rest @ along, along)
    return held


@dataclass(frozen=True, eq=False)
class _LowRankUpdate:
    """Solver for A + U D U^T based on a solver for A: M. A. Woodbury, Inverting Modified Matrices (1950)."""

    base: Factor
    vectors: FloatArray
    answers: FloatArray
    small: FloatArray

    def solve(self, right: FloatArray) -> FloatArray:
        """Solve, see `Factor`."""
        x = self.base.solve(right)
        return x - self.answers @ np.linalg.solve(self.small, self.vectors.T @ x)


def factorize_with_update(matrix: Triplets, motions: FloatArray, stiffness: float) -> Factor:
    """Return the factorization of ``A + k F F^T``.

    The term ``k F F^T`` couples all moving unknowns, so it is not formed for many unknowns: one unknown per motion is
    constrained instead, and a low-rank update corrects each solution.
    """
    if not motions.shape[1]:
        return factorize(matrix)
    if matrix.size <= DENSE_LIMIT:
        return factorize(Triplets.sum([matrix, *(Triplets.outer(f, f, stiffness) for f in motions.T)]))
    scale = diagonal_scale(matrix)
    at = np.array(select_constraints(np.linalg.qr(motions / scale[:, None])[0]))
    size = 1.0 / scale[at] ** 2
    base = factorize(matrix + Triplets(matrix.size, at, at, size))
    single = np.zeros((matrix.size, len(at)))
    single[at, np.arange(len(at))] = 1.0
    vectors = np.hstack([motions, single])
    answers = base.solve(vectors)
    added = np.concatenate([np.full(motions.shape[1], 1.0 / stiffness), -1.0 / size])
    return _LowRankUpdate(base, vectors, answers, np.diag(added) + vectors.T @ answers)
