"""The geometric stiffness is the tangent of the axial-bending energy EA/2 (u' + (v'^2 + w'^2)/2)^2 (von Karman).

J. S. Przemieniecki, Theory of Matrix Structural Analysis (1968), sec. 15.2. The energy uses the mean axial strain of
the element, (u2 - u1)/L + (1/2L) int (v'^2 + w'^2) dx, with Gauss integration of v' from Hermite functions.
"""

import numpy as np
import pytest

from flexcam.fem.assembly import Member, build_beams
from flexcam.fem.elements import beam
from flexcam.fem.mesh import Mesh
from flexcam.fem.sections import Material, Section

L, STRETCH = 0.6, 3e-4
POINTS, WEIGHTS = np.polynomial.legendre.leggauss(5)
Z = 0.5 * (POINTS + 1)[:, None]
SLOPE = np.hstack([6 * (Z**2 - Z) / L, 3 * Z**2 - 4 * Z + 1, -6 * (Z**2 - Z) / L, 3 * Z**2 - 2 * Z])
XY, XZ = [1, 5, 7, 11], [2, 4, 8, 10]
TURN = np.array([1, -1, 1, -1])


@pytest.fixture(scope="module")
def bar():
    member = Member(Material(2e11, 0.3, 7800.0), Section(A=2e-4, Iy=3e-9, Iz=5e-9, J=1e-9))
    return build_beams(Mesh([[0, 0, 0], [L, 0, 0]], {"bar": [0, 1]}, {}), {"bar": member})


def energy(bar, u):
    v, w = SLOPE @ u[XY], SLOPE @ (TURN * u[XZ])
    strain = (u[6] - u[0]) / L + 0.5 * WEIGHTS @ (v**2 + w**2) / 2
    return 0.5 * bar.EA[0] * L * strain**2


def second_difference(f, h):
    n = 12
    steps = h * np.eye(n)
    full = np.empty((n, n))
    for i in range(n):
        for j in range(n):
            a, b = steps[i], steps[j]
            full[i, j] = (f(a + b) - f(a - b) - f(b - a) + f(-a - b)) / (4 * h**2)
    return full


@pytest.mark.parametrize("sign", [1.0, -1.0], ids=["tension", "compression"])
def test_geometric_stiffness_is_tangent_of_energy(bar, sign):
    start = np.zeros(12)
    start[6] = sign * STRETCH * L
    force = sign * bar.EA * STRETCH
    tangent = second_difference(lambda u: energy(bar, start + u), 1e-5)
    expected = beam.geometric(bar, force)[0]
    expected[np.ix_([0, 6], [0, 6])] += bar.EA[0] / L * np.array([[1, -1], [-1, 1]])
    # Differences with h = 1e-5: quartic terms h^2 EA/L^3 = 2e-2 N/m against 1e4 N/m, rounding of energies 1e-16/h^2.
    rows = np.ix_(XY + XZ, XY + XZ)
    assert np.abs(tangent[rows] - expected[rows]).max() <= 1e-4 * np.abs(expected[rows]).max()
    assert np.abs(tangent - expected).max() <= 1e-4 * np.abs(expected).max()


def test_rigid_rotation_gives_couple_of_axial_force(bar):
    # A bar under N rotated by a small angle about z: end forces +-N v' across it.
    turn = np.zeros(12)
    turn[[5, 7, 11]] = 1.0, L, 1.0
    forces = beam.geometric(bar, np.array([100.0]))[0] @ turn
    np.testing.assert_allclose(forces[[1, 7]], [-100.0, 100.0], rtol=1e-12)
