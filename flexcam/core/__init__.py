"""Errors, units, matrices and their factorization.

Imports no other package of flexcam. A new unit is a row in `units`, a new kind of factorization a function in
`factorization`.
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
