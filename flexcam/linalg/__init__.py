"""Matrices as coordinate triplets, their factorization and their null space.

May import `checks` and, above a few hundred unknowns, scipy.
Another matrix form or solver goes here, behind `factorize`.
"""

from flexcam.linalg.extended import LongArray
from flexcam.linalg.factor import DENSE_LIMIT, Factor, SingularMatrixError, diagonal_scale, factorize, operator
from flexcam.linalg.groups import by_group, groups
from flexcam.linalg.held import factorize_held
from flexcam.linalg.nullspace import null_space, pins
from flexcam.linalg.pencil import natural
from flexcam.linalg.rounding import TOO_MUCH, energy_rounding, share_lost
from flexcam.linalg.triplets import ComplexArray, FloatArray, IntArray, Triplets

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
    "by_group",
    "diagonal_scale",
    "energy_rounding",
    "factorize",
    "factorize_held",
    "groups",
    "natural",
    "null_space",
    "operator",
    "pins",
    "share_lost",
]
