"""Large models: solvers agree, and memory is proportional to the number of unknowns."""

import sys
import tracemalloc

import numpy as np
import pytest

from flexcam import prepare, read_case
from flexcam.core import DENSE_LIMIT, Triplets, component_members, factorize, factorize_with_update
from flexcam.core.factorization import BandFactor
from flexcam.dynamics import solve
from flexcam.fem.assembly import Member, build_beams, mass, stiffness
from flexcam.fem.dofs import dof_map
from flexcam.fem.mesh import Mesh, refine
from flexcam.fem.sections import Material, Section

STEEL = Member(Material(2e11, 0.3, 7800.0), Section.circle(0.02))
ELEMENTS = 70
"""Elements of a member, so that the unknowns exceed the dense limit."""


def build_matrix(nodes, lines, supports=("root",)):
    mesh = refine(Mesh(nodes, lines, {"root": [0]}), dict.fromkeys(lines, ELEMENTS))
    order = np.random.default_rng(1).permutation(len(mesh.nodes))  # random order of the nodes
    place = np.argsort(order)
    shuffled = Mesh(mesh.nodes[order], {n: place[line] for n, line in mesh.lines.items()}, {"root": place[[0]]})
    dofs = dof_map(shuffled, [(point, ("ux", "uy", "uz", "rx", "ry", "rz")) for point in supports])
    parts = build_beams(shuffled, dict.fromkeys(lines, STEEL))
    return mass(parts, dofs) + stiffness(parts, dofs).scale(1e-9)


SHAFT = build_matrix([[0, 0, 0], [1, 0.3, 0.2]], {"shaft": [0, 1]})
TREE = build_matrix([[0, 0, 0], [1, 0, 0], [0.5, 0.7, 0]], {"shaft": [0, 1], "arm": [1, 2]})
TWO_SHAFTS = build_matrix([[0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 1, 0]], {"one": [0, 1], "other": [2, 3]})


@pytest.mark.parametrize("matrix", [SHAFT, TREE, TWO_SHAFTS], ids=["shaft", "tree", "two shafts"])
@pytest.mark.parametrize("shape", [(), (3,), (0,)])
def test_band_factor_matches_dense_solution(matrix, shape, readonly):
    right = readonly(np.random.default_rng(0).standard_normal((matrix.size, *shape)))
    factor = factorize(matrix)
    assert isinstance(factor, BandFactor)
    scale = 1.0 / np.sqrt(matrix.diagonal())
    scaled = scale[:, None] * matrix.dense() * scale
    right_scaled = (right.T * scale).T
    exact = np.linalg.solve(scaled, right_scaled) if right.size else right
    # rounding times the condition, 1e3 of the scaled matrices
    np.testing.assert_allclose((factor.solve(right).T / scale).T, exact, atol=1e-11 * np.abs(exact).max(initial=1.0))


def matrix_without_band(kind):
    """Return a matrix without Cholesky factor or narrow band."""
    n = DENSE_LIMIT + 40
    rng = np.random.default_rng(3)
    dense = np.diag(4.0 + rng.random(n)) + np.diag(np.ones(n - 1), 1) + np.diag(np.ones(n - 1), -1)
    if kind == "indefinite":
        dense[7, 7] = -3.0
    if kind == "unsymmetric":
        dense[5, 6] += 0.5
    if kind == "wide":
        far = rng.permutation(n)
        dense[np.arange(n), far] += 0.5
        dense[far, np.arange(n)] += 0.5
    return dense


@pytest.mark.parametrize("kind", ["indefinite", "unsymmetric", "wide"])
def test_matrix_without_band_is_solved(kind):
    dense, right = matrix_without_band(kind), np.ones(DENSE_LIMIT + 40)
    factor = factorize(Triplets.from_dense(dense))
    assert not isinstance(factor, BandFactor)
    np.testing.assert_allclose(factor.solve(right), np.linalg.solve(dense, right), rtol=1e-11)


@pytest.mark.parametrize("n", [20, DENSE_LIMIT + 20])
@pytest.mark.parametrize("stiffness", [1e-3, 1e4])
def test_factorize_with_update_matches_dense_solution(n, stiffness):
    """Two chains, one floating and one on a spring, each with a softly constrained motion."""
    dense = 2.0 * np.eye(n) - np.diag(np.ones(n - 1), 1) - np.diag(np.ones(n - 1), -1)
    half = n // 2
    dense[half - 1, half] = dense[half, half - 1] = 0.0
    for end in (0, half - 1, half, n - 1):
        dense[end, end] = 1.0
    dense[-1, -1] = 1.5
    motions = np.zeros((n, 2))
    motions[:half, 0] = motions[half:, 1] = half**-0.5
    right = np.random.default_rng(0).standard_normal((n, 2))
    found = factorize_with_update(Triplets.from_dense(dense), motions, stiffness).solve(right)
    exact = np.linalg.solve(dense + stiffness * motions @ motions.T, right)
    np.testing.assert_allclose(found, exact, atol=1e-9 * np.abs(exact).max())  # the condition is n^2


def test_component_members_by_label():
    assert [group.tolist() for group in component_members(np.array([3, 0, 3, 0, 9]))] == [[1, 3], [0, 2], [4]]
    assert component_members(np.zeros(0, np.intp)) == []


CASE = """format = 1
title = "Long shaft"
[nodes]
a = [0, 0, 0]
b = [1, 0, 0]
c = [2, 0, 0]
[materials.steel]
E = "207 GPa"
nu = 0.29
density = "7800 kg/m^3"
[sections]
round = { shape = "circle", diameter = "25 mm" }
[members]
shaft = { nodes = ["a", "b", "c"], elements = 700, material = "steel", section = "round" }
[supports]
a = ["ux", "rx"]
[bearings]
one = { at = "a", stiffness = "100 kN/mm" }
other = { at = "c", stiffness = "100 kN/mm" }
[loads]
push = { at = "b", direction = "uz", force = "100 N" }
[run]
speed = "1500 rpm"
revolutions = 0.001
[output]
probes = ["b"]
"""


def test_memory_is_proportional_to_unknowns(tmp_path):
    """8400 unknowns: a dense matrix has 560 MB, a row per element 94 MB."""
    path = tmp_path / "long.toml"
    path.write_text(CASE)
    case = read_case(path)
    tracemalloc.start()
    try:
        ready = prepare(case)
        response = solve(ready.problem, ready.scheme, save=ready.save)
        peak = tracemalloc.get_traced_memory()[1] / 8.0
    finally:
        tracemalloc.stop()
    assert response.status.ok
    assert ready.problem.system.size == 6 * 1401 - 2
    assert peak < 700 * ready.problem.system.size, (
        "some 700 numbers per unknown: 100 in matrices, 40 in each of few steps"
    )


@pytest.mark.parametrize(
    "held",
    [
        pytest.param('["ux", "rx"]', id="held along"),
        pytest.param('["rx"]', id="free along", marks=pytest.mark.slow),
    ],
)
def test_equilibrium_of_fine_and_coarse_mesh_agree(held, pytestconfig):
    """50 elements on 30 mm: the rounding of strain forces exceeds the tolerance of the equilibrium.

    Beams are exact at their nodes in statics, so that the meshes agree up to that rounding.
    """
    path = pytestconfig.rootpath / "cases" / "camshaft-4cyl" / "camshaft.toml"
    chosen = ['run.start="equilibrium"', "run.damping={alpha=10.0,beta=1e-6}", f"supports.sprocket={held}"]
    found = []
    for elements in (2, 50):
        problem = prepare(read_case(path, [f"members.camshaft.elements={elements}", *chosen])).problem
        moved = dict(zip(problem.system.names, problem.start.displacement.tolist(), strict=True))
        found.append(
            np.array([moved[f"{at}.uy"] for at in ("sprocket", "bearing-3", "intake-4", "exhaust-2-follower")])
        )
    assert len(moved) > 10 * DENSE_LIMIT
    np.testing.assert_allclose(found[1], found[0], rtol=1e-5)  # some 1e-6 of a displacement is lost to rounding


def test_size_of_block_parts_does_not_change_motion(pytestconfig, monkeypatch):
    """A block of 640 steps in parts of 7, most of them without a saved field."""
    case = read_case(
        pytestconfig.rootpath / "cases" / "pushrod-engine" / "intake.toml",
        ["run.revolutions=0.05", "run.integrator.method=newmark"],
    )
    ready = prepare(case)
    whole = solve(ready.problem, ready.scheme, save=ready.save)
    monkeypatch.setattr(sys.modules["flexcam.dynamics.solve"], "AT_ONCE", 7 * whole.stats.unknowns)
    parts = solve(ready.problem, ready.scheme, save=ready.save)
    np.testing.assert_array_equal(parts.fields.acceleration, whole.fields.acceleration)
    np.testing.assert_array_equal(parts.field_time, whole.field_time)
    np.testing.assert_array_equal(parts["valve"].displacement, whole["valve"].displacement)
    units = dict(whole.outline.channels)
    for name, values in whole.channels.items():
        size = max(float(np.abs(whole.channels[n]).max()) for n, unit in units.items() if unit == units[name])
        np.testing.assert_allclose(parts.channels[name], values, atol=1e-12 * size)  # sums over blocks round
