"""Errors, units, matrices and their factorizations, null spaces and generalized eigenvalue problems.

Imports no other package of flexcam. A new unit is a row of the table in `units`; a new kind of factorization is a
function in `factorization`; input errors are raised through `errors`.
"""

from flexcam.core.eigen import LongArray, solve_eigenproblem
from flexcam.core.factorization import (
    Factor,
    SingularMatrixError,
    diagonal_scale,
    factorize,
    factorize_with_update,
    null_space,
    select_constraints,
    select_storage,
)
from flexcam.core.matrices import (
    DENSE_LIMIT,
    ROUNDING_LIMIT,
    ComplexArray,
    FloatArray,
    IntArray,
    Triplets,
    component_members,
    connected_components,
    energy_rounding,
    rounding_fraction,
)

__all__ = [
    "DENSE_LIMIT", "ROUNDING_LIMIT", "ComplexArray", "Factor", "FloatArray", "IntArray", "LongArray",
    "SingularMatrixError", "Triplets", "component_members", "connected_components", "diagonal_scale", "energy_rounding",
    "factorize", "factorize_with_update", "null_space", "rounding_fraction", "select_constraints", "select_storage",
    "solve_eigenproblem",
]  # fmt: skip
