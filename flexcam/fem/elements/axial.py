"""Two-node bar element for axial motion and, with other factors, Saint-Venant torsion.

Linear interpolation. Source: J. S. Przemieniecki, Theory of Matrix Structural Analysis (1968), eq. 5.82 (stiffness)
and 11.27 (mass). Unknowns u1, u2 along the bar (or the twists of its ends).
"""

from __future__ import annotations

import numpy as np

from flexcam.core import FloatArray

_SPRING = np.array([[1.0, -1.0], [-1.0, 1.0]])
_CONSISTENT = np.array([[2.0, 1.0], [1.0, 2.0]]) / 6.0
_LUMPED = np.array([[1.0, 0.0], [0.0, 1.0]]) / 2.0


def stiffness(rigidity: FloatArray, length: FloatArray) -> FloatArray:
    """Return EA/L [[1, -1], [-1, 1]] per element.

    Parameters
    ----------
    rigidity
        EA (N) for a bar, GJ (N m^2) for torsion, shape (e,).
    length
        Element lengths, m, shape (e,).

    Returns
    -------
    ndarray
        Shape (e, 2, 2), N/m (torsion: N m).

    Examples
    --------
    >>> stiffness(np.array([6.0]), np.array([2.0]))[0]
    array([[ 3., -3.],
           [-3.,  3.]])
    """
    return (rigidity / length)[:, None, None] * _SPRING


def mass(inertia: FloatArray, length: FloatArray, lumped: FloatArray) -> FloatArray:
    """Return the consistent mass rho A L/6 [[2, 1], [1, 2]], or half the mass at each end if lumped.

    Parameters
    ----------
    inertia
        rho A (kg/m) for a bar, rho (Iy + Iz) (kg m) for torsion, shape (e,).
    length
        Element lengths, m, shape (e,).
    lumped
        1 where the mass is lumped, else 0, shape (e,).

    Returns
    -------
    ndarray
        Shape (e, 2, 2), kg (torsion: kg m^2).

    Examples
    --------
    >>> mass(np.array([3.0]), np.array([2.0]), np.array([0.0]))[0]
    array([[2., 1.],
           [1., 2.]])
    """
    shape = _CONSISTENT + lumped[:, None, None] * (_LUMPED - _CONSISTENT)
    return (inertia * length)[:, None, None] * shape
