"""Products of matrices with more digits than double precision has.

Numbers are cut into slices of so few bits that products of slices, and sums of these, are exact in double precision;
a matrix product is then a few ordinary ones: K. Ozaki, T. Ogita, S. Oishi and S. M. Rump, Numer. Algorithms 59 (2012).
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from flexcam.linalg.triplets import FloatArray

LongArray = NDArray[np.longdouble]
"""Array of extended precision."""

_SLICES = 4
"""Some twenty bits each: together more than extended precision has."""

_FEW = 100
"""Size up to which the processor's own extended precision, a term at a time, is as fast."""


def product(A: LongArray, B: LongArray) -> LongArray:
    """Return A B with the digits of extended precision."""
    n = A.shape[1]
    if n <= _FEW:
        return A @ B
    bits = (53 - math.ceil(math.log2(_SLICES * n))) // 2
    left, right = _sliced(A, bits, axis=1), _sliced(B, bits, axis=0)
    found = np.zeros((len(A), B.shape[1]), dtype=np.longdouble)
    for last in reversed(range(_SLICES)):  # the smallest ones first
        found += np.hstack(left[: last + 1]) @ np.vstack(right[last::-1])
    return found


def _sliced(matrix: LongArray, bits: int, *, axis: int) -> list[FloatArray]:
    """Return slices whose sum is the matrix, but for what lies below the last one."""
    size = np.frexp(np.abs(matrix).max(axis=axis, keepdims=True))[1]
    slices: list[FloatArray] = []
    for i in range(1, _SLICES + 1):
        large = np.ldexp(1.5, size - bits * i + 52)  # what is added to it keeps the bits above the slice's end
        slices.append((matrix.astype(float) + large) - large)
        matrix = matrix - slices[-1]
    return slices


def times(matrix: FloatArray, columns: LongArray) -> LongArray:
    """Return a matrix of which most is zero times columns, in extended precision."""
    found = np.zeros((len(matrix), columns.shape[1]), dtype=np.longdouble)
    for i, row in enumerate(matrix):
        held = np.flatnonzero(row)
        found[i] = row[held].astype(np.longdouble) @ columns[held]
    return found
