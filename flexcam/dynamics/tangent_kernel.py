"""Steps of the average acceleration for small disturbances: all disturbances in one call, compiled as the kernel is.

Disturbances are the rows of arrays of displacements, velocities and internal states. A matrix with one row is the
diagonal of a matrix. In Python the functions of matrices are replaced by numpy (`NUMPY`): there they have many
unknowns.
"""
# Elements of arrays are numbers to the compiler and arrays to the type checker.
# pyright: reportArgumentType=false, reportAssignmentType=false

from __future__ import annotations

import numpy as np

from flexcam.core import FloatArray
from flexcam.dynamics.local_newton import eliminate


def assign(target: FloatArray, rows: FloatArray) -> None:
    """Copy rows."""
    for p in range(len(target)):
        for i in range(target.shape[1]):
            target[p, i] = rows[p, i]


def accumulate(target: FloatArray, factor: float, matrix: FloatArray, rows: FloatArray) -> None:
    """Add a factor times the products of a matrix with rows."""
    n = target.shape[1]
    for p in range(len(target)):
        if len(matrix) < n:
            for i in range(n):
                target[p, i] += factor * matrix[0, i] * rows[p, i]
        else:
            for i in range(n):
                total = 0.0
                for j in range(rows.shape[1]):
                    total += matrix[i, j] * rows[p, j]
                target[p, i] += factor * total


def accumulate_transpose(target: FloatArray, factor: float, matrix: FloatArray, rows: FloatArray) -> None:
    """Add a factor times the products of a transposed matrix with rows."""
    for p in range(len(target)):
        for j in range(len(matrix)):
            weight = factor * rows[p, j]
            for i in range(target.shape[1]):
                target[p, i] += weight * matrix[j, i]


def solve_forces(
    sense: FloatArray, response: FloatArray, velocity: FloatArray, local: FloatArray, system: FloatArray
) -> bool:
    """Write the forces f of ``f = S (v + A f)`` for velocities v without them; return whether there is a solution."""
    c = len(sense)
    for a in range(c):
        for b in range(c):
            total = 0.0
            for i in range(sense.shape[1]):
                total += sense[a, i] * response[b, i]
            system[a, b] = (1.0 if a == b else 0.0) - total
        for p in range(len(velocity)):
            total = 0.0
            for i in range(sense.shape[1]):
                total += sense[a, i] * velocity[p, i]
            system[a, c + p] = total
    if not eliminate(system, c, c + len(velocity)):
        return False
    for a in range(c):
        for p in range(len(velocity)):
            local[p, a] = system[a, c + p]
    return True


def propagate_disturbances(
    half: float, mass: FloatArray, damping: FloatArray, stiffness: FloatArray, travel: FloatArray, ahead: FloatArray,
    transfer: FloatArray, inverse: FloatArray, unit: FloatArray, act: FloatArray, by_d: FloatArray, by_v: FloatArray,
    by_state: FloatArray, by_new: FloatArray, sense: FloatArray, response: FloatArray,
    rest: FloatArray, difference: FloatArray, by_begin: FloatArray, terms: FloatArray, states: FloatArray,
    d: FloatArray, v: FloatArray, z: FloatArray, new_d: FloatArray, new_z: FloatArray, residual: FloatArray,
    push: FloatArray, local: FloatArray, system: FloatArray,
) -> bool:  # fmt: skip
    """Write the disturbances at the ends of successive steps, see `flexcam.dynamics.linearization.StepSequence`.

    Return whether the steps are regular. `states` has at least two rows of shape (k, 2n + s): row 0 is the beginning,
    those after step i are written to row i + 1, counted cyclically; `terms` has a row per step. The arrays
    after `states` are work arrays. `residual` is half the step times the residual forces, which at the end of a step
    follow from its solution.
    """
    n, c = act.shape[2], act.shape[1]
    assign(d, states[0, :, :n])
    assign(v, states[0, :, n : 2 * n])
    assign(z, states[0, :, 2 * n :])
    residual[:] = 0.0
    local[:] = 0.0
    accumulate(residual, half, damping, v)
    accumulate(residual, half, stiffness, d)
    accumulate(local, half, by_d[0], d)
    accumulate(local, half, by_v[0], v)
    accumulate(local, half, by_state[0], z)
    accumulate_transpose(residual, -1.0, act[0], local)
    for i in range(len(terms)):
        assign(push, terms[i, :, n : 2 * n])
        accumulate(push, 1.0, mass, v)
        accumulate(push, -1.0, transfer, residual)
        assign(new_d, terms[i, :, :n])
        accumulate(new_d, 1.0, unit, d)
        accumulate(new_d, half, ahead, v)
        assign(new_z, terms[i, :, 2 * n :])
        accumulate(new_z, 1.0, by_begin[i : i + 1], z)
        accumulate(new_z, 1.0, difference[i], d)
        assign(residual, push)
        accumulate(residual, -half, stiffness, new_d)
        v[:] = 0.0
        accumulate(v, 1.0, inverse, residual)
        if c > 0:
            local[:] = 0.0
            accumulate(local, half, by_new[i], new_d)
            accumulate(local, half, by_state[i + 1], new_z)
            accumulate_transpose(v, 1.0, response[i], local)
            if not solve_forces(sense[i], response[i], v, local, system):
                return False
            accumulate_transpose(v, 1.0, response[i], local)
        accumulate(new_d, half, travel, v)
        assign(d, new_d)
        assign(z, new_z)
        accumulate(z, 1.0, rest[i], d)
        assign(residual, push)
        accumulate(residual, -1.0, mass, v)
        new = (i + 1) % len(states)
        assign(states[new, :, :n], d)
        assign(states[new, :, n : 2 * n], v)
        assign(states[new, :, 2 * n :], z)
    return True


FUNCTIONS_OF_TANGENTS = (assign, accumulate, accumulate_transpose, solve_forces, propagate_disturbances)
"""Functions for the compiler, in the order of their calls; `eliminate` comes before them."""


def assign_numpy(target: FloatArray, rows: FloatArray) -> None:
    """Replace `assign` by numpy."""
    target[:] = rows


def accumulate_numpy(target: FloatArray, factor: float, matrix: FloatArray, rows: FloatArray) -> None:
    """Replace `accumulate` by numpy."""
    target += factor * (matrix * rows if len(matrix) < target.shape[1] else rows @ matrix.T)


def accumulate_transpose_numpy(target: FloatArray, factor: float, matrix: FloatArray, rows: FloatArray) -> None:
    """Replace `accumulate_transpose` by numpy."""
    target += factor * (rows @ matrix)


def solve_forces_numpy(
    sense: FloatArray, response: FloatArray, velocity: FloatArray, local: FloatArray, system: FloatArray
) -> bool:
    """Replace `solve_forces` by numpy."""
    try:
        local[:] = np.linalg.solve(np.eye(len(sense)) - sense @ response.T, sense @ velocity.T).T
    except np.linalg.LinAlgError:
        return False
    return True


NUMPY = {
    "assign": assign_numpy, "accumulate": accumulate_numpy, "accumulate_transpose": accumulate_transpose_numpy,
    "solve_forces": solve_forces_numpy,
}  # fmt: skip
"""Functions of matrices in Python."""
