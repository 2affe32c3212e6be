"""Static displacement: exact nodal values; unloaded free motions are valid, loaded ones are errors that name them."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from flexcam.core import Triplets
from flexcam.dynamics import (
    AngleVector,
    Cause,
    ConstantSpeed,
    LocalForce,
    RunFailedError,
    System,
    constant,
    equilibrium,
    spring_damper,
    static_displacement,
)
from flexcam.fem.assembly import Member, build_beams, stiffness
from flexcam.fem.dofs import COMPONENTS, dof_map
from flexcam.fem.mesh import Mesh, chain, refine
from flexcam.fem.sections import Section


def shaft(steel, parts, supports):
    mesh = chain((0, 0, 0), (0.5, 0, 0), parts)
    dofs = dof_map(mesh, supports)
    return mesh, dofs, stiffness(build_beams(mesh, {"shaft": Member(steel, Section.circle(0.02))}), dofs)


BEARINGS = [("start", ("uy", "uz", "rx")), ("end", ("uy", "uz"))]


@pytest.mark.parametrize("parts", [4, 40, 140], ids=["24-dof", "dense", "sparse"])
def test_unloaded_axial_motion_is_valid(steel, parts):
    # Simply supported, P at the middle: P L^3/(48 EI); ux is free everywhere and not loaded.
    _, dofs, K = shaft(steel, parts, BEARINGS)
    load = np.zeros(dofs.size)
    load[dofs.names.index(f"node {parts // 2}.uy")] = 100.0
    u = dofs.nodal(static_displacement(K, load, dofs.names))
    expected = 100.0 * 0.5**3 / (48 * steel.E * Section.circle(0.02).Iz)
    assert u[parts // 2, 1] == pytest.approx(expected, rel=1e-7)  # the condition of K, (1/h)^4, times rounding
    assert np.abs(u[:, 0]).max() <= 1e-12 * expected


@pytest.mark.parametrize("parts", [4, 140], ids=["dense", "sparse"])
def test_loaded_axial_motion_raises_error(steel, parts):
    _, dofs, K = shaft(steel, parts, BEARINGS)
    load = np.zeros(dofs.size)
    load[dofs.names.index("end.ux")] = 1.0
    with pytest.raises(RunFailedError, match=r"\.ux") as failure:
        static_displacement(K, load, dofs.names)
    assert failure.value.status.cause is Cause.SINGULAR
    assert failure.value.status.remedy
    assert ".uy" not in failure.value.status.text


def test_loaded_twist_raises_error(steel):
    _, dofs, K = shaft(steel, 3, [("start", ("ux", "uy", "uz")), ("end", ("uy", "uz"))])
    load = np.zeros(dofs.size)
    load[dofs.names.index("end.rx")] = 1.0
    with pytest.raises(RunFailedError, match=r"start\.rx"):
        static_displacement(K, load, dofs.names)


def deform_free_body(steel, parts, unit):
    """Return the strained displacement of two unsupported members at an angle under random balanced loads."""
    turn = Rotation.random(rng=np.random.default_rng(5)).as_matrix()
    nodes = np.array([[0.0, 0, 0], [0.4, 0, 0], [0.4, 0.3, 0.1]]) @ turn.T
    mesh = refine(Mesh(nodes, {"a": [0, 1], "b": [1, 2]}, {}), {"a": parts, "b": parts})
    member = Member(steel, Section(A=4e-4, Iy=2e-8, Iz=7e-9, J=1e-8))
    dofs = dof_map(mesh, [])
    load = np.zeros((len(mesh.nodes), 6))
    load[:3] = unit * np.random.default_rng(6).standard_normal((3, 6))
    load[2, :3] -= load[:, :3].sum(axis=0)
    load[2, 3:] -= (load[:, 3:] + np.cross(mesh.nodes, load[:, :3])).sum(axis=0)
    K = stiffness(build_beams(mesh, {"a": member, "b": member}), dofs).scale(unit)
    u = dofs.nodal(static_displacement(K, load.ravel(), dofs.names))[:3].ravel()
    rigid = np.column_stack([dofs.nodal(dofs.rigid_motion(mesh, e))[:3].ravel() for e in np.eye(6)])
    return u - rigid @ np.linalg.lstsq(rigid, u, rcond=None)[0]


@pytest.mark.parametrize("parts", [20, 60, 200], ids=["dense", "sparse", "large"])
@pytest.mark.parametrize("unit", [1e-6, 1.0, 1e6])
def test_balanced_load_on_free_body(steel, parts, unit):
    # One element per member is exact at its nodes, so refinement adds rounding only: (parts)^4 eps = 4e-7 at 200.
    coarse, fine = deform_free_body(steel, 1, 1.0), deform_free_body(steel, parts, unit)
    assert np.abs(fine - coarse).max() <= 1e-5 * np.abs(coarse).max()


def test_arguments_are_unchanged(steel, readonly):
    _, dofs, K = shaft(steel, 2, [("start", COMPONENTS)])
    for part in (K.rows, K.cols, K.values):
        part.setflags(write=False)
    static_displacement(K, readonly(np.ones(dofs.size)), dofs.names)


def test_motion_that_a_contact_prescribes_without_force_is_accurate():
    """A chain without load or spring follows a bilateral contact: all forces are rounding."""
    stiffness, lift = 1e9 / 3.0, 0.1
    chain = np.diff(np.eye(4), axis=0)
    K = Triplets.from_dense((stiffness * chain.T @ chain).tolist())
    row = np.eye(4)[0]
    contact = LocalForce(
        "contact", (AngleVector.constant(-row),), (AngleVector.constant(row),), spring_damper(1e8), (constant(lift),)
    )
    names = tuple("abcd")
    system = System(Triplets.from_dense(np.eye(4).tolist()), Triplets.zeros(4), K, names, local_forces=(contact,))
    found = equilibrium(system, ConstantSpeed(1.0)).displacement
    np.testing.assert_allclose(found, lift, rtol=1e-6)
