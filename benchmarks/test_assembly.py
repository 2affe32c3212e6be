"""Assembly of matrices from a mesh."""

from __future__ import annotations

import pytest

from benchmarks.measure.assembly import assemble
from flexcam.fem.assembly import Member, build_beams, stiffness
from flexcam.fem.dofs import COMPONENTS, dof_map
from flexcam.fem.mesh import chain
from flexcam.fem.sections import Material, Section


@pytest.mark.parametrize("elements", [1_000, 100_000])
def test_stiffness(benchmark, elements):
    mesh = chain((0, 0, 0), (10.0, 3.0, 2.0), elements)
    member = Member(Material(E=2e11, nu=0.3, density=7800.0), Section.circle(0.02))
    beams, dofs = build_beams(mesh, {"shaft": member}), dof_map(mesh, [("start", COMPONENTS)])
    assert benchmark(stiffness, beams, dofs).size == 6 * elements


@pytest.mark.parametrize("elements", [1_000, 10_000])
def test_mesh_and_matrices(benchmark, elements):
    assert benchmark(assemble, elements) == 6 * elements
