"""Point masses and scalar springs: kinetic energy of a rigid body, stiffness matrices."""

import numpy as np
import pytest

from flexcam.core.errors import InputError
from flexcam.fem.dofs import dof_map
from flexcam.fem.mesh import chain
from flexcam.fem.rigid_bodies import PointMass, mass_at, scalar_matrix


def test_kinetic_energy_of_body_with_offset():
    # T = m |v + w x r|^2/2 + w J w/2, with v and w of the node and r to the centre.
    rng = np.random.default_rng(4)
    mass, inertia, r = 1.7, (0.4, 0.5, 0.3), (0.2, -0.6, 1.1)
    matrix = PointMass(mass, inertia, r).matrix()
    for v, w in rng.standard_normal((5, 2, 3)):
        energy = mass * np.sum((v + np.cross(w, r)) ** 2) / 2 + w @ (np.array(inertia) * w) / 2
        motion = np.concatenate([v, w])
        assert motion @ matrix @ motion / 2 == pytest.approx(energy, rel=1e-13)
    np.testing.assert_array_equal(matrix, matrix.T)


def test_products_of_inertia_match_separate_masses():
    """Four masses on arms about their centre, as one body and as separate masses."""
    rng = np.random.default_rng(8)
    masses, places = rng.uniform(0.1, 1.0, 4), rng.standard_normal((4, 3))
    centre = masses @ places / masses.sum()
    x, y, z = (places - centre).T
    moments = tuple(float(masses @ (a * a + b * b)) for a, b in ((y, z), (x, z), (x, y)))
    products = tuple(float(masses @ (a * b)) for a, b in ((x, y), (x, z), (y, z)))
    body = PointMass(float(masses.sum()), moments, tuple(centre.tolist()), products)
    parts = [PointMass(float(m), offset=tuple(r)).matrix() for m, r in zip(masses, places.tolist(), strict=True)]
    np.testing.assert_allclose(body.matrix(), np.sum(parts, axis=0), atol=1e-13)


def test_mass_on_free_components_only():
    mesh = chain((0, 0, 0), (1, 0, 0), 1)
    dofs = dof_map(mesh, [("end", ("uy", "rx"))])
    matrix = mass_at(1, PointMass(2.0, offset=(0.0, 0.5, 0.0)), dofs).dense()
    assert matrix.shape == (10, 10)
    assert np.trace(matrix) == pytest.approx(2.0 * 2 + 0.5)  # ux, uz; ry has no arm along y, rz has m y^2


def test_spring_on_difference_of_unknowns():
    row = np.array([1.0, 0.0, -2.0])
    np.testing.assert_array_equal(scalar_matrix(row, 3.0).dense(), 3.0 * np.outer(row, row))


@pytest.mark.parametrize(
    "make",
    [
        lambda: PointMass(-1.0),
        lambda: PointMass(1.0, (1.0, 1.0, 3.0)),
        lambda: PointMass(1.0, (0, 0, -1)),
        lambda: PointMass(1.0, (1.0, 1.0, 1.0), products=(0.9, 0.0, 0.0)),
    ],
)
def test_invalid_body_raises_error(make):
    with pytest.raises(InputError):
        make()
