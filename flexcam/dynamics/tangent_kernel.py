"""Steps of the average acceleration for small disturbances: all disturbances in one call, compiled as the kernel is.

Disturbances are the columns of arrays of displacements, velocities and internal states. A matrix with one row is the
diagonal of a matrix. In Python the functions of matrices are replaced by numpy (`NUMPY`): there they have many
unknowns.
"""
# Elements of arrays are numbers to the compiler and arrays to the type checker.
# pyright: reportArgumentType=false, reportAssignmentType=false

from __future__ import annotations

from flexcam.core import FloatArray
from flexcam.dynamics.local_newton import eliminate, eliminate_numpy


def assign(target: FloatArray, columns: FloatArray) -> None:
    """Copy columns."""
    for i in range(len(target)):
        for p in range(target.shape[1]):
            target[i, p] = columns[i, p]


def accumulate(target: FloatArray, factor: float, matrix: FloatArray, columns: FloatArray) -> None:
    """Add a factor times the product of a matrix and columns."""
    if len(matrix) < len(target):
        for i in range(len(target)):
            weight = factor * matrix[0, i]
            for p in range(target.shape[1]):
                target[i, p] += weight * columns[i, p]
        return
    for i in range(len(target)):
        for j in range(len(columns)):
            weight = factor * matrix[i, j]
            for p in range(target.shape[1]):
                target[i, p] += weight * columns[j, p]


def accumulate_transposed(target: FloatArray, factor: float, matrix: FloatArray, columns: FloatArray) -> None:
    """Add a factor times the product of a transposed matrix and columns."""
    for j in range(len(matrix)):
        for i in range(len(target)):
            weight = factor * matrix[j, i]
            for p in range(target.shape[1]):
                target[i, p] += weight * columns[j, p]


def propagate_disturbances(
    half: float, mass: FloatArray, damping: FloatArray, stiffness: FloatArray, travel: FloatArray, ahead: FloatArray,
    transfer: FloatArray, inverse: FloatArray, one: FloatArray, act: FloatArray, by_d: FloatArray, by_v: FloatArray,
    by_state: FloatArray, followed: FloatArray, by_new: FloatArray, sense: FloatArray, answer: FloatArray,
    rest: FloatArray, difference: FloatArray, by_begin: FloatArray, more: FloatArray, found: FloatArray,
    residual: FloatArray, push: FloatArray, local: FloatArray, system: FloatArray, empty: FloatArray,
) -> bool:  # fmt: skip
    """Write the disturbances at the ends of successive steps, see `flexcam.dynamics.linearization.StepSequence`.

    Return whether the steps are regular.

    `found` has at least two rows of shape (2n + s, k): those of the beginning are in row 0, those after step i are
    written to row i + 1, counted cyclically; `more` has a row per step. The arrays of the last line are work arrays,
    `empty` is the identity beside zeros, shape (c, c + k). `residual` is half the step times the residual forces, which
    at the end of a step follow from its solution.
    """
    n, c, s, k = act.shape[2], act.shape[1], followed.shape[1], found.shape[2]
    d, v, z = found[0, :n], found[0, n : 2 * n], found[0, 2 * n :]
    residual[:] = 0.0
    local[:] = 0.0
    accumulate(residual, half, damping, v)
    accumulate(residual, half, stiffness, d)
    accumulate(local, half, by_d[0], d)
    accumulate(local, half, by_v[0], v)
    accumulate(local, half, by_state[0], z)
    accumulate_transposed(residual, -1.0, act[0], local)
    for i in range(len(more)):
        new = (i + 1) % len(found)
        assign(found[new], more[i])
        moved, moving, free = found[new, :n], found[new, n : 2 * n], found[new, 2 * n :]
        assign(push, moving)
        accumulate(push, 1.0, mass, v)
        accumulate(push, -1.0, transfer, residual)
        accumulate(moved, 1.0, one, d)
        accumulate(moved, half, ahead, v)
        for j in range(s):
            accumulate(free[j : j + 1], by_begin[i, j], one[:1, :1], z[j : j + 1])
            accumulate(free[j : j + 1], difference[i, j], followed[i, j : j + 1], d)
        assign(residual, push)
        accumulate(residual, -half, stiffness, moved)
        moving[:] = 0.0
        accumulate(moving, 1.0, inverse, residual)
        if c > 0:
            local[:] = 0.0
            accumulate(local, half, by_new[i], moved)
            accumulate(local, half, by_state[i + 1], free)
            accumulate(moving, 1.0, answer[i], local)
            assign(system, empty)
            accumulate(system[:, :c], -1.0, sense[i], answer[i])
            accumulate(system[:, c:], 1.0, sense[i], moving)
            if not eliminate(system, c, c + k):
                return False
            accumulate(moving, 1.0, answer[i], system[:, c:])
        accumulate(moved, half, travel, moving)
        for j in range(s):
            accumulate(free[j : j + 1], rest[i, j], followed[i + 1, j : j + 1], moved)
        assign(residual, push)
        accumulate(residual, -1.0, mass, moving)
        d, v, z = moved, moving, free
    return True


FUNCTIONS_OF_TANGENTS = (assign, accumulate, accumulate_transposed, propagate_disturbances)
"""Functions for the compiler, in the order of their calls; `eliminate` comes before them."""


def assign_numpy(target: FloatArray, columns: FloatArray) -> None:
    """Replace `assign` by numpy."""
    target[:] = columns


def accumulate_numpy(target: FloatArray, factor: float, matrix: FloatArray, columns: FloatArray) -> None:
    """Replace `accumulate` by numpy."""
    target += factor * (matrix.T * columns if len(matrix) < len(target) else matrix @ columns)


def accumulate_transposed_numpy(target: FloatArray, factor: float, matrix: FloatArray, columns: FloatArray) -> None:
    """Replace `accumulate_transposed` by numpy."""
    target += factor * (matrix.T @ columns)


NUMPY = {
    "assign": assign_numpy, "accumulate": accumulate_numpy, "accumulate_transposed": accumulate_transposed_numpy,
    "eliminate": eliminate_numpy,
}  # fmt: skip
"""Functions of matrices in Python."""
