"""Triplets, factorization and null space, against dense numpy, on both sides of the dense limit, in any unit."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from flexcam.core import (
    DENSE_LIMIT,
    SingularMatrixError,
    Triplets,
    factorize,
    null_space,
    select_constraints,
    select_storage,
)
from flexcam.fem.assembly import Member, build_beams, mass, stiffness
from flexcam.fem.dofs import dof_map
from flexcam.fem.mesh import Mesh, refine
from flexcam.fem.sections import Material, Section

STEEL = Material(2e11, 0.3, 7800.0)


@pytest.fixture(scope="module")
def triplets():
    rng = np.random.default_rng(2)
    return Triplets(
        7, rng.integers(0, 7, 40), rng.integers(0, 7, 40), rng.standard_normal(40)
    )  # with repeated positions


def dense_matrix(t):
    full = np.zeros((t.size, t.size))
    np.add.at(full, (t.rows, t.cols), t.values)
    return full


def test_triplets_match_dense_matrix(triplets):
    full, x = dense_matrix(triplets), np.arange(7.0)
    np.testing.assert_allclose(triplets.dense(), full, atol=1e-15)
    np.testing.assert_allclose(triplets.csr().toarray(), full, atol=1e-15)
    np.testing.assert_allclose(triplets.times(x), full @ x, atol=1e-14)
    np.testing.assert_allclose(triplets.diagonal(), np.diag(full), atol=1e-15)
    np.testing.assert_allclose((triplets + triplets.scale(-0.5)).dense(), 0.5 * full, atol=1e-15)
    index = np.array([5, 0, 3])
    np.testing.assert_allclose(triplets.part(index).dense(), full[np.ix_(index, index)], atol=1e-15)
    np.testing.assert_allclose(Triplets.from_dense(full).dense(), full, atol=0)


def test_outer_product_triplets():
    left, right = np.array([0.0, 2.0, 1.0]), np.array([1.0, 0.0, -1.0])
    np.testing.assert_array_equal(Triplets.outer(left, right, 3.0).dense(), 3 * np.outer(left, right))


def grounded_chain(n, unit=1.0):
    i = np.arange(n - 1)
    diagonal = Triplets(n, np.arange(n), np.arange(n), unit * np.linspace(2.0, 3.0, n))
    ones = -unit * np.ones(n - 1)
    return diagonal + Triplets(n, i, i + 1, ones) + Triplets(n, i + 1, i, ones)


@pytest.mark.parametrize("n", [5, DENSE_LIMIT, DENSE_LIMIT + 1])
@pytest.mark.parametrize("columns", [(), (3,)])
def test_factorize_matches_dense_solution(n, columns):
    matrix, right = grounded_chain(n), np.random.default_rng(0).standard_normal((n, *columns))
    np.testing.assert_allclose(factorize(matrix).solve(right), np.linalg.solve(matrix.dense(), right), rtol=1e-9)
    np.testing.assert_allclose(select_storage(matrix) @ right, matrix.dense() @ right, atol=1e-13)


@pytest.mark.parametrize("n", [4, DENSE_LIMIT + 1], ids=["dense", "sparse"])
@pytest.mark.parametrize("unit", [1e-6, 1.0, 1e6])
def test_unknown_without_stiffness_is_named(n, unit):
    matrix = grounded_chain(n, unit)
    alive = (matrix.rows != 2) & (matrix.cols != 2)
    dead = Triplets(n, matrix.rows[alive], matrix.cols[alive], matrix.values[alive])
    with pytest.raises(SingularMatrixError) as fault:
        factorize(dead)
    assert fault.value.unknowns == (2,)


@pytest.mark.parametrize("n", [4, DENSE_LIMIT + 1], ids=["dense", "sparse"])
def test_unknowns_of_rigid_pair_are_named(n):
    cut = grounded_chain(n).part(np.arange(2, n))
    floating = Triplets(2, np.array([0, 0, 1, 1]), np.array([0, 1, 0, 1]), np.array([1.0, -1.0, -1.0, 1.0]))
    whole = Triplets(
        n,
        np.append(floating.rows, cut.rows + 2),
        np.append(floating.cols, cut.cols + 2),
        np.append(floating.values, cut.values),
    )
    with pytest.raises(SingularMatrixError) as fault:
        factorize(whole)
    assert fault.value.unknowns == (0, 1)


def frame(parts, seed=0, size=1.0):
    """Return an unsupported L of two members in a random orientation."""
    corner = Rotation.random(rng=np.random.default_rng(seed)).as_matrix()
    nodes = size * np.array([[0.0, 0, 0], [0.4, 0, 0], [0.4, 0.3, 0.1]]) @ corner.T
    mesh = refine(Mesh(nodes, {"a": [0, 1], "b": [1, 2]}, {}), {"a": parts, "b": parts})
    section = Section(A=4e-4 * size**2, Iy=2e-8 * size**4, Iz=7e-9 * size**4, J=1e-8 * size**4)
    return mesh, build_beams(mesh, {"a": Member(STEEL, section), "b": Member(STEEL, section)})


@pytest.mark.parametrize(
    ("parts", "unit", "size"), [(1, 1.0, 1.0), (8, 1e-6, 1e-3), (8, 1e6, 1e6), (52, 1e-6, 1e6), (52, 1e6, 1e-3)]
)
def test_free_body_has_six_rigid_motions(parts, unit, size):
    mesh, elements = frame(parts, size=size)
    dofs = dof_map(mesh, [])
    assert (dofs.size > 2 * DENSE_LIMIT) == (parts == 52)
    free = null_space(stiffness(elements, dofs).scale(unit))
    assert free.shape == (dofs.size, 6)
    rigid = np.column_stack([dofs.rigid_motion(mesh, e) for e in np.eye(6)])
    weight = np.sqrt(stiffness(elements, dofs).diagonal())[:, None]  # makes translations and rotations comparable
    rest = weight * rigid - weight * free @ np.linalg.lstsq(weight * free, weight * rigid, rcond=None)[0]
    assert (np.linalg.norm(rest, axis=0) <= 1e-6 * np.linalg.norm(weight * rigid, axis=0)).all()


@pytest.mark.parametrize("bodies", [2, 4])
def test_unconnected_bodies_have_six_motions_each(bodies):
    nodes = np.array([[[0.0, k, 0], [1.0, k, 0.3]] for k in range(bodies)]).reshape(-1, 3)
    lines = {f"bar{k}": [2 * k, 2 * k + 1] for k in range(bodies)}
    mesh = refine(Mesh(nodes, lines, {}), dict.fromkeys(lines, 30))
    elements = build_beams(mesh, dict.fromkeys(lines, Member(STEEL, Section.circle(0.02))))
    assert null_space(stiffness(elements, dof_map(mesh, []))).shape[1] == 6 * bodies


def test_supported_body_has_no_rigid_motion():
    mesh, elements = frame(3)
    dofs = dof_map(Mesh(mesh.nodes, mesh.lines, {"root": [0]}), [("root", ("ux", "uy", "uz", "rx", "ry", "rz"))])
    assert null_space(stiffness(elements, dofs)).shape == (dofs.size, 0)
    assert null_space(mass(elements, dofs)).shape == (dofs.size, 0)


@pytest.mark.parametrize("parts", [400, 1500])
def test_fine_mesh_has_no_rigid_motion(parts):
    # A clamped slender shaft: its softest scaled eigenvalue falls as the fourth power of the element's length.
    nodes = [[0.0, 0, 0], [1.0, 0, 0]]
    mesh = refine(Mesh(nodes, {"a": [0, 1]}, {"root": [0]}), {"a": parts})
    elements = build_beams(mesh, {"a": Member(STEEL, Section.circle(0.02))})
    dofs = dof_map(mesh, [("root", ("ux", "uy", "uz", "rx", "ry", "rz"))])
    assert null_space(stiffness(elements, dofs)).shape[1] == 0


def test_select_constraints_fixes_every_motion(readonly):
    motions = np.linalg.qr(np.random.default_rng(3).standard_normal((12, 4)))[0]
    held = select_constraints(readonly(motions))
    assert len(set(held)) == 4
    assert np.linalg.matrix_rank(motions[held]) == 4


def test_arrays_of_matrix_are_read_only():
    """Systems share matrices; the caller's array remains writable."""
    values = np.ones(2)
    matrix = Triplets(2, np.arange(2), np.arange(2), values)
    with pytest.raises(ValueError, match="read-only"):
        matrix.values[0] = 2.0
    values[0] = 3.0
