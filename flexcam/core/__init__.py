"""Errors, units, matrices and their factorizations, null spaces and generalized eigenvalue problems.

Imports no other package of flexcam. A new unit is a row of the table in `units`; a new kind of factorization is a
function in `factorization`; input errors are raised through `errors`.
"""

from flexcam.core.eigen import LongArray, natural
from flexcam.core.factorization import DENSE_LIMIT, Factor, SingularMatrixError, diagonal_scale, factorize, operator
from flexcam.core.matrices import (
    TOO_MUCH,
    ComplexArray,
    FloatArray,
    IntArray,
    Triplets,
    component_members,
    connected_components,
    energy_rounding,
    share_lost,
)
from flexcam.core.null_space import factorize_held, null_space, pins

__all__ = [
    "DENSE_LIMIT",
    "TOO_MUCH",
    "ComplexArray",
    "Factor",
    "FloatArray",
    "IntArray",
    "LongArray",
    "SingularMatrixError",
    "Triplets",
    "component_members",
    "connected_components",
    "diagonal_scale",
    "energy_rounding",
    "factorize",
    "factorize_held",
    "natural",
    "null_space",
    "operator",
    "pins",
    "share_lost",
]
