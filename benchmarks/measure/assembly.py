"""Assembly of stiffness and mass of shafts."""

from __future__ import annotations

from benchmarks.timing import minimum_time
from flexcam.fem.assembly import Member, build_beams, mass, stiffness
from flexcam.fem.dofs import COMPONENTS, dof_map
from flexcam.fem.mesh import chain
from flexcam.fem.sections import Material, Section

ELEMENTS = (10, 100, 1_000, 10_000, 100_000)


def measure_table() -> list[dict[str, float]]:
    """Return the time of mesh, elements and both matrices, by number of elements."""
    return [{"elements": elements, "seconds": minimum_time(lambda n=elements: assemble(n))} for elements in ELEMENTS]


def assemble(elements: int) -> int:
    """Create mesh, elements and both matrices of a shaft and return its number of unknowns."""
    mesh = chain((0.0, 0.0, 0.0), (10.0, 3.0, 2.0), elements)
    member = Member(Material(E=2e11, nu=0.3, density=7800.0), Section.circle(0.02))
    beams, dofs = build_beams(mesh, {"shaft": member}), dof_map(mesh, [("start", COMPONENTS)])
    return (stiffness(beams, dofs) + mass(beams, dofs)).size
