"""How much of an answer the rounding of a stiffness matrix may have taken."""

from __future__ import annotations

import numpy as np

from flexcam.linalg.triplets import FloatArray, Triplets

TOO_MUCH = 0.05
"""Share of the strain energy that rounding may reach; the estimate is a bound, some ten times above the error."""


def energy_rounding(matrix: Triplets, shapes: FloatArray) -> FloatArray:
    """Return what rounding the matrix's entries can change of ``x^T K x``, ``eps |x|^T |K| |x|``.

    The bending stiffness of short elements is a small difference of large entries: on n elements per span this grows
    like n^4 against the energy of the lowest mode. Source: I. Fried, Condition of finite element matrices generated
    from nonuniform meshes, AIAA J. 10 (1972).
    """
    size = Triplets(matrix.size, matrix.rows, matrix.cols, np.abs(matrix.values))
    absolute = np.abs(shapes)
    return np.finfo(float).eps * np.sum(absolute * size.times_all(absolute), axis=0)


def share_lost(matrix: Triplets, shape: FloatArray) -> float:
    """Return the part of a displacement that rounding the stiffness may have taken."""
    energy = abs(float(shape @ matrix.times(shape)))
    return float(energy_rounding(matrix, shape[:, None])[0]) / energy if energy > 0.0 else 0.0
