"""Factorization of matrices: banded Cholesky, sparse LU and dense; null space of a stiffness.

The stiffness of long, thin structures (shafts, chains of beams) has a narrow band once the unknowns are renumbered by
levels from one end. A banded solve accesses memory in order and is two to three times as fast as a general sparse
factor; the factorization is ten times as fast. Reference: E. Cuthill and J. McKee, Reducing the bandwidth of sparse
symmetric matrices, Proc. 24th ACM Nat. Conf. (1969), in reverse order.
"""

from __future__ import annotations

from contextlib import suppress
from dataclasses import dataclass
from typing import TYPE_CHECKING, Protocol

import numpy as np

from flexcam.core.errors import FlexcamError
from flexcam.core.matrices import DENSE_LIMIT, FloatArray, IntArray, Triplets

if TYPE_CHECKING:
    from collections.abc import Callable

    from scipy.sparse import csc_array, csr_array

_MAX_BANDWIDTH = 64
"""Half bandwidth up to which the banded factor is faster: eight parallel shafts coupled at every node have 31."""

_ROUNDING = 8.0 * np.finfo(float).eps
"""Rounding tolerance of entries of size 1 that are sums of few terms."""


@dataclass(frozen=True, eq=False)
class BandFactor:
    """Cholesky factor of a symmetric, positive definite matrix with a narrow band."""

    upper: FloatArray  #: factor by diagonals, as LAPACK's `pbtrf` stores it, shape (w + 1, n)
    order: IntArray  #: unknown at each row of the band, shape (n,)
    scale: FloatArray  #: scale factors of the unknowns, in the order of the band, shape (n,)

    def solve(self, right: FloatArray) -> FloatArray:
        """Solve for a right-hand side of shape (n,) or (n, k)."""
        from scipy.linalg.lapack import dpbtrs

        if not right.size:
            return np.zeros(right.shape)
        scale = self.scale if right.ndim == 1 else self.scale[:, None]
        solution, _ = dpbtrs(self.upper, scale * right[self.order], overwrite_b=True)
        x = np.empty(right.shape)
        x[self.order] = scale * solution
        return x


def band_factor(scaled: csr_array, scale: FloatArray) -> BandFactor | None:
    """Return the banded factor of a matrix; None unless it is symmetric, positive definite and of narrow band."""
    from scipy.linalg.lapack import dpbtrf
    from scipy.sparse.csgraph import reverse_cuthill_mckee

    order: IntArray = reverse_cuthill_mckee(scaled, symmetric_mode=True).astype(np.intp)
    band = _band(scaled, order)
    if band is None:
        return None
    upper, fault = dpbtrf(band, overwrite_ab=True)
    if fault or float(upper[-1].min()) ** 2 <= np.finfo(float).eps:
        return None
    return BandFactor(upper, order, scale[order])


def _band(matrix: csr_array, order: IntArray) -> FloatArray | None:
    """Return the upper diagonals of a renumbered matrix, shape (w + 1, n); None if it is wide or not symmetric."""
    entries, place = matrix.tocoo(), np.empty(len(order), np.intp)
    place[order] = np.arange(len(order))
    rows, cols = place[entries.row], place[entries.col]
    width = int(np.abs(cols - rows).max(initial=0))
    if width > _MAX_BANDWIDTH:
        return None
    sides = np.zeros((2, width + 1, len(order)), order="C")
    for side, (row, col) in zip(sides, ((rows, cols), (cols, rows)), strict=True):
        above = row <= col
        side[(width + row - col)[above], col[above]] = entries.data[above]
    if float(np.abs(sides[0] - sides[1]).max(initial=0.0)) > _ROUNDING:
        return None
    return np.asfortranarray(sides[0])


class SingularMatrixError(FlexcamError, ArithmeticError):
    """Singular matrix: a motion has neither mass nor stiffness.

    Parameters
    ----------
    unknowns
        Indices of the unknowns that take part in that motion, if known.
    """

    def __init__(self, unknowns: tuple[int, ...] = ()) -> None:
        self.unknowns = unknowns
        super().__init__(f"the matrix is singular at unknowns {list(unknowns)}")


class Factor(Protocol):
    """Interface of a factorization: solves ``A x = b`` for a fixed A."""

    def solve(self, right: FloatArray) -> FloatArray:
        """Solve for a right-hand side of shape (n,) or (n, k)."""
        ...


@dataclass(frozen=True, eq=False)
class _Inverse:
    inverse: FloatArray

    def solve(self, right: FloatArray) -> FloatArray:
        """Solve, see `Factor`."""
        return self.inverse @ right


@dataclass(frozen=True, eq=False)
class _SparseLU:
    lu_solve: Callable[[FloatArray], FloatArray]
    scale: FloatArray

    def solve(self, right: FloatArray) -> FloatArray:
        """Solve, see `Factor`."""
        scale = self.scale if right.ndim == 1 else self.scale[:, None]
        return scale * self.lu_solve(scale * right)


def diagonal_scale(matrix: Triplets) -> FloatArray:
    """Return 1/sqrt of the diagonal; scaling with it makes translations and rotations comparable."""
    diagonal = np.abs(matrix.diagonal())
    return 1.0 / np.sqrt(np.where(diagonal > 0.0, diagonal, 1.0))


def factorize(matrix: Triplets) -> Factor:
    """Return the factorization of a symmetric matrix."""
    scale = diagonal_scale(matrix)
    if matrix.size <= DENSE_LIMIT:
        return _dense_inverse(scale[:, None] * matrix.dense() * scale, scale)
    scaled = _scaled_csr(matrix, scale)
    return band_factor(scaled, scale) or _sparse_lu(scaled.tocsc(), scale)


def _scaled_csr(matrix: Triplets, scale: FloatArray) -> csr_array:
    from scipy.sparse import diags_array

    return (diags_array(scale) @ matrix.csr() @ diags_array(scale)).tocsr()


def _dense_inverse(scaled: FloatArray, scale: FloatArray) -> _Inverse:
    with suppress(np.linalg.LinAlgError):
        inverse = np.linalg.inv(scaled)
        if np.isfinite(inverse).all() and np.abs(inverse).max(initial=0.0) <= 1.0 / np.finfo(float).eps:
            return _Inverse(scale[:, None] * inverse * scale)
    raise SingularMatrixError(_largest_unknowns(np.linalg.svd(scaled)[2][-1]))


def _largest_unknowns(motion: FloatArray) -> tuple[int, ...]:
    size = np.abs(motion)
    return tuple(np.flatnonzero(size > 0.5 * size.max()).tolist())


def _sparse_lu(scaled: csc_array, scale: FloatArray) -> _SparseLU:
    from scipy.sparse import eye_array
    from scipy.sparse.linalg import splu

    options = {"SymmetricMode": True}
    try:
        lu = splu(scaled, permc_spec="MMD_AT_PLUS_A", options=options)
        regular = bool(np.abs(lu.U.diagonal()).min() > np.finfo(float).eps)
    except RuntimeError:  # SuperLU reports an exactly zero pivot only this way
        lu, regular = None, False
    if lu is None or not regular:
        # Inverse iteration: the shift serves to find the null vector only.
        shifted = splu((scaled + 1e-8 * eye_array(len(scale))).tocsc(), permc_spec="MMD_AT_PLUS_A", options=options)
        motion = np.random.default_rng(0).standard_normal(len(scale))
        for _ in range(3):
            motion = shifted.solve(motion / np.linalg.norm(motion))
        raise SingularMatrixError(_largest_unknowns(motion))
    return _SparseLU(lu.solve, scale)


def select_storage(matrix: Triplets) -> FloatArray | csr_array:
    """Return the matrix in the storage form with the fastest products at its size."""
    return matrix.dense() if matrix.size <= DENSE_LIMIT else matrix.csr()


_FREE_TOLERANCE = 64.0 * np.finfo(float).eps
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
    if matrix.size <= 2 * DENSE_LIMIT:
        values, vectors = np.linalg.eigh(scale[:, None] * matrix.dense() * scale)
    else:
        from scipy.sparse.linalg import eigsh

        start, count = np.random.default_rng(0).standard_normal(matrix.size), min(_MAX_DIMENSION, matrix.size - 2)
        values, vectors = eigsh(_scaled_csr(matrix, scale).tocsc(), k=count, sigma=-1e-10, v0=start)
        values = np.abs(values)
    return scale[:, None] * vectors[:, values < _FREE_TOLERANCE]


def select_constraints(motions: FloatArray) -> list[int]:
    """Return one unknown per motion such that fixing these unknowns removes all the motions.

    Gaussian elimination with row pivots.
    """
    unknowns: list[int] = []
    rest = motions.copy()
    for _ in range(motions.shape[1]):
        unknowns.append(int(np.argmax(np.linalg.norm(rest, axis=1))))
        direction = rest[unknowns[-1]] / np.linalg.norm(rest[unknowns[-1]])
        rest -= np.outer(rest @ direction, direction)
    return unknowns


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
