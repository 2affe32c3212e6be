"""Rigid-body motions from connections, supports and springs, independent of units and mesh size.

The reference is statics: a free part has six motions; each independent support or spring removes one.
"""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from flexcam.dynamics import Cause, RunFailedError, static_displacement
from flexcam.fem.assembly import Member, build_beams, stiffness
from flexcam.fem.dofs import COMPONENTS, direction, dof_map
from flexcam.fem.mesh import Mesh, chain
from flexcam.fem.rigid_bodies import free_motions, scalar_matrix
from flexcam.fem.sections import Section

TURN = Rotation.random(rng=np.random.default_rng(11)).as_matrix()
AXES = {"x": np.eye(3), "z": np.array([[0, 0, 1.0], [1, 0, 0], [0, 1, 0]]).T, "skew": TURN}
SECTION = Section(A=4e-4, Iy=2e-8, Iz=7e-9, J=1e-8)
BEARINGS = [("start", ("uy", "uz")), ("end", ("uy", "uz"))]


def bar(supports=(), *, axes=AXES["x"], parts=4, length=0.5):
    mesh = chain((0, 0, 0), length * (axes @ [1.0, 0, 0]), parts, "bar")
    return mesh, dof_map(mesh, supports)


def two_bars(axes):
    nodes = np.array([[0, 0, 0], [0.4, 0, 0], [0, 0.3, 0], [0.4, 0.3, 0.1]]) @ axes.T
    mesh = Mesh(nodes, {"one": [0, 1], "two": [2, 3]}, {"a": [1], "b": [3]})
    return mesh, dof_map(mesh, [])


def stiffness_matrix(steel, mesh, dofs, springs=()):
    K = stiffness(build_beams(mesh, {name: Member(steel, SECTION) for name in mesh.lines}), dofs)
    return sum((scalar_matrix(row, 4e4) for row in springs), K)


def assert_no_strain(K, motions):
    """Assert that entries of K times a motion cancel up to rounding of the maximum entry."""
    largest = np.abs(K.dense()) @ np.abs(motions)
    assert np.abs(K.multiply(motions)).max() <= 1e-13 * largest.max()


@pytest.mark.parametrize("axes", AXES.values(), ids=AXES)
def test_free_part_has_six_motions(steel, axes):
    mesh, dofs = bar(axes=axes)
    motions = free_motions(mesh, dofs, [])
    assert np.linalg.matrix_rank(motions) == motions.shape[1] == 6
    assert_no_strain(stiffness_matrix(steel, mesh, dofs), motions)


@pytest.mark.parametrize("axes", AXES.values(), ids=AXES)
@pytest.mark.parametrize(("springs", "count"), [(0, 12), (1, 11)], ids=["apart", "a spring between them"])
def test_motions_of_two_parts(steel, axes, springs, count):
    mesh, dofs = two_bars(axes)
    pull = direction([1.0, 2.0, -0.5])
    rows = [dofs.vector(mesh.node("a"), pull) - dofs.vector(mesh.node("b"), pull)][:springs]
    motions = free_motions(mesh, dofs, rows)
    assert np.linalg.matrix_rank(motions) == motions.shape[1] == count
    assert_no_strain(stiffness_matrix(steel, mesh, dofs, rows), motions)


def test_shaft_in_two_bearings_slides_and_rotates(steel):
    mesh, dofs = bar(BEARINGS)
    motions = dofs.nodal(free_motions(mesh, dofs, []).T)
    assert len(motions) == 2
    assert np.abs(motions[:, :, [1, 2, 4, 5]]).max() <= 1e-14 * np.abs(motions).max()
    assert np.abs(np.ptp(motions[:, :, [0, 3]], axis=1)).max() <= 1e-14 * np.abs(motions).max()


@pytest.mark.parametrize(("component", "left"), [("ux", "rx"), ("rx", "ux")])
def test_spring_removes_one_motion(steel, component, left):
    mesh, dofs = bar(BEARINGS)
    row = dofs.vector(mesh.node("end"), direction(component))
    motions = free_motions(mesh, dofs, [row])
    assert motions.shape[1] == 1
    moving = {dofs.names[i].rpartition(".")[2] for i in np.flatnonzero(np.abs(motions[:, 0]) > 1e-12)}
    assert moving == {left}
    assert_no_strain(stiffness_matrix(steel, mesh, dofs, [row]), motions)


@pytest.mark.parametrize(
    ("held", "count"), [(("uy", "uz"), 1), (("ux", "uy"), 2), (("ux", "uy", "uz"), 1), (("rx",), 2)]
)
def test_motions_of_skew_bar_with_supports(steel, held, count):
    """The bar is along (1, 1, 0) with a ball joint at its root; the tip moves by (-wz, wz, wx - wy) L/sqrt 2."""
    axes = np.array([[1.0, -1.0, 0], [1.0, 1.0, 0], [0, 0, np.sqrt(2.0)]]) / np.sqrt(2.0)
    mesh, dofs = bar([("start", ("ux", "uy", "uz")), ("end", held)], axes=axes)
    motions = free_motions(mesh, dofs, [])
    assert motions.shape[1] == count
    assert_no_strain(stiffness_matrix(steel, mesh, dofs), motions)


@pytest.mark.parametrize("parts", [1, 5000])
def test_fine_cantilever_has_no_motions(parts):
    """At 5000 elements the minimum eigenvalue of the scaled stiffness, about 5000^-4 = 2e-15, is rounding."""
    assert free_motions(*bar([("start", COMPONENTS)], parts=parts), []).shape[1] == 0


@pytest.mark.parametrize("length", [1e-6, 1e6])
def test_motions_are_independent_of_unit_of_length(length):
    assert free_motions(*bar(length=length), []).shape[1] == 6
    assert free_motions(*bar(BEARINGS, length=length), []).shape[1] == 2


@pytest.mark.parametrize("size", [1e-12, 1.0, 1e12])
@pytest.mark.parametrize("component", ["ux", "rx"])
@pytest.mark.parametrize("parts", [4, 140], ids=["dense", "sparse"])
def test_load_on_free_motion_raises_error(steel, parts, component, size):
    mesh, dofs = bar(BEARINGS, parts=parts)
    load = size * dofs.vector(mesh.node("end"), direction(component))
    with pytest.raises(RunFailedError, match=rf"\.{component}") as failure:
        static_displacement(stiffness_matrix(steel, mesh, dofs), load, dofs.names, free_motions(mesh, dofs, []))
    assert failure.value.status.cause is Cause.SINGULAR


@pytest.mark.parametrize("size", [1e-12, 1.0, 1e12])
def test_free_motion_without_load_is_valid(steel, size):
    """The load P gives P L^3/(48 EI) at the middle of a shaft that may slide and rotate."""
    mesh, dofs = bar(BEARINGS)
    load = size * dofs.vector(2, direction("uy"))
    u = dofs.nodal(
        static_displacement(stiffness_matrix(steel, mesh, dofs), load, dofs.names, free_motions(mesh, dofs, []))
    )
    upright = abs(build_beams(mesh, {"bar": Member(steel, SECTION)}).triads[0, 1, 1]) > 0.5  # local y along global y
    Iz = SECTION.Iz if upright else SECTION.Iy
    assert u[2, 1] == pytest.approx(size * 0.5**3 / (48.0 * steel.E * Iz), rel=1e-10)  # condition of 4 elements
    assert np.abs(u[:, [0, 3]]).max() <= 1e-12 * np.abs(u).max()
