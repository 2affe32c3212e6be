"""Solve with one matrix many times: a dense inverse for small systems, a band or sparse LU above."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Protocol

import numpy as np

from flexcam.checks import FlexcamError
from flexcam.linalg.band import band_factor

if TYPE_CHECKING:
    from collections.abc import Callable

    from scipy.sparse import csc_array, csr_array

    from flexcam.linalg.triplets import FloatArray, Triplets

DENSE_LIMIT = 300
"""Up to this many unknowns a dense product beats a sparse one, and scipy need not be imported."""


class SingularMatrixError(FlexcamError, ArithmeticError):
    """The matrix has no inverse: some motion has neither mass nor stiffness.

    Parameters
    ----------
    unknowns
        Positions of unknowns that take part in that motion, where they are known.
    """

    def __init__(self, unknowns: tuple[int, ...] = ()) -> None:
        self.unknowns = unknowns
        super().__init__(f"the matrix is singular at unknowns {list(unknowns)}")


class Factor(Protocol):
    """Something that solves ``A x = b`` for one fixed A."""

    def solve(self, right: FloatArray) -> FloatArray:
        """Return x for a right-hand side of shape (n,) or (n, k)."""
        ...


@dataclass(frozen=True, eq=False)
class _Inverse:
    inverse: FloatArray

    def solve(self, right: FloatArray) -> FloatArray:
        return self.inverse @ right


@dataclass(frozen=True, eq=False)
class _SparseLU:
    lu_solve: Callable[[FloatArray], FloatArray]
    scale: FloatArray

    def solve(self, right: FloatArray) -> FloatArray:
        scale = self.scale if right.ndim == 1 else self.scale[:, None]
        return scale * self.lu_solve(scale * right)


def diagonal_scale(matrix: Triplets) -> FloatArray:
    """Return 1/sqrt of the diagonal: it removes the units, so that translations and rotations compare."""
    diagonal = np.abs(matrix.diagonal())
    return 1.0 / np.sqrt(np.where(diagonal > 0.0, diagonal, 1.0))


def factorize(matrix: Triplets) -> Factor:
    """Return the factorization of a symmetric matrix."""
    scale = diagonal_scale(matrix)
    if matrix.size <= DENSE_LIMIT:
        return _dense_inverse(scale[:, None] * matrix.dense() * scale, scale)
    return _sparse(matrix, scale)


def _dense_inverse(scaled: FloatArray, scale: FloatArray) -> _Inverse:
    try:
        inverse = np.linalg.inv(scaled)
    except np.linalg.LinAlgError:
        raise SingularMatrixError(_null_unknowns(scaled)) from None
    if not np.isfinite(inverse).all() or np.abs(inverse).max(initial=0.0) > 1.0 / np.finfo(float).eps:
        raise SingularMatrixError(_null_unknowns(scaled))
    return _Inverse(scale[:, None] * inverse * scale)


def _null_unknowns(scaled: FloatArray) -> tuple[int, ...]:
    """Return the unknowns that move most in the motion the matrix does not resist."""
    return _largest(np.linalg.svd(scaled)[2][-1])


def _largest(motion: FloatArray) -> tuple[int, ...]:
    size = np.abs(motion)
    return tuple(np.flatnonzero(size > 0.5 * size.max()).tolist())


def _sparse(matrix: Triplets, scale: FloatArray) -> Factor:
    from scipy.sparse import diags_array

    spread = diags_array(scale)
    scaled = (spread @ matrix.csr() @ spread).tocsr()
    return band_factor(scaled, scale) or _sparse_lu(scaled.tocsc(), scale)


def _sparse_lu(scaled: csc_array, scale: FloatArray) -> _SparseLU:
    from scipy.sparse import eye_array
    from scipy.sparse.linalg import splu

    options = {"SymmetricMode": True}
    try:
        lu = splu(scaled, permc_spec="MMD_AT_PLUS_A", options=options)
        regular = bool(np.abs(lu.U.diagonal()).min() > np.finfo(float).eps)
    except RuntimeError:  # SuperLU's only sign of an exactly zero pivot
        lu, regular = None, False
    if lu is None or not regular:
        # Inverse iteration: the shift finds the motion without stiffness, it solves nothing.
        shifted = splu((scaled + 1e-8 * eye_array(len(scale))).tocsc(), permc_spec="MMD_AT_PLUS_A", options=options)
        motion = np.random.default_rng(0).standard_normal(len(scale))
        for _ in range(3):
            motion = shifted.solve(motion / np.linalg.norm(motion))
        raise SingularMatrixError(_largest(motion))
    return _SparseLU(lu.solve, scale)


def operator(matrix: Triplets) -> FloatArray | csr_array:
    """Return the form of the matrix whose products are fastest at its size."""
    return matrix.dense() if matrix.size <= DENSE_LIMIT else matrix.csr()
