"""Bending and axial matrices against Gauss integration of independently written shape functions.

Interdependent interpolation of the Timoshenko beam: Z. Friedman, J. B. Kosmatka, Comput. Struct. 47 (1993), eqs. 12-15:
with xi = x/L, deflection v = (f v1 + ...)/(1 + phi), rotation of the section r, shear strain v' - r.
"""

import numpy as np
import pytest

from flexcam.fem.elements import bending

L, EI, RHO_A, RHO_I, N = 0.37, 2.3e3, 5.1, 0.013, -41.0
POINTS, WEIGHTS = np.polynomial.legendre.leggauss(8)
XI = 0.5 * (POINTS + 1.0)
TOLERANCE = 1e-13  # rounding: 8 Gauss points integrate degree 15 exactly, the integrands have degree 6


def integral(left, right):
    return np.einsum("g,gi,gj->ij", 0.5 * L * WEIGHTS, left, right)


def rotation(phi):
    z = XI[:, None]
    parts = (6 * (z**2 - z) / L, 3 * z**2 - (4 + phi) * z + 1 + phi, -6 * (z**2 - z) / L, 3 * z**2 - (2 - phi) * z)
    return np.hstack(parts) / (1 + phi)


def curvature(phi):
    z = XI[:, None]
    parts = (6 * (2 * z - 1) / L, 6 * z - 4 - phi, -6 * (2 * z - 1) / L, 6 * z - 2 + phi)
    return np.hstack(parts) / (1 + phi) / L


def deflection(phi):
    z = XI[:, None]
    parts = (
        2 * z**3 - 3 * z**2 - phi * z + 1 + phi,
        L * (z**3 - (2 + phi / 2) * z**2 + (1 + phi / 2) * z),
        -(2 * z**3 - 3 * z**2 - phi * z),
        L * (z**3 - (1 - phi / 2) * z**2 - phi / 2 * z),
    )
    return np.hstack(parts) / (1 + phi)


def slope(phi):
    z = XI[:, None]
    parts = (
        (6 * z**2 - 6 * z - phi) / L,
        3 * z**2 - (4 + phi) * z + 1 + phi / 2,
        -(6 * z**2 - 6 * z - phi) / L,
        3 * z**2 - (2 - phi) * z - phi / 2,
    )
    return np.hstack(parts) / (1 + phi)


def is_close(matrix, reference):
    return np.abs(matrix - reference).max() <= TOLERANCE * np.abs(reference).max()


@pytest.fixture(params=[0.0, 0.3, 5.0])
def phi(request):
    return request.param


def test_bending_stiffness(phi):
    strain = slope(phi) - rotation(phi)
    shear = 12 * EI / (phi * L**2) * integral(strain, strain) if phi else 0.0  # kappa A G = 12 E I/(phi L^2)
    expected = EI * integral(curvature(phi), curvature(phi)) + shear
    assert is_close(bending.stiffness(np.array([EI]), np.array([L]), np.array([phi]))[0], expected)


@pytest.mark.parametrize(("rho_A", "rho_I"), [(RHO_A, 0.0), (0.0, RHO_I), (RHO_A, RHO_I)])
def test_consistent_mass(phi, rho_A, rho_I):
    expected = rho_A * integral(deflection(phi), deflection(phi)) + rho_I * integral(rotation(phi), rotation(phi))
    made = bending.consistent_mass(np.array([rho_A]), np.array([rho_I]), np.array([L]), np.array([phi]))[0]
    assert is_close(made, expected)


def test_geometric_stiffness(phi):
    expected = N * integral(slope(phi), slope(phi))
    assert is_close(bending.geometric(np.array([N]), np.array([L]), np.array([phi]))[0], expected)


def test_constant_curvature_is_reproduced(phi):
    # v = x^2/2, r = x: a state of pure bending with unit curvature, so the energy is EI L/2 for any phi.
    ends = np.array([0.0, 0.0, L**2 / 2, L])
    k = bending.stiffness(np.array([EI]), np.array([L]), np.array([phi]))[0]
    assert ends @ k @ ends == pytest.approx(EI * L, rel=1e-12)


@pytest.mark.parametrize("lumped", [0.0, 1.0])
def test_bar_stiffness_and_mass(lumped):
    shapes = np.column_stack([1 - XI, XI])
    strain = np.tile([-1 / L, 1 / L], (len(XI), 1))
    assert is_close(bending.bar_stiffness(np.array([EI]), np.array([L]))[0], EI * integral(strain, strain))
    mass = bending.bar_mass(np.array([RHO_A]), np.array([L]), np.array([lumped]))[0]
    expected = RHO_A * integral(shapes, shapes)
    assert is_close(mass, np.diag(expected.sum(axis=1)) if lumped else expected)


def test_lumped_mass_follows_hrz_scaling():
    # HRZ: diagonal of the consistent matrix scaled to the total mass: rotations 4/(2 156) m L^2 = m L^2/78.
    lumped = bending.lumped_mass(np.array([RHO_A]), np.array([0.0]), np.array([L]))[0]
    consistent = bending.consistent_mass(np.array([RHO_A]), np.array([0.0]), np.array([L]), np.array([0.0]))[0]
    scale = RHO_A * L / (consistent[0, 0] + consistent[2, 2])
    assert is_close(lumped, scale * np.diag(np.diag(consistent)))


def test_elements_are_independent():
    both = np.array([EI, 2 * EI]), np.array([L, 3 * L]), np.array([0.0, 0.7])
    together = bending.stiffness(*both)
    for i in range(2):
        np.testing.assert_array_equal(together[i], bending.stiffness(*(x[i : i + 1] for x in both))[0])
