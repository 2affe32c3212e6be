"""Derivatives of natural frequencies with respect to numbers of a case, from derivatives of the matrices."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from flexcam.core import FloatArray, Triplets
from flexcam.dynamics import Modes, modes

_REPEATED_TOLERANCE = 1e-6
"""Relative difference below which frequencies count as repeated."""

_EXTRA_MODES = 6
"""Additional modes beyond the highest requested one, which contain its repeated frequencies."""

MatrixPair = tuple[Triplets, Triplets]
"""Mass and stiffness matrices."""


@dataclass(frozen=True, eq=False)
class FrequencyDerivative:
    """Derivatives of natural frequencies.

    Parameters
    ----------
    frequencies
        Natural frequencies, Hz, shape (k,).
    values
        Derivatives, Hz per unit of the parameter, shape (k,).
    repeated
        Whether each frequency is repeated: repeated frequencies split, and the derivatives of a group are those of its
        branches in ascending order.
    """

    frequencies: FloatArray
    values: FloatArray
    repeated: tuple[bool, ...]


def frequency_derivatives(
    middle: MatrixPair, beside: Sequence[MatrixPair], step: float, count: int, free: FloatArray | None = None
) -> FrequencyDerivative:
    """Return the derivatives of the lowest natural frequencies, without rigid-body modes.

    With mass-orthonormal shapes, ``d(omega^2)/dp = x^T (dK/dp - omega^2 dM/dp) x``: R. L. Fox and M. P. Kapoor, AIAA
    J. 6 (1968) 2426. For repeated frequencies, the derivatives are the eigenvalues of that matrix projected on their
    shapes. The derivatives of the matrices are finite differences, exact if the entries are polynomials of up to the
    fourth degree in the parameter, as most are.
    """
    found = _modes(middle, count, free)
    omegas, shapes = found.omegas[found.rigid :], found.shapes[:, found.rigid :]
    dM, dK = (_finite_difference([pair[i] for pair in beside], step) for i in (0, 1))
    values = np.zeros(len(omegas))
    repeated = np.zeros(len(omegas), dtype=bool)
    for group in _repeated_groups(omegas):
        x, square = shapes[:, group], float(np.mean(omegas[group])) ** 2
        slopes = np.linalg.eigvalsh(_symmetric(x.T @ dK.multiply(x) - square * (x.T @ dM.multiply(x))))
        values[group] = slopes / (2.0 * math.sqrt(square))
        repeated[group] = len(group) > 1
    turn = 2.0 * math.pi
    told = slice(0, count)
    return FrequencyDerivative(omegas[told] / turn, values[told] / turn, tuple(repeated[told].tolist()))


def _modes(pair: MatrixPair, count: int, free: FloatArray | None) -> Modes:
    rigid = 0 if free is None else free.shape[1]
    return modes(*pair, None if free is None else rigid + count + _EXTRA_MODES, free=free)


def _finite_difference(matrices: Sequence[Triplets], step: float) -> Triplets:
    """Return the finite difference derivative of a matrix; constant entries cancel exactly."""
    far_below, below, above, far_above = (one.dense() for one in matrices)
    whole, half = (far_above - far_below) / (2.0 * step), (above - below) / step
    return Triplets.from_dense((4.0 * half - whole) / 3.0)


def _repeated_groups(omegas: FloatArray) -> list[list[int]]:
    """Return the groups of repeated frequencies as lists of indices."""
    found: list[list[int]] = []
    for i, omega in enumerate(omegas.tolist()):
        if found and omega - omegas[found[-1][-1]] <= _REPEATED_TOLERANCE * omega:
            found[-1].append(i)
        else:
            found.append([i])
    return found


def _symmetric(matrix: FloatArray) -> FloatArray:
    return 0.5 * (matrix + matrix.T)
