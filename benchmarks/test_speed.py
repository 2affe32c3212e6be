"""Speed of assembly and of the linear time loop; figures are ratios within one run."""

from __future__ import annotations

import pytest

from flexcam import fem
from flexcam.fem.generate import chain
from flexcam.integrate import newmark, solve


@pytest.mark.parametrize("elements", [1_000, 100_000])
def test_assembly(benchmark, elements):
    mesh = chain((0, 0, 0), (10.0, 3.0, 2.0), elements)
    member = fem.Member(fem.Material(E=2e11, nu=0.3, density=7800.0), fem.Section.circle(0.02))
    beams, dofs = fem.beams(mesh, {"shaft": member}), fem.dof_map(mesh, [("start", fem.COMPONENTS)])
    assert benchmark(fem.stiffness, beams, dofs).size == 6 * elements


def test_linear_transient(benchmark, driven_shaft):
    assert benchmark(solve, driven_shaft, newmark()).status.ok
