"""Matrices of a two-node beam: a bar for axial motion and torsion, and bending in one principal plane.

The bar has linear interpolation. Its unknowns are u1, u2 along the bar or the twists of its ends (Saint-Venant
torsion): J. S. Przemieniecki, Theory of Matrix Structural Analysis (1968), eq. 5.82 (stiffness) and 11.27 (mass).

Bending has optional shear deformation. Unknowns v1, r1, v2, r2: deflection and rotation of the section, r = dv/dx for a
slender beam. The shear parameter is ``phi = 12 E I/(kappa A G L^2)``; phi = 0 is the Euler-Bernoulli beam. The
interpolation satisfies the homogeneous static equations, so static nodal values are exact for both theories.

Sources: stiffness: J. S. Przemieniecki, Theory of Matrix Structural Analysis (1968), eq. 5.116; masses: Z. Friedman and
J. B. Kosmatka, An improved two-node Timoshenko beam finite element, Comput. Struct. 47 (1993), eqs. 28-30; geometric
stiffness: J. B. Kosmatka, An improved two-node finite element for stability and natural frequencies of axially loaded
Timoshenko beams, Comput. Struct. 57 (1995). The tests check the matrices by integrating the shape functions.
"""

from __future__ import annotations

import numpy as np

from flexcam.core import FloatArray

_SPRING = np.array([[1.0, -1.0], [-1.0, 1.0]])
_CONSISTENT = np.array([[2.0, 1.0], [1.0, 2.0]]) / 6.0
_LUMPED = np.array([[1.0, 0.0], [0.0, 1.0]]) / 2.0


def bar_stiffness(rigidity: FloatArray, length: FloatArray) -> FloatArray:
    """Return EA/L [[1, -1], [-1, 1]] per element.

    Parameters
    ----------
    rigidity, length
        EA (N) for a bar, GJ (N m^2) for torsion; element lengths, m; shape (e,) each.

    Returns
    -------
    ndarray
        Shape (e, 2, 2), N/m (torsion: N m).

    Examples
    --------
    >>> bar_stiffness(np.array([6.0]), np.array([2.0]))[0]
    array([[ 3., -3.],
           [-3.,  3.]])
    """
    return (rigidity / length)[:, None, None] * _SPRING


def bar_mass(inertia: FloatArray, length: FloatArray, lumped: FloatArray) -> FloatArray:
    """Return the consistent mass rho A L/6 [[2, 1], [1, 2]], or half the mass at each end if lumped.

    Parameters
    ----------
    inertia, length, lumped
        rho A (kg/m) for a bar, rho (Iy + Iz) (kg m) for torsion; lengths, m; 1 where lumped, else 0; shape (e,) each.

    Returns
    -------
    ndarray
        Shape (e, 2, 2), kg (torsion: kg m^2).

    Examples
    --------
    >>> bar_mass(np.array([3.0]), np.array([2.0]), np.array([0.0]))[0]
    array([[2., 1.],
           [1., 2.]])
    """
    shape = _CONSISTENT + lumped[:, None, None] * (_LUMPED - _CONSISTENT)
    return (inertia * length)[:, None, None] * shape


def _symmetric(
    L: FloatArray, a: FloatArray, b: FloatArray, c: FloatArray, d: FloatArray, e: FloatArray, f: FloatArray
) -> FloatArray:
    """Return [[a, bL, c, dL], [., eL^2, -dL, fL^2], [., ., a, -bL], [., ., ., eL^2]] per element.

    Every matrix of the element has this form because exchanging the ends of the beam maps (v1, r1, v2, r2) to (v2, -r2,
    v1, -r1).
    """
    rows = [
        [a, b * L, c, d * L],
        [b * L, e * L**2, -d * L, f * L**2],
        [c, -d * L, a, -b * L],
        [d * L, f * L**2, -b * L, e * L**2],
    ]
    return np.moveaxis(np.array(rows), -1, 0)


def stiffness(EI: FloatArray, L: FloatArray, phi: FloatArray) -> FloatArray:
    """Return EI/((1+phi) L^3) [12, 6L, -12, 6L; ., (4+phi)L^2, -6L, (2-phi)L^2; ...].

    Parameters
    ----------
    EI, L, phi
        Bending rigidity, N m^2; lengths, m; shear parameter; shape (e,) each.

    Returns
    -------
    ndarray
        Shape (e, 4, 4), local axes.

    Examples
    --------
    >>> one = np.ones(1)
    >>> stiffness(one, one, 0.0 * one)[0]
    array([[ 12.,   6., -12.,   6.],
           [  6.,   4.,  -6.,   2.],
           [-12.,  -6.,  12.,  -6.],
           [  6.,   2.,  -6.,   4.]])
    """
    k = EI / ((1.0 + phi) * L**3)
    return _symmetric(L, 12 * k, 6 * k, -12 * k, 6 * k, (4 + phi) * k, (2 - phi) * k)


def consistent_mass(rho_A: FloatArray, rho_I: FloatArray, L: FloatArray, phi: FloatArray) -> FloatArray:
    """Return the consistent mass with the rotary inertia.

    For phi = 0 it is rho A L/420 [156, 22L, 54, -13L; ., 4L^2, 13L, -3L^2; ...] plus rho I/(30L) [36, 3L, -36, 3L; .,
    4L^2, -3L, -L^2; ...].

    Parameters
    ----------
    rho_A, rho_I, L, phi
        Mass (kg/m) and rotary inertia (kg m; zero where switched off) per length; lengths, m; shear parameter; shape
        (e,) each.

    Returns
    -------
    ndarray
        Shape (e, 4, 4), local axes.

    Examples
    --------
    >>> one = np.ones(1)
    >>> consistent_mass(420 * one, 30 * one, one, 0 * one)[0].round(9)
    array([[192.,  25.,  18., -10.],
           [ 25.,   8.,  10.,  -4.],
           [ 18.,  10., 192., -25.],
           [-10.,  -4., -25.,   8.]])
    """
    m, r = rho_A * L / (840.0 * (1.0 + phi) ** 2), rho_I / (30.0 * L * (1.0 + phi) ** 2)
    translation = _symmetric(
        L,
        (312 + 588 * phi + 280 * phi**2) * m,
        (44 + 77 * phi + 35 * phi**2) * m,
        (108 + 252 * phi + 140 * phi**2) * m,
        -(26 + 63 * phi + 35 * phi**2) * m,
        (8 + 14 * phi + 7 * phi**2) * m,
        -(6 + 14 * phi + 7 * phi**2) * m,
    )
    return translation + _symmetric(
        L, 36 * r, (3 - 15 * phi) * r, -36 * r, (3 - 15 * phi) * r,
        (4 + 5 * phi + 10 * phi**2) * r, (-1 - 5 * phi + 5 * phi**2) * r,
    )  # fmt: skip


def geometric(N: FloatArray, L: FloatArray, phi: FloatArray) -> FloatArray:
    """Return the geometric stiffness; for phi = 0 it is N/(30L) [36, 3L, -36, 3L; ., 4L^2, -3L, -L^2; ...].

    Parameters
    ----------
    N, L, phi
        Axial force, N, tension positive; lengths, m; shear parameter; shape (e,) each.

    Returns
    -------
    ndarray
        Shape (e, 4, 4), local axes.

    Examples
    --------
    >>> one = np.ones(1)
    >>> geometric(30 * one, one, 0 * one)[0, 1].round(9)
    array([ 3.,  4., -3., -1.])
    """
    n = N / (60.0 * L * (1.0 + phi) ** 2)
    return _symmetric(
        L, (72 + 120 * phi + 60 * phi**2) * n, 6 * n, -(72 + 120 * phi + 60 * phi**2) * n, 6 * n,
        (8 + 10 * phi + 5 * phi**2) * n, -(2 + 10 * phi + 5 * phi**2) * n,
    )  # fmt: skip


def lumped_mass(rho_A: FloatArray, rho_I: FloatArray, L: FloatArray) -> FloatArray:
    """Return the diagonal mass: half the beam at each end, rotations by diagonal scaling (m L^2/78) plus rho I L/2.

    Source: E. Hinton, T. Rock, O. C. Zienkiewicz, A note on mass lumping, Earthq. Eng. Struct. Dyn. 4 (1976).

    Parameters
    ----------
    rho_A, rho_I, L
        Mass (kg/m) and rotary inertia (kg m; zero where switched off) per length, lengths, m; shape (e,) each.

    Returns
    -------
    ndarray
        Shape (e, 4, 4), diagonal, local axes.

    Examples
    --------
    >>> one = np.ones(1)
    >>> np.diag(lumped_mass(78 * one, 0 * one, one)[0])
    array([39.,  1., 39.,  1.])
    """
    half, turn = rho_A * L / 2.0, rho_A * L**3 / 78.0 + rho_I * L / 2.0
    return np.stack([half, turn, half, turn], axis=-1)[:, None, :] * np.eye(4)
