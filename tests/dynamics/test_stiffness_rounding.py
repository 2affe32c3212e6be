"""Rounding of the stiffness on very fine meshes causes an error instead of a wrong result."""

import numpy as np
import pytest

from flexcam.core import energy_rounding
from flexcam.dynamics import ROUNDING_STATUS, Cause, RunFailedError, modes, static_displacement
from flexcam.fem.assembly import Member, build_beams, mass, stiffness
from flexcam.fem.dofs import COMPONENTS, direction, dof_map
from flexcam.fem.mesh import chain
from flexcam.fem.sections import Section
from flexcam.valvetrain import build_system

LENGTH, EI = 1.0, 207e9 * np.pi * 0.01**4 / 4


@pytest.fixture
def cantilever(steel):
    def make(elements):
        mesh = chain((0, 0, 0), (LENGTH, 0, 0), elements)
        beams = build_beams(mesh, {"shaft": Member(steel, Section.circle(0.02), rotary_inertia=False)})
        dofs = dof_map(mesh, [("start", COMPONENTS)])
        return mass(beams, dofs), stiffness(beams, dofs), dofs, dofs.vector(elements, direction("uy"))

    return make


def deflection(stiffness, dofs, push):
    return float(push @ static_displacement(stiffness, push, dofs.names, np.zeros((dofs.size, 0))))


@pytest.mark.parametrize("elements", [10, 100, 1000])
def test_deflection_is_within_rounding_bound(cantilever, elements):
    _, stiffness, dofs, push = cantilever(elements)
    x = static_displacement(stiffness, push, dofs.names, np.zeros((dofs.size, 0)))
    bound = float(energy_rounding(stiffness, x[:, None])[0] / (x @ push))
    assert abs(float(push @ x) * 3 * EI / LENGTH**3 - 1.0) <= bound


def test_too_fine_mesh_raises_error_in_statics(cantilever):
    _, stiffness, dofs, push = cantilever(5000)
    with pytest.raises(RunFailedError, match="too many elements") as refusal:
        deflection(stiffness, dofs, push)
    assert refusal.value.status.cause is Cause.ROUNDING
    assert refusal.value.status.remedy


def test_too_fine_mesh_raises_error_in_modes(cantilever):
    mass, stiffness, dofs, _ = cantilever(5000)
    with pytest.raises(RunFailedError) as refusal:
        modes(mass, stiffness, 4, free=np.zeros((dofs.size, 0)))
    assert refusal.value.status.cause is Cause.ROUNDING


@pytest.mark.parametrize("unit", [1e-6, 1.0, 1e6])
def test_rounding_check_is_independent_of_units(cantilever, unit):
    _, stiffness, dofs, push = cantilever(20)
    assert deflection(stiffness.scale(unit), dofs, push) == pytest.approx(
        deflection(stiffness, dofs, push) / unit, rel=1e-9
    )


def test_contact_load_preserves_rounding_status(published, monkeypatch):
    """Rounding is not reported as a missing spring."""

    def raise_rounding_error(*_):
        raise RunFailedError(ROUNDING_STATUS)

    monkeypatch.setattr("flexcam.valvetrain.loads.static_displacement", raise_rounding_error)
    with pytest.raises(RunFailedError) as refusal:
        build_system(published(1), 314.0)
    assert refusal.value.status.cause is Cause.ROUNDING
