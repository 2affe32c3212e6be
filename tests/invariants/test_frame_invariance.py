"""Invariance to rotation, numbering and units, for a frame in space with I_y different from I_z.

A rotation on the wrong side of the element matrices shows only in skew axes: hence random rotations.
"""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from flexcam.dynamics import modes, static_displacement
from flexcam.fem.assembly import Member, build_beams, geometric, mass, stiffness
from flexcam.fem.sections import Material, Section

THEORIES = [
    {"shear": False, "rotary_inertia": False}, {"shear": False, "rotary_inertia": True},
    {"shear": True, "rotary_inertia": True}, {"mass": "lumped"},
]  # fmt: skip

angles = st.floats(-3.2, 3.2)
rotations = st.tuples(angles, angles, angles).map(lambda v: Rotation.from_rotvec(v).as_matrix())


@pytest.fixture(scope="module", params=THEORIES, ids=["euler", "rayleigh", "timoshenko", "lumped"])
def theory(request):
    return request.param


def matrices(frame):
    return mass(frame.beams, frame.dofs), stiffness(frame.beams, frame.dofs)


def frequencies(frame, count=12):
    return modes(*matrices(frame), count).frequencies


def tip_displacements(frame, rotation):
    """Return the displacements of all nodes under a force and a moment at the tip that rotate with the frame."""
    push = np.concatenate([rotation @ [10.0, -3.0, 5.0], rotation @ [1.0, 2.0, -0.5]])
    load = frame.dofs.vector(frame.mesh.node("tip"), push)
    return frame.dofs.nodal(static_displacement(stiffness(frame.beams, frame.dofs), load, frame.dofs.names))


@settings(max_examples=15, deadline=None)
@given(rotation=rotations)
def test_results_rotate_with_structure(frame, theory, rotation):
    still, turned = frame(**theory), frame(rotation, **theory)
    np.testing.assert_allclose(frequencies(turned), frequencies(still), rtol=1e-9)
    expected = tip_displacements(still, np.eye(3)).reshape(-1, 2, 3) @ rotation.T
    found = tip_displacements(turned, rotation).reshape(-1, 2, 3)
    assert np.abs(found - expected).max() <= 1e-9 * np.abs(expected).max()


def test_bending_planes_differ(frame):
    """The frame distinguishes its planes: another orientation of the members changes the frequencies."""
    quarter = Rotation.from_rotvec([0.0, 0.0, np.pi / 2]).as_matrix()
    one, other = frame(), frame(quarter)
    assert np.abs(frequencies(one) / frequencies(other) - 1).max() < 1e-9
    assert one.beams.EIy[0] != one.beams.EIz[0]
    members = Member(Material(207e9, 0.29, 7800.0), Section(A=4e-4, Iy=2e-8, Iz=7e-9, J=1e-8), (1.0, 0.0, 0.0))
    turned = build_beams(one.mesh, {"a": members, "b": members})
    changed = modes(mass(turned, one.dofs), stiffness(turned, one.dofs), 4).frequencies
    assert np.abs(changed / frequencies(one, 4) - 1).max() > 1e-3


@settings(max_examples=5, deadline=None)
@given(rotation=rotations)
def test_direction_of_members_does_not_matter(frame, theory, rotation):
    ahead, back = frame(rotation, **theory), frame(rotation, backwards=True, **theory)
    np.testing.assert_allclose(frequencies(back), frequencies(ahead), rtol=1e-9)
    one, other = tip_displacements(ahead, rotation)[:3], tip_displacements(back, rotation)[:3]
    assert np.abs(one - other).max() <= 1e-9 * np.abs(one).max()


@settings(max_examples=10, deadline=None)
@given(rotation=rotations)
def test_rigid_motions_have_no_strain_energy(frame, theory, rotation):
    body = frame(rotation, held=False, **theory)
    K = stiffness(body.beams, body.dofs)
    for unit in np.eye(6):
        motion = body.dofs.rigid_motion(body.mesh, unit)
        assert np.abs(K.times(motion)).max() <= 1e-11 * np.abs(K.values).max() * np.abs(motion).max()
    found = modes(mass(body.beams, body.dofs), K)
    assert found.rigid == 6
    assert (found.omegas[:6] == 0.0).all()
    assert found.omegas[6] > 0.0


@settings(max_examples=10, deadline=None)
@given(rotation=rotations)
def test_mass_and_inertia_of_body(frame, theory, rotation):
    """Translations have mass rho A L in each direction; rotations have the inertia tensor, except for lumping."""
    body = frame(rotation, held=False, **theory)
    M = mass(body.beams, body.dofs)
    motions = np.column_stack([body.dofs.rigid_motion(body.mesh, e) for e in np.eye(6)])
    inertia = np.column_stack([motions.T @ M.times(m) for m in motions.T]).T
    total = float(np.sum(body.beams.rho_A * body.beams.length))
    np.testing.assert_allclose(inertia[:3, :3], total * np.eye(3), atol=1e-12 * total)
    if theory.get("mass") != "lumped":
        expected = inertia_tensor(body)
        np.testing.assert_allclose(inertia[3:, 3:], expected, atol=1e-11 * np.abs(expected).max())


def inertia_tensor(body):
    """Return the inertia tensor about the origin: slender rods plus the inertia of the sections."""
    tensor = np.zeros((3, 3))
    b = body.beams
    ends = body.mesh.nodes[b.nodes]
    for e in range(len(b)):
        p, d = ends[e].mean(axis=0), ends[e, 1] - ends[e, 0]
        square = np.outer(p, p) + np.outer(d, d) / 12
        tensor += b.rho_A[e] * b.length[e] * (np.trace(square) * np.eye(3) - square)
        own = np.diag([b.rho_Ip[e], b.rho_Iy[e], b.rho_Iz[e]]) * b.length[e]
        tensor += b.triads[e].T @ own @ b.triads[e]
    return tensor


def test_matrices_are_symmetric_and_positive(frame, theory):
    body = frame(Rotation.from_rotvec([0.4, -1.0, 0.7]).as_matrix(), **theory)
    for matrix in matrices(body):
        dense = matrix.dense()
        assert np.abs(dense - dense.T).max() <= 1e-14 * np.abs(dense).max()
        d = 1 / np.sqrt(np.diag(dense))
        assert np.linalg.eigvalsh(d[:, None] * dense * d).min() > 0.0
    force = np.linspace(-1.0, 1.0, len(body.beams))
    G = geometric(body.beams, force, body.dofs).dense()
    assert np.abs(G - G.T).max() <= 1e-14 * np.abs(G).max()


@pytest.mark.parametrize(("length", "weight"), [(1e-6, 1e6), (1e6, 1e-6)])
def test_results_scale_with_units(frame, theory, length, weight):
    """Lengths in um or Mm and masses in mg or kt (E and rho follow): equal frequencies, scaled displacements."""
    unit = Material(207e9 * weight / length, 0.29, 7800.0 * weight / length**3)
    one, other = frame(**theory), frame(material=unit, size=length, **theory)
    np.testing.assert_allclose(frequencies(other), frequencies(one), rtol=1e-9)
    push = np.concatenate([weight * length * np.array([1.0, 2.0, 3.0]), np.zeros(3)])
    K = stiffness(other.beams, other.dofs)
    u = static_displacement(K, other.dofs.vector(2, push), other.dofs.names)
    K1 = stiffness(one.beams, one.dofs)
    u1 = static_displacement(K1, one.dofs.vector(2, push / (weight * length)), one.dofs.names)
    np.testing.assert_allclose(other.dofs.nodal(u)[:, :3], length * one.dofs.nodal(u1)[:, :3], rtol=1e-9)


def test_arguments_are_unchanged(frame, readonly):
    body = frame()
    force = readonly(np.ones(len(body.beams)))
    for name in ("length", "triads", "EA", "rho_A", "phi_y", "lumped"):
        getattr(body.beams, name).setflags(write=False)
    M, K, G = (mass(body.beams, body.dofs), stiffness(body.beams, body.dofs), geometric(body.beams, force, body.dofs))
    for part in (M, K, G):
        part.values.setflags(write=False)
    before = M.values.copy(), K.values.copy()
    modes(M, K + G)
    np.testing.assert_array_equal(M.values, before[0])
    np.testing.assert_array_equal(K.values, before[1])
