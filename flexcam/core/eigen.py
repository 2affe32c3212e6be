"""Eigenvalue problems and matrix products in extended precision.

Matrices are split into slices of so few bits that products of slices, and sums of them, are exact in double precision;
a matrix product then needs a few ordinary products: K. Ozaki, T. Ogita, S. Oishi and S. M. Rump, Numer. Algorithms 59
(2012).
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from flexcam.core.matrices import FloatArray, IntArray, component_members, connected_components

LongArray = NDArray[np.longdouble]
"""Array of extended precision."""

_SLICES = 4
"""Number of slices of about twenty bits each: together more than extended precision has."""

_SMALL_SIZE = 100
"""Size up to which the processor's own extended precision, one term at a time, is as fast."""


def long_product(A: LongArray, B: LongArray) -> LongArray:
    """Return A B in extended precision."""
    n = A.shape[1]
    if n <= _SMALL_SIZE:
        return A @ B
    bits = (53 - math.ceil(math.log2(_SLICES * n))) // 2
    left, right = _split(A, bits, axis=1), _split(B, bits, axis=0)
    product = np.zeros((len(A), B.shape[1]), dtype=np.longdouble)
    for last in reversed(range(_SLICES)):  # sum the smallest terms first
        product += np.hstack(left[: last + 1]) @ np.vstack(right[last::-1])
    return product


def _split(matrix: LongArray, bits: int, *, axis: int) -> list[FloatArray]:
    """Return slices whose sum is the matrix, except for the bits below the last slice."""
    size = np.frexp(np.abs(matrix).max(axis=axis, keepdims=True))[1]
    slices: list[FloatArray] = []
    for i in range(1, _SLICES + 1):
        large = np.ldexp(1.5, size - bits * i + 52)  # adding a number to it keeps the bits above the end of the slice
        slices.append((matrix.astype(float) + large) - large)
        matrix = matrix - slices[-1]
    return slices


def multiply_sparse(matrix: FloatArray, columns: LongArray) -> LongArray:
    """Return the product of a mostly zero matrix with columns, in extended precision."""
    product = np.zeros((len(matrix), columns.shape[1]), dtype=np.longdouble)
    for i, row in enumerate(matrix):
        cols = np.flatnonzero(row)
        product[i] = row[cols].astype(np.longdouble) @ columns[cols]
    return product


_TWO = np.longdouble(2.0)

_MIXING_LIMIT = 1e-3
"""Relative mixing of two vectors up to which a first correction can separate them."""

_PASSES = 6
_SMALL = 1e-9
"""Correction whose square is of the size of rounding."""

_REFINEMENT_SIZE = 500
"""Number of unknowns up to which the vectors are refined."""


def solve_eigenproblem(M: FloatArray, K: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the eigenvalues and eigenvectors of ``K x = lambda M x``, the vectors orthonormal in M.

    An eigensolver in double precision leaves an error of the size of the rounding of the largest eigenvalue in every
    eigenvalue, so that the lowest frequencies of a stiff structure lose half their digits. A refinement with products
    in extended precision recovers them: T. Ogita and K. Aishima, Japan J. Indust. Appl. Math. 35 (2018). Unknowns that
    nothing connects have their own eigenvectors, also those of equal eigenvalues.
    """
    if not (np.diag(M) > 0.0).all():
        message = "the mass is not positive"
        raise np.linalg.LinAlgError(message)
    values, vectors = np.zeros(len(M)), np.zeros_like(M)
    end = 0
    for part in component_members(connected_components(len(M), *np.nonzero((M != 0.0) | (K != 0.0)))):
        begin, end = end, end + len(part)
        values[begin:end], vectors[part, begin:end] = _solve_part(M[np.ix_(part, part)], K[np.ix_(part, part)])
    order = np.argsort(values, kind="stable")
    return values[order], vectors[:, order]


def _solve_part(M: FloatArray, K: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the eigenvalues and eigenvectors of connected unknowns."""
    scale = np.exp2(-np.round(0.5 * np.log2(np.diag(M))))  # exact: no rounding
    mass, stiffness = (scale[:, None] * matrix * scale for matrix in (M, K))
    L = np.linalg.cholesky(mass)
    half = np.linalg.solve(L, stiffness)
    values, vectors = np.linalg.eigh(np.linalg.solve(L, half.T))
    shapes: FloatArray = np.linalg.solve(L.T, vectors).astype(float)
    if len(M) <= _REFINEMENT_SIZE:
        values, shapes = _refine(mass, stiffness, shapes)
    return np.maximum(values, 0.0), scale[:, None] * shapes


def _refine(M: FloatArray, K: FloatArray, vectors: FloatArray) -> tuple[FloatArray, FloatArray]:
    X = vectors.astype(np.longdouble)
    for _ in range(_PASSES):  # each pass squares the error
        mass, stiffness = _project(X, M, K)
        labels = _cluster(mass, stiffness)
        if (np.bincount(labels) > 1).any():
            X = _diagonalize_clusters(X, labels, mass, stiffness)
            mass, stiffness = _project(X, M, K)
        correction = _correction(labels, mass, stiffness).astype(float)
        X = X + X.astype(float) @ correction
        X = X / np.sqrt(np.sum(X * multiply_sparse(M, X), axis=0))
        if np.abs(correction).max(initial=0.0) < _SMALL:
            break
    values = np.sum(X * multiply_sparse(K, X), axis=0)
    order = np.argsort(values)
    return values[order].astype(float), X[:, order].astype(float)


def _project(X: LongArray, M: FloatArray, K: FloatArray) -> tuple[LongArray, LongArray]:
    """Return the projections of both matrices on the vectors, exactly symmetric to preserve orthogonality."""
    mass, stiffness = (long_product(X.T, multiply_sparse(matrix, X)) for matrix in (M, K))
    return (mass + mass.T) / _TWO, (stiffness + stiffness.T) / _TWO


def _cluster(mass: LongArray, stiffness: LongArray) -> IntArray:
    """Return groups of vectors whose eigenvalues are too close to be separated by a first correction."""
    values = np.diag(stiffness) / np.diag(mass)
    rounding = np.finfo(np.longdouble).eps * np.abs(values).max(initial=0.0)
    mixing, differences = np.abs(stiffness - values * mass) + rounding, np.abs(values[None, :] - values[:, None])
    return connected_components(len(values), *np.nonzero(np.maximum(mixing, mixing.T) >= _MIXING_LIMIT * differences))


def _diagonalize_clusters(X: LongArray, labels: IntArray, mass: LongArray, stiffness: LongArray) -> LongArray:
    """Return the vectors, each group rotated within its own space into eigenvectors."""
    rotated = X.copy()
    for label in np.flatnonzero(np.bincount(labels) > 1).tolist():
        group = np.flatnonzero(labels == label)
        sizes = np.sqrt(np.diag(mass)[group])
        _, rotation = np.linalg.eigh((stiffness[np.ix_(group, group)] / np.outer(sizes, sizes)).astype(float))
        rotated[:, group] = X[:, group] @ rotation
    return rotated


def _correction(labels: IntArray, mass: LongArray, stiffness: LongArray) -> LongArray:
    """Return the correction by the other vectors: the residual along them over the eigenvalue differences."""
    values = np.diag(stiffness) / np.diag(mass)
    same = labels[:, None] == labels
    differences = np.where(same, 1.0, values[None, :] - values[:, None])
    correction = np.where(same, -0.5 * mass, (stiffness - values * mass) / differences)
    np.fill_diagonal(correction, 0.0)
    return correction
