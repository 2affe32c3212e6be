"""Large models: work and memory in proportion to the number of unknowns, up to 1e5 of them and 1e5 elements."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from scipy.sparse import diags_array
from scipy.sparse.linalg import splu

from benchmarks.long_shaft import DENSITY, NU, SPAN, SPANS, E, text
from benchmarks.memory import peak
from benchmarks.paths import solved
from benchmarks.peers.with_flexcam import shaft
from benchmarks.peers.work import Work
from benchmarks.timing import least
from flexcam import dynamics, modes, read_case
from flexcam.case.builder import build_model
from flexcam.dynamics import ConstantSpeed, Problem
from flexcam.fem.assembly import Member, mass, stiffness
from flexcam.fem.assembly import beams as fem_beams
from flexcam.fem.dofs import COMPONENTS, dof_map
from flexcam.fem.mesh import chain
from flexcam.fem.sections import Material, Section
from flexcam.valvetrain import build_structure, build_system


def large(*sizes):
    """Mark sizes that take long."""
    return [pytest.param(size, marks=pytest.mark.slow) for size in sizes]


@pytest.fixture
def note(benchmark):
    """Return what notes the memory of statements among the results, where something is measured."""

    def noted(statements):
        if not benchmark.disabled:
            benchmark.extra_info["peak_MB"] = peak(statements)

    return noted


@pytest.fixture
def long_case(tmp_path):
    """Return what writes the case of the long shaft with so many elements per span."""

    def written(per_span):
        path = tmp_path / f"shaft-{per_span}.toml"
        path.write_text(text(per_span))
        return path

    return written


@pytest.mark.parametrize("elements", [1_000, *large(10_000, 100_000)])
def test_stiffness_and_mass(benchmark, note, elements):
    """Of a shaft across the axes of space, whose element matrices are full."""
    mesh = chain((0, 0, 0), (10.0, 3.0, 2.0), elements)
    member = Member(Material(E=2e11, nu=0.3, density=7800.0), Section.circle(0.02))
    beams, dofs = fem_beams(mesh, {"shaft": member}), dof_map(mesh, [("start", COMPONENTS)])
    found = benchmark(lambda: (stiffness(beams, dofs), mass(beams, dofs)))
    assert all(matrix.size == 6 * elements for matrix in found)
    note(f"from benchmarks.measure.assembly import assembled; assembled({elements})")


@pytest.mark.parametrize("per_span", [2, *large(17, 168, 1010)])
def test_equations_of_a_case(benchmark, note, long_case, per_span):
    """From the model to the system; 1e5 elements are 1010 per span."""
    path = long_case(per_span)
    model, speed = build_model(read_case(path)), read_case(path).speed
    system = benchmark(build_system, model, speed)
    assert system.size == 6 * (SPANS * per_span + 1) - 2
    note(f"import flexcam; flexcam.prepare(flexcam.read_case({str(path)!r}))")


STEPS, FIRST = 40, 2.0 * math.pi * 25.0


@pytest.mark.parametrize("spans", [2, 17, *large(172, 1724)])
def test_steps(benchmark, note, spans):
    """Of the direct engine: what a step costs per unknown should not depend on their number."""
    work = Work(spans=spans)
    many = Problem(shaft(work), ConstantSpeed(FIRST), step=work.step(25.0), steps=STEPS + 1)
    response = benchmark(solved, many, "direct")
    assert response.status.ok
    if not benchmark.disabled:
        once = least(lambda: solved(replace(many, steps=1), "direct"), 3)  # factorization and the start
        per_step = (benchmark.stats["min"] - once) / STEPS
        benchmark.extra_info["us_per_step"] = round(1e6 * per_step, 2)
        benchmark.extra_info["ns_per_step_and_unknown"] = round(1e9 * per_step / many.system.size, 1)
    note(
        "from benchmarks.peers.with_flexcam import run; from benchmarks.peers.work import Work\n"
        f"run(Work(spans={spans}, revolutions=1, steps_per_revolution={STEPS}), 'direct')"
    )


@pytest.mark.parametrize("per_span", [8, *large(168)])
def test_modes_on_a_hundred_bearings(benchmark, long_case, per_span):
    """Twenty lowest ones: torsion, axial motion and bending, which comes in pairs close to each other."""
    structure = build_structure(build_model(read_case(long_case(per_span))))
    found = benchmark(dynamics.modes, structure.mass, structure.stiffness, 20, free=structure.free)
    _check(structure, found)


@pytest.mark.parametrize("per_span", [8, *large(168)])
def test_modes_of_a_case(benchmark, note, long_case, per_span):
    """The same from the file, with effective masses and what moves."""
    path = long_case(per_span)
    found = benchmark(lambda: modes(read_case(path), 20))
    assert found.words(0) == "shaft torsion 100 %"
    note(f"import flexcam; flexcam.modes(flexcam.read_case({str(path)!r}), 20)")


def _check(structure, found):
    """Every mode is one, none is missing, and those of torsion and axial motion are the rod's."""
    M, K = structure.mass.csr(), structure.stiffness.csr()
    scale = diags_array(1.0 / np.sqrt(K.diagonal()))
    again = scale @ splu((scale @ K @ scale).tocsc()).solve(scale @ (M @ found.shapes)) * found.omegas**2
    missed = again - found.shapes
    assert np.sqrt(np.einsum("ij,ij->j", missed, M @ missed)).max() < 1e-5  # rounding in K on 168 elements per span
    gap = 10 + int(np.argmax(found.omegas[11:] / found.omegas[10:-1]))
    between = found.omegas[gap : gap + 2].mean() ** 2
    assert _below(K - between * M, scale) == gap + 1
    for modulus in (E / (2.0 + 2.0 * NU), E):
        rod = (2 * np.arange(20) + 1) / (4.0 * SPANS * SPAN) * math.sqrt(modulus / DENSITY)  # fixed at one end
        rod = rod[rod < 0.999 * found.frequencies[-1]]
        miss = np.abs(found.frequencies[:, None] / rod - 1.0).min(axis=0)
        assert len(rod) > 2
        assert miss.max() < 1e-4  # (2 pi f h/c)^2/24 on 8 elements per span


def _below(shifted, scale):
    """Return how many eigenvalues are below a shift: Sylvester's law, signs of the pivots of K - shift M."""
    options = {"SymmetricMode": True}
    factor = splu((scale @ shifted @ scale).tocsc(), permc_spec="NATURAL", diag_pivot_thresh=0.0, options=options)
    assert (factor.perm_r == factor.perm_c).all()
    return int(np.count_nonzero(factor.U.diagonal() < 0.0))
