"""Large models: time and memory up to 1e5 unknowns and 1e5 elements; both should be proportional to the unknowns."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from scipy.sparse import diags_array
from scipy.sparse.linalg import splu

from benchmarks.engines import run_engine
from benchmarks.long_shaft import DENSITY, NU, SPAN, SPANS, E, case_text
from benchmarks.peers.shaft import Shaft
from benchmarks.peers.shaft_flexcam import shaft_system
from benchmarks.processes import peak_memory
from benchmarks.timing import minimum_time
from flexcam import dynamics, modes, read_case
from flexcam.case.builder import build_model
from flexcam.dynamics import ConstantSpeed, Problem
from flexcam.fem.assembly import Member, build_beams, mass, stiffness
from flexcam.fem.dofs import COMPONENTS, dof_map
from flexcam.fem.mesh import chain
from flexcam.fem.sections import Material, Section
from flexcam.valvetrain import build_structure, build_system


def slow(*sizes):
    """Return parameters with the mark `slow`."""
    return [pytest.param(size, marks=pytest.mark.slow) for size in sizes]


@pytest.fixture
def measure_memory(benchmark):
    """Return a function that adds the peak memory of statements to the results of a measurement."""

    def measure(statements):
        if not benchmark.disabled:
            benchmark.extra_info["peak_MB"] = peak_memory(statements)

    return measure


@pytest.fixture
def write_long_shaft(tmp_path):
    """Return a function that writes the case of the long shaft with a number of elements per span."""

    def write(per_span):
        path = tmp_path / f"shaft-{per_span}.toml"
        path.write_text(case_text(per_span))
        return path

    return write


@pytest.mark.parametrize("elements", [1_000, *slow(10_000, 100_000)])
def test_stiffness_and_mass(benchmark, measure_memory, elements):
    """Inclined shaft, whose element matrices are full."""
    mesh = chain((0, 0, 0), (10.0, 3.0, 2.0), elements)
    member = Member(Material(E=2e11, nu=0.3, density=7800.0), Section.circle(0.02))
    beams, dofs = build_beams(mesh, {"shaft": member}), dof_map(mesh, [("start", COMPONENTS)])
    found = benchmark(lambda: (stiffness(beams, dofs), mass(beams, dofs)))
    assert all(matrix.size == 6 * elements for matrix in found)
    measure_memory(f"from benchmarks.measure.assembly import assemble; assemble({elements})")


@pytest.mark.parametrize("per_span", [2, *slow(17, 168, 1010)])
def test_equations_of_a_case(benchmark, measure_memory, write_long_shaft, per_span):
    """System from the model; 1010 elements per span are 1e5 in total."""
    path = write_long_shaft(per_span)
    model, speed = build_model(read_case(path)), read_case(path).speed
    system = benchmark(build_system, model, speed)
    assert system.size == 6 * (SPANS * per_span + 1) - 2
    measure_memory(f"import flexcam; flexcam.prepare(flexcam.read_case({str(path)!r}))")


STEPS, SPEED = 40, 2.0 * math.pi * 25.0


@pytest.mark.parametrize("spans", [2, 17, *slow(172, 1724)])
def test_steps(benchmark, measure_memory, spans):
    """Steps of the direct engine: the time per unknown should not depend on the number of unknowns."""
    shaft = Shaft(spans=spans)
    problem = Problem(shaft_system(shaft), ConstantSpeed(SPEED), step=shaft.step(25.0), steps=STEPS + 1)
    response = benchmark(run_engine, problem, "direct")
    assert response.status.ok
    if not benchmark.disabled:
        single = minimum_time(
            lambda: run_engine(replace(problem, steps=1), "direct"), 3
        )  # with factorization and start
        per_step = (benchmark.stats["min"] - single) / STEPS
        benchmark.extra_info["us_per_step"] = round(1e6 * per_step, 2)
        benchmark.extra_info["ns_per_step_and_unknown"] = round(1e9 * per_step / problem.system.size, 1)
    measure_memory(
        "from benchmarks.peers.shaft_flexcam import run; from benchmarks.peers.shaft import Shaft\n"
        f"run(Shaft(spans={spans}, revolutions=1, steps_per_revolution={STEPS}), 'direct')"
    )


@pytest.mark.parametrize("per_span", [8, *slow(168)])
def test_modes_on_a_hundred_bearings(benchmark, write_long_shaft, per_span):
    """Twenty lowest modes: torsion, axial motion and pairs of bending modes with close frequencies."""
    structure = build_structure(build_model(read_case(write_long_shaft(per_span))))
    found = benchmark(dynamics.modes, structure.mass, structure.stiffness, 20, free=structure.free)
    _check_modes(structure, found)


@pytest.mark.parametrize("per_span", [8, *slow(168)])
def test_modes_of_a_case(benchmark, measure_memory, write_long_shaft, per_span):
    """The same modes from the file, with effective masses and descriptions."""
    path = write_long_shaft(per_span)
    found = benchmark(lambda: modes(read_case(path), 20))
    assert found.words(0) == "shaft torsion 100 %"
    measure_memory(f"import flexcam; flexcam.modes(flexcam.read_case({str(path)!r}), 20)")


def _check_modes(structure, found):
    """Check residuals, the number of modes, and torsional and axial frequencies against a rod."""
    M, K = structure.mass.csr(), structure.stiffness.csr()
    scale = diags_array(1.0 / np.sqrt(K.diagonal()))
    iterated = scale @ splu((scale @ K @ scale).tocsc()).solve(scale @ (M @ found.shapes)) * found.omegas**2
    residual = iterated - found.shapes
    assert np.sqrt(np.einsum("ij,ij->j", residual, M @ residual)).max() < 1e-5  # rounding in K on 168 elements per span
    gap = 10 + int(np.argmax(found.omegas[11:] / found.omegas[10:-1]))
    shift = found.omegas[gap : gap + 2].mean() ** 2
    assert _count_below(K - shift * M, scale) == gap + 1
    for modulus in (E / (2.0 + 2.0 * NU), E):
        rod = (2 * np.arange(20) + 1) / (4.0 * SPANS * SPAN) * math.sqrt(modulus / DENSITY)  # fixed at one end
        rod = rod[rod < 0.999 * found.frequencies[-1]]
        error = np.abs(found.frequencies[:, None] / rod - 1.0).min(axis=0)
        assert len(rod) > 2
        assert error.max() < 1e-4  # (2 pi f h/c)^2/24 on 8 elements per span


def _count_below(shifted, scale):
    """Return the number of eigenvalues below a shift: negative pivots of K - shift M (Sylvester's law of inertia)."""
    options = {"SymmetricMode": True}
    factor = splu((scale @ shifted @ scale).tocsc(), permc_spec="NATURAL", diag_pivot_thresh=0.0, options=options)
    assert (factor.perm_r == factor.perm_c).all()
    return int(np.count_nonzero(factor.U.diagonal() < 0.0))
