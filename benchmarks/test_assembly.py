"""From a mesh to matrices."""

from __future__ import annotations

import pytest

from benchmarks.measure.assembly import assembled
from flexcam import fem
from flexcam.fem.generate import chain


@pytest.mark.parametrize("elements", [1_000, 100_000])
def test_stiffness(benchmark, elements):
    mesh = chain((0, 0, 0), (10.0, 3.0, 2.0), elements)
    member = fem.Member(fem.Material(E=2e11, nu=0.3, density=7800.0), fem.Section.circle(0.02))
    beams, dofs = fem.beams(mesh, {"shaft": member}), fem.dof_map(mesh, [("start", fem.COMPONENTS)])
    assert benchmark(fem.stiffness, beams, dofs).size == 6 * elements


@pytest.mark.parametrize("elements", [1_000, 10_000])
def test_from_nothing(benchmark, elements):
    assert benchmark(assembled, elements) == 6 * elements
