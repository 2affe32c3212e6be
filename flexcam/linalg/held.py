"""Solve with a matrix and a soft hold of a few of its motions."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from flexcam.linalg.factor import DENSE_LIMIT, Factor, diagonal_scale, factorize
from flexcam.linalg.nullspace import pins
from flexcam.linalg.triplets import FloatArray, Triplets


@dataclass(frozen=True, eq=False)
class _Changed:
    """Solves with A + U D U^T by what solves with A: M. A. Woodbury, Inverting Modified Matrices (1950)."""

    base: Factor
    vectors: FloatArray
    answers: FloatArray
    small: FloatArray

    def solve(self, right: FloatArray) -> FloatArray:
        x = self.base.solve(right)
        return x - self.answers @ np.linalg.solve(self.small, self.vectors.T @ x)


def factorize_held(matrix: Triplets, motions: FloatArray, stiffness: float) -> Factor:
    """Return the factorization of ``A + k F F^T``.

    The hold couples everything that moves with everything else, so for many unknowns it is not formed: one unknown per
    motion is held in its place, and the difference, of few vectors, is put right in every answer.
    """
    if not motions.shape[1]:
        return factorize(matrix)
    if matrix.size <= DENSE_LIMIT:
        return factorize(Triplets.joined([matrix, *(Triplets.outer(f, f, stiffness) for f in motions.T)]))
    scale = diagonal_scale(matrix)
    at = np.array(pins(np.linalg.qr(motions / scale[:, None])[0]))
    size = 1.0 / scale[at] ** 2
    base = factorize(matrix + Triplets(matrix.size, at, at, size))
    single = np.zeros((matrix.size, len(at)))
    single[at, np.arange(len(at))] = 1.0
    vectors = np.hstack([motions, single])
    answers = base.solve(vectors)
    added = np.concatenate([np.full(motions.shape[1], 1.0 / stiffness), -1.0 / size])
    return _Changed(base, vectors, answers, np.diag(added) + vectors.T @ answers)
