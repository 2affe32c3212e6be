"""Matrices of the 12-DOF element against the energies of a beam in space, with different properties in each plane.

Signs follow from the definitions: rz = dv/dx, ry = -dw/dx, right-hand rule.
"""

import numpy as np
import pytest

from flexcam.core.errors import InputError
from flexcam.fem.assembly import Member, build_beams
from flexcam.fem.elements import beam
from flexcam.fem.mesh import Mesh
from flexcam.fem.sections import Material, Section

SECTION = Section(A=3e-3, Iy=2e-6, Iz=5e-6, J=4e-6, kappa_y=0.8, kappa_z=0.6)
MATERIAL = Material(E=2e11, nu=0.25, density=7000.0)
LENGTH = 0.8


@pytest.fixture(params=[False, True], ids=["euler", "timoshenko"])
def bar(request):
    mesh = Mesh([[0, 0, 0], [LENGTH, 0, 0]], {"bar": [0, 1]}, {})
    return build_beams(mesh, {"bar": Member(MATERIAL, SECTION, shear=request.param)})


def tip_flexibility(bar):
    return np.linalg.inv(beam.stiffness(bar)[0][6:, 6:])


@pytest.mark.parametrize(
    ("deflection", "turn", "sign", "second", "kappa"), [(1, 5, 1, "Iz", "kappa_y"), (2, 4, -1, "Iy", "kappa_z")]
)
def test_cantilever_in_both_planes(bar, deflection, turn, sign, second, kappa):
    # Tip load: P L^3/3EI + P L/(kappa A G), slope P L^2/2EI; tip moment: slope M L/EI (Timoshenko).
    flexibility, EI = tip_flexibility(bar), MATERIAL.E * getattr(SECTION, second)
    shear = LENGTH / (getattr(SECTION, kappa) * SECTION.A * MATERIAL.G) if bar.phi_y[0] > 0 else 0.0
    assert flexibility[deflection, deflection] == pytest.approx(LENGTH**3 / (3 * EI) + shear, rel=1e-12)
    assert flexibility[turn, deflection] == pytest.approx(sign * LENGTH**2 / (2 * EI), rel=1e-12)
    assert flexibility[turn, turn] == pytest.approx(LENGTH / EI, rel=1e-12)


def test_bar_and_torsion(bar):
    flexibility = tip_flexibility(bar)
    assert flexibility[0, 0] == pytest.approx(LENGTH / (MATERIAL.E * SECTION.A), rel=1e-12)
    assert flexibility[3, 3] == pytest.approx(LENGTH / (MATERIAL.G * SECTION.J), rel=1e-12)


@pytest.mark.parametrize(
    ("axis", "inertia"), [(3, SECTION.Iy + SECTION.Iz), (4, SECTION.Iy), (5, SECTION.Iz)], ids=["rx", "ry", "rz"]
)
def test_rotational_energy_about_centre(bar, axis, inertia):
    # Rotation about the centre: rho A L^3/12 perpendicular to the axis, and rho I L of the sections.
    motion = np.zeros((2, 6))
    motion[:, axis] = 1.0
    motion[:, :3] = np.cross(motion[:, 3:], [[-LENGTH / 2, 0, 0], [LENGTH / 2, 0, 0]])
    across = SECTION.A * LENGTH**3 / 12 if axis > 3 else 0.0
    expected = MATERIAL.density * (across + inertia * LENGTH)
    assert motion.ravel() @ beam.mass(bar)[0] @ motion.ravel() == pytest.approx(expected, rel=1e-12)


def test_rotary_inertia_can_be_switched_off():
    mesh = Mesh([[0, 0, 0], [LENGTH, 0, 0]], {"bar": [0, 1]}, {})
    plain = build_beams(mesh, {"bar": Member(MATERIAL, SECTION, rotary_inertia=False)})
    assert plain.rho_Iy[0] == plain.rho_Iz[0] == 0.0
    assert plain.rho_Ip[0] == pytest.approx(MATERIAL.density * (SECTION.Iy + SECTION.Iz))


def test_unknown_kind_of_mass_is_refused():
    with pytest.raises(InputError, match="mass: got 'Lumped', expected consistent or lumped"):
        Member(MATERIAL, SECTION, mass="Lumped")
