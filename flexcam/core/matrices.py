"""Square sparse matrices as coordinate triplets, so that a small run need not import scipy."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Self

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from scipy.sparse import csr_array


FloatArray = NDArray[np.float64]
"""Array of double precision."""

ComplexArray = NDArray[np.complex128]
"""Array of double precision complex numbers."""

IntArray = NDArray[np.intp]
"""Array of integers, such as indices."""


DENSE_LIMIT = 300
"""Number of unknowns up to which a dense product is faster than a sparse one and scipy need not be imported."""


@dataclass(frozen=True, eq=False)
class Triplets:
    """Square matrix as (row, column, value) triplets; duplicate entries are summed.

    Parameters
    ----------
    size
        Number of rows and columns.
    rows, cols
        Row and column indices of the entries, shape (k,).
    values
        Entries, shape (k,). The arrays of a matrix are read-only.
    """

    size: int
    rows: IntArray
    cols: IntArray
    values: FloatArray

    def __post_init__(self) -> None:
        for name in ("rows", "cols", "values"):
            view: NDArray[Any] = getattr(self, name).view()
            view.flags.writeable = False  # matrices are shared by systems; the array of the caller stays writable
            object.__setattr__(self, name, view)

    @classmethod
    def zeros(cls, size: int) -> Self:
        """Return the zero matrix."""
        return cls(size, np.zeros(0, np.intp), np.zeros(0, np.intp), np.zeros(0))

    @classmethod
    def from_dense(cls, matrix: FloatArray | list[list[float]]) -> Self:
        """Return the non-zero entries of a dense square matrix, shape (n, n)."""
        dense = np.asarray(matrix, dtype=float)
        rows, cols = np.nonzero(dense)
        return cls(len(dense), rows, cols, dense[rows, cols])

    @classmethod
    def outer(cls, left: FloatArray, right: FloatArray, factor: float = 1.0) -> Self:
        """Return ``factor * left right^T`` of two vectors, shape (n,), with the entries where both are non-zero."""
        if factor == 0.0:
            return cls.zeros(len(left))
        i = np.flatnonzero(left != 0.0)  # comparing first makes numpy find few entries ten times as fast
        j = i if right is left else np.flatnonzero(right != 0.0)
        values = factor * np.outer(left[i], right[j])
        return cls(len(left), np.repeat(i, len(j)), np.tile(j, len(i)), values.ravel())

    @classmethod
    def sum(cls, matrices: Sequence[Triplets]) -> Self:
        """Return the sum of one or more matrices of the same size."""
        rows, cols, values = (np.concatenate([getattr(m, n) for m in matrices]) for n in ("rows", "cols", "values"))
        return cls(matrices[0].size, rows, cols, values)

    def dense(self) -> FloatArray:
        """Return the matrix as an array, shape (size, size)."""
        flat = _sum_duplicates(self.rows * self.size + self.cols, self.values, self.size**2)
        return flat.reshape(self.size, self.size)

    def csr(self) -> csr_array:
        """Return the matrix in scipy's compressed sparse row format (imports scipy)."""
        from scipy.sparse import coo_array

        return coo_array((self.values, (self.rows, self.cols)), shape=(self.size, self.size)).tocsr()

    def times(self, vector: FloatArray) -> FloatArray:
        """Return the product with a vector, shape (size,)."""
        return _sum_duplicates(self.rows, self.values * vector[self.cols], self.size)

    def multiply(self, columns: FloatArray) -> FloatArray:
        """Return the product with every column of an array, shape (size, k)."""
        if self.size <= DENSE_LIMIT:
            return self.dense() @ columns
        return self.csr() @ columns

    def diagonal(self) -> FloatArray:
        """Return the diagonal, shape (size,)."""
        mask = self.rows == self.cols
        return _sum_duplicates(self.rows[mask], self.values[mask], self.size)

    def scale(self, factor: float) -> Self:
        """Return the matrix times a number."""
        return type(self)(self.size, self.rows, self.cols, factor * self.values)

    def __add__(self, other: Triplets) -> Self:
        return self.sum((self, other))

    def part(self, index: IntArray) -> Self:
        """Return the submatrix of the rows and columns `index`, in that order."""
        place = np.full(self.size, -1, dtype=np.intp)
        place[index] = np.arange(len(index))
        rows, cols = place[self.rows], place[self.cols]
        inside = (rows >= 0) & (cols >= 0)
        return type(self)(len(index), rows[inside], cols[inside], self.values[inside])


def _sum_duplicates(places: IntArray, values: FloatArray, size: int) -> FloatArray:
    return np.bincount(places, weights=values, minlength=size).astype(float, copy=False)


ROUNDING_LIMIT = 0.05
"""Limit of rounding as a fraction of the strain energy; the estimate is an upper bound, about ten times the error."""


def energy_rounding(matrix: Triplets, shapes: FloatArray) -> FloatArray:
    """Return the bound ``eps |x|^T |K| |x|`` of the rounding error of ``x^T K x``.

    The bending stiffness of short elements is a small difference of large entries: for n elements per span the bound
    grows as n^4 relative to the energy of the lowest mode. Reference: I. Fried, Condition of finite element matrices
    generated from nonuniform meshes, AIAA J. 10 (1972).
    """
    size = Triplets(matrix.size, matrix.rows, matrix.cols, np.abs(matrix.values))
    absolute = np.abs(shapes)
    return np.finfo(float).eps * np.sum(absolute * size.multiply(absolute), axis=0)


def rounding_fraction(matrix: Triplets, shape: FloatArray) -> float:
    """Return the fraction of a displacement that rounding of the stiffness may have changed."""
    energy = abs(float(shape @ matrix.times(shape)))
    return float(energy_rounding(matrix, shape[:, None])[0]) / energy if energy > 0.0 else 0.0


def connected_components(size: int, rows: IntArray, cols: IntArray) -> IntArray:
    """Return the component label of each node of a graph.

    Each group is merged with its lowest-numbered neighbour until none is left, which at least halves their number in
    each pass: Y. Shiloach and U. Vishkin, An O(log n) parallel connectivity algorithm, J. Algorithms 3 (1982). It
    uses only numpy, so that a small run does not import scipy.
    """
    labels = np.arange(size)
    while (labels[rows] != labels[cols]).any():
        first, second = labels[rows], labels[cols]
        lower = np.minimum(first, second)
        np.minimum.at(labels, first, lower)
        np.minimum.at(labels, second, lower)
        while (labels != labels[labels]).any():
            labels = labels[labels]
    return labels


def component_members(labels: IntArray) -> list[IntArray]:
    """Return the members of each component, in the order of their labels."""
    order = np.argsort(labels, kind="stable")
    return np.split(order, np.flatnonzero(np.diff(labels[order])) + 1) if len(labels) else []
