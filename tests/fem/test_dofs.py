"""Numbering of the free components; refinement, element ranges, connected nodes and errors of meshes."""

from pathlib import Path

import numpy as np
import pytest

from flexcam import read_case
from flexcam.analysis.natural_modes import modes
from flexcam.case.builder import build_model
from flexcam.core.errors import InputError
from flexcam.fem.dofs import COMPONENTS, direction, dof_map
from flexcam.fem.mesh import Mesh, chain, refine
from flexcam.valvetrain import build_structure

MESH = Mesh([[0, 0, 0], [1, 0, 0], [1, 2, 0], [9, 9, 9]], {"a": [0, 1], "b": [1, 2]}, {"root": [0], "ends": [0, 2]})


def test_dof_numbers_follow_nodes():
    dofs = dof_map(MESH, [("root", ("ux", "rz")), ("ends", ("uy",))])
    assert dofs.size == 18 - 2 - 2
    assert dofs.names[0] == "root.uz"
    assert dofs.names[4] == "node 1.uy"
    assert (dofs.numbers[3] == -1).all()  # not part of an element
    assert sorted(dofs.numbers[dofs.numbers >= 0]) == list(range(dofs.size))


def test_vector_and_nodal_agree(readonly):
    dofs = dof_map(MESH, [("root", COMPONENTS)])
    unknowns = readonly(np.random.default_rng(0).standard_normal((3, dofs.size)))
    nodal = dofs.nodal(unknowns)
    assert nodal.shape == (3, 4, 6)
    assert not nodal[:, 0].any()
    weights = readonly([1.0, -2.0, 0.0, 0.5, 0.0, 3.0])
    np.testing.assert_allclose(unknowns @ dofs.vector(2, weights), nodal[:, 2] @ weights, rtol=1e-14)


def test_rigid_motion_is_translation_plus_w_cross_r():
    dofs = dof_map(MESH, [])
    w = np.array([0.3, -0.2, 0.7])
    motion = dofs.nodal(dofs.rigid_motion(MESH, np.concatenate([[1.0, 2.0, 3.0], w])))[:3]
    np.testing.assert_allclose(motion[:, :3], np.array([1.0, 2.0, 3.0]) + np.cross(w, MESH.nodes[:3]), rtol=1e-14)
    np.testing.assert_array_equal(motion[:, 3:], np.tile(w, (3, 1)))


@pytest.mark.parametrize("supports", [[("rot", ("ux",))], [("root", ("uxx",))]])
def test_misspelled_support_error_suggests_name(supports):
    with pytest.raises(InputError, match="Did you mean"):
        dof_map(MESH, supports)


def test_refinement_preserves_nodes_and_lines():
    fine = refine(MESH, {"b": 4})
    np.testing.assert_array_equal(fine.nodes[:4], MESH.nodes)
    np.testing.assert_allclose(
        fine.nodes[fine.lines["b"]], np.column_stack([np.ones(5), np.linspace(0, 2, 5), np.zeros(5)])
    )
    np.testing.assert_array_equal(fine.lines["a"], [0, 1])
    assert fine.element_ranges() == {"a": slice(0, 1), "b": slice(1, 5)}


def test_repeated_refinement_multiplies():
    once, twice = refine(MESH, {"a": 6}), refine(refine(MESH, {"a": 2}), {"a": 3})
    np.testing.assert_allclose(twice.nodes[twice.lines["a"]], once.nodes[once.lines["a"]], atol=1e-15)


def test_connected_nodes():
    mesh = Mesh(np.arange(18.0).reshape(6, 3), {"a": [0, 1], "b": [4, 5], "c": [1, 2]}, {})
    np.testing.assert_array_equal(mesh.connected_nodes(2), [0, 1, 2])
    np.testing.assert_array_equal(mesh.connected_nodes(3), [3])


def test_mesh_copies_are_read_only(readonly):
    nodes = np.array([[0.0, 0, 0], [1, 0, 0]])
    mesh = Mesh(nodes, {"a": [0, 1]}, {})
    nodes[1] = 5.0
    assert mesh.nodes[1, 0] == 1.0
    assert not mesh.nodes.flags.writeable
    assert not mesh.lines["a"].flags.writeable
    Mesh(readonly(nodes), {"a": [0, 1]}, {})


@pytest.mark.parametrize(
    ("nodes", "line", "words"),
    [([[0, 0, 0], [1, 0, 0]], [0, 2], "nodes 0 to 1"), ([[0, 0, 0], [1, 0, 0]], [0], "two or more"),
     ([[0, 0, 0], [1, 0, 0]], [0, 0], "length"), ([[0, 0, 0], [1, 0, 0], [1 + 1e-10, 0, 0]], [0, 1, 2], "length"),
     ([[0, 0, 0], [1, 0, 0], [0, 0, 0]], [0, 1], "one place"),
     ([[0, 0, 0], [np.nan, 0, 0]], [0, 1], "finite")],
)  # fmt: skip
def test_invalid_mesh_raises_error(nodes, line, words):
    with pytest.raises(InputError, match=words):
        Mesh(nodes, {"a": line}, {})


def test_chain_mesh():
    mesh = chain((0, 0, 0), (0, 0, 2), 4)
    np.testing.assert_array_equal(mesh.elements(), [[0, 1], [1, 2], [2, 3], [3, 4]])
    assert mesh.node("end") == 4
    with pytest.raises(InputError):
        chain((0, 0, 0), (1, 0, 0), 0)


def test_nodal_modes_drop_rounding():
    """Relative to a rocker motion of 1, 1e-14 at a node is rounding and 1e-6 is motion; a rotation alone is motion."""
    dofs = dof_map(MESH, [("root", COMPONENTS)]).extend(["valve"])
    turn = next(i for i, name in enumerate(dofs.names) if name.endswith(".rz"))
    shapes = np.zeros((3, dofs.size))
    shapes[:, -1] = 1.0, 1.0, 0.0
    shapes[:, 0] = 1e-14, 1e-6, 1e-14
    shapes[:, turn] = 1e-14, 1e-14, 0.5
    seen = dofs.nodal_modes(shapes, MESH.extent)
    assert not seen[0].any()
    assert np.count_nonzero(seen[1]) == 1
    assert seen[1].max() == 1e-6
    assert seen[2].max() == 0.5
    assert np.count_nonzero(seen[2]) == 1


def test_modes_of_springs_do_not_move_members():
    """Valve springs of a finger train without contact vibrate alone; in dense solutions rounding moves every node."""
    case = read_case(Path(__file__).parents[2] / "cases/direct-acting/finger.toml")
    structure, found = build_structure(build_model(case)), modes(case, 6)
    shapes = found.modes.shapes.T
    assert structure.dofs.nodal(shapes)[1].any()
    assert not structure.dofs.nodal_modes(shapes, structure.model.mesh.extent)[1].any()


def test_direction_of_six_numbers_keeps_its_arm():
    """A force of unit length with an arm of 0.1 m, not a force and a moment of unit length each."""
    assert direction([0.0, 2.0, 0.0, 0.2, 0.0, 0.0]) == pytest.approx([0.0, 1.0, 0.0, 0.1, 0.0, 0.0])
    assert direction([0.0, 0.0, 0.0, 0.0, 3.0, 4.0]) == pytest.approx([0.0, 0.0, 0.0, 0.0, 0.6, 0.8])
