"""Rounding of the stiffness on very fine meshes: told, never passed on as an answer."""

from __future__ import annotations

import numpy as np
import pytest

from flexcam import fem
from flexcam.fem.generate import chain
from flexcam.integrate import static_displacement
from flexcam.linalg import energy_rounding
from flexcam.modal import modes
from flexcam.response import TOO_FINE, Cause, RunFailedError
from flexcam.train import build_system

LENGTH, EI = 1.0, 207e9 * np.pi * 0.01**4 / 4


@pytest.fixture
def cantilever(steel):
    def make(elements):
        mesh = chain((0, 0, 0), (LENGTH, 0, 0), elements)
        beams = fem.beams(mesh, {"shaft": fem.Member(steel, fem.Section.circle(0.02), rotary_inertia=False)})
        dofs = fem.dof_map(mesh, [("start", fem.COMPONENTS)])
        return fem.mass(beams, dofs), fem.stiffness(beams, dofs), dofs, dofs.vector(elements, fem.direction("uy"))

    return make


def deflection(stiffness, dofs, push):
    return float(push @ static_displacement(stiffness, push, dofs.names, np.zeros((dofs.size, 0))))


@pytest.mark.parametrize("elements", [10, 100, 1000])
def test_what_is_answered_is_right_within_the_bound(cantilever, elements):
    _, stiffness, dofs, push = cantilever(elements)
    x = static_displacement(stiffness, push, dofs.names, np.zeros((dofs.size, 0)))
    bound = float(energy_rounding(stiffness, x[:, None])[0] / (x @ push))
    assert abs(float(push @ x) * 3 * EI / LENGTH**3 - 1.0) <= bound


def test_a_mesh_too_fine_is_refused_in_statics(cantilever):
    _, stiffness, dofs, push = cantilever(5000)
    with pytest.raises(RunFailedError, match="too many elements") as refusal:
        deflection(stiffness, dofs, push)
    assert refusal.value.status.cause is Cause.ROUNDING
    assert refusal.value.status.remedy


def test_and_in_modes(cantilever):
    mass, stiffness, dofs, _ = cantilever(5000)
    with pytest.raises(RunFailedError) as refusal:
        modes(mass, stiffness, 4, free=np.zeros((dofs.size, 0)))
    assert refusal.value.status.cause is Cause.ROUNDING


@pytest.mark.parametrize("unit", [1e-6, 1.0, 1e6])
def test_the_bound_has_no_units(cantilever, unit):
    _, stiffness, dofs, push = cantilever(20)
    assert deflection(stiffness.scaled(unit), dofs, push) == pytest.approx(
        deflection(stiffness, dofs, push) / unit, rel=1e-9
    )


def test_a_contact_passes_the_cause_on(published, monkeypatch):
    """Rounding is no missing spring: only a motion that nothing resists is told as one."""

    def spoilt(*_):
        raise RunFailedError(TOO_FINE)

    monkeypatch.setattr("flexcam.train.published.static_displacement", spoilt)
    with pytest.raises(RunFailedError) as refusal:
        build_system(published(1), 314.0)
    assert refusal.value.status.cause is Cause.ROUNDING
