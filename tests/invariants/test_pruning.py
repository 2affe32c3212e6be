"""Removal of inactive unknowns does not change results: random systems, shafts in space, initial states."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from flexcam.core import Triplets
from flexcam.core import connected_components as label_components
from flexcam.dynamics import (
    AngleVector,
    Channel,
    ConstantSpeed,
    DofSubset,
    Load,
    LocalForce,
    ModeBasis,
    Probe,
    Problem,
    Reaction,
    State,
    System,
    constant,
    equilibrium,
    find_active_dofs,
    newmark,
    project_system,
    solve,
)
from flexcam.fem.assembly import Member, build_beams
from flexcam.fem.assembly import mass as fem_mass
from flexcam.fem.assembly import stiffness as fem_stiffness
from flexcam.fem.dofs import dof_map
from flexcam.fem.mesh import Mesh, refine
from flexcam.fem.sections import Material, Section

STEEL = Material(207e9, 0.29, 7800.0)
TOLERANCES = {"displacement": 1e-12, "velocity": 1e-12, "acceleration": 1e-12}
"""Tolerances relative to the maximum."""

BEAM_TOLERANCES = {"displacement": 1e-10, "velocity": 1e-9, "acceleration": 1e-7}
"""Tolerances for beams with long steps: rounding of a matrix whose axial entries are 1e4 times those of bending;
divided by the step for a velocity and by its square for an acceleration. Another order of the unknowns changes as
much; a shaft along (1, 1, 0) under a load along z differs by 5e-11."""


class CubicForce:
    """Cubic spring that senses and acts."""

    def respond(self, gap, rate, angle):
        return Reaction(-100.0 * gap**3, np.diag(-300.0 * gap**2), np.zeros((len(gap), len(gap))))


def wave(motion):
    return np.sin(3.0 * motion.angle)


def unit(n, i):
    return np.eye(n)[i]


def chains(sizes, rng, *, mixed=True):
    """Return a system of chains of masses, each on a spring to ground, with its unknowns in random order."""
    n = sum(sizes)
    M, K = np.diag(rng.uniform(0.5, 2.0, n)), np.zeros((n, n))
    first = 0
    for size in sizes:
        K[first, first] += rng.uniform(5.0, 20.0)
        for i in range(first, first + size - 1):
            K[i : i + 2, i : i + 2] += rng.uniform(5.0, 20.0) * np.array([[1.0, -1.0], [-1.0, 1.0]])
        first += size
    order = rng.permutation(n) if mixed else np.arange(n)
    M, K = M[np.ix_(order, order)], K[np.ix_(order, order)]
    matrices = (Triplets.from_dense(one) for one in (M, 0.01 * K, K))
    return System(*matrices, tuple(f"x{i}" for i in range(n))), np.argsort(order)


def observe_all(system):
    """Return a system with every unknown as a probe and as a channel."""
    n = system.size
    probes = (Probe("all", system.names, np.eye(n), (None,) * n),)
    channels = tuple(
        Channel(name, "m", lambda seen, i=i: seen.displacement[:, i]) for i, name in enumerate(system.names)
    )
    return replace(system, probes=probes, channels=channels)


def run_both(system, start=None, steps=60, step=0.05):
    problem = Problem(observe_all(system), ConstantSpeed(1.0), step, steps, start)
    return [solve(replace(problem, prune=prune), newmark()) for prune in (False, True)]


def assert_equal_runs(whole, pruned, *, parts=TOLERANCES):
    assert whole.status.ok
    assert whole.outline == pruned.outline
    for group in ("probes", "fields"):
        for kind in ("displacement", "velocity", "acceleration"):
            one, other = (getattr(getattr(found, group), kind) for found in (whole, pruned))
            np.testing.assert_allclose(other, one, rtol=0.0, atol=parts[kind] * np.abs(one).max(initial=0.0))
    for name in whole.channels:
        one, other = whole.channels[name], pruned.channels[name]
        size = max(
            np.abs(found).max() for label, found in whole.channels.items() if ("energy" in label) == ("energy" in name)
        )
        np.testing.assert_allclose(other, one, rtol=0.0, atol=parts["displacement"] * size, err_msg=name)


@given(st.integers(0, 30), st.lists(st.tuples(st.integers(0, 29), st.integers(0, 29)), max_size=40))
def test_labels_match_scipy_connected_components(more, pairs):
    size = 30 + more
    rows, cols = (np.array([pair[i] for pair in pairs], dtype=np.intp) for i in (0, 1))
    labels = label_components(size, rows, cols)
    count, known = connected_components(
        coo_array((np.ones(len(rows)), (rows, cols)), shape=(size, size)), directed=False
    )
    assert len(np.unique(labels)) == count
    assert len({*zip(labels.tolist(), known.tolist(), strict=True)}) == count
    assert (labels <= np.arange(size)).all()


@settings(max_examples=15, deadline=None)
@given(
    seed=st.integers(0, 2**32 - 1),
    sizes=st.lists(st.integers(1, 5), min_size=2, max_size=5),
    loaded=st.sets(st.integers(0, 4), max_size=3),
    linked=st.booleans(),
    begun=st.booleans(),
)
def test_pruned_run_equals_complete_run(seed, sizes, loaded, linked, begun):
    rng = np.random.default_rng(seed)
    system, place = chains(sizes, rng)
    n, ends = system.size, np.cumsum(sizes) - 1
    loads = tuple(Load(str(c), unit(n, place[ends[c]]), wave) for c in sorted(loaded) if c < len(sizes))
    link = unit(n, place[0]) - unit(n, place[ends[-1]])
    force = LocalForce(
        "link", (AngleVector.constant(link),), (AngleVector.constant(link),), CubicForce(), (constant(0.0),)
    )
    system = replace(system, loads=loads, local_forces=(force,) if linked else ())
    start = State(np.zeros(n), 0.1 * unit(n, place[ends[0]])) if begun else None
    moved = {c for c in loaded if c < len(sizes)} | ({0} if begun else set())
    if linked and moved & {0, len(sizes) - 1}:
        moved |= {0, len(sizes) - 1}
    whole, pruned = run_both(system, start)
    assert pruned.stats.unknowns == sum(sizes[c] for c in moved)
    assert_equal_runs(whole, pruned)


def test_acting_side_of_force_couples_unknowns():
    """A force that senses one part and acts on another one moves the latter: the graph contains both sides."""
    system, _ = chains([1, 1, 1], np.random.default_rng(1), mixed=False)
    sense, act = unit(3, 0), unit(3, 1)
    force = LocalForce(
        "push", (AngleVector.constant(sense),), (AngleVector.constant(act),), CubicForce(), (constant(0.0),)
    )
    system = replace(system, local_forces=(force,), loads=(Load("wave", sense, wave),))
    assert find_active_dofs(system).moving.tolist() == [True, True, False]
    whole, pruned = run_both(system)
    assert pruned.probes.displacement[:, 1].any()
    assert_equal_runs(whole, pruned)


@pytest.mark.parametrize("what", ["offset", "vector", "preload", "load", "velocity", "displacement"])
def test_excitation_activates_unknowns(what):
    system, _ = chains([1, 2], np.random.default_rng(2), mixed=False)
    n, row, start = 3, unit(3, 2), None
    assert find_active_dofs(replace(system, loads=(Load("wave", unit(n, 0), wave),))).moving.tolist() == [
        True,
        False,
        False,
    ]
    sense = AngleVector.constant(row) if what != "vector" else AngleVector(row[None, :], (lambda a, k: np.cos(a),))
    offset = {"offset": lambda angle, order: np.sin(angle), "preload": constant(0.5)}.get(what, constant(0.0))
    force = LocalForce("force", (sense,), (AngleVector.constant(row),), CubicForce(), (offset,))
    system = replace(system, loads=(Load("wave", unit(n, 0), wave),))
    if what in ("offset", "vector", "preload"):
        system = replace(system, local_forces=(force,))
    elif what == "load":
        system = replace(system, loads=(*system.loads, Load("more", 1e-6 * unit(n, 1), wave)))
    else:
        moved = 1e-6 * row
        start = State(moved, 0.0 * row) if what == "displacement" else State(0.0 * row, moved)
    whole, pruned = run_both(system, start)
    assert pruned.stats.unknowns == 3
    assert_equal_runs(whole, pruned)


def test_statically_loaded_chain_stays_inactive():
    """A chain under its weight is displaced but does not move; its strain energy and forces are still computed."""
    system, _ = chains([2, 3], np.random.default_rng(3), mixed=False)
    weight = Load("weight", np.array([0.0, 0.0, 1.0, 2.0, 3.0]), lambda motion: np.ones_like(motion.angle), steady=True)
    row = unit(5, 4)
    force = LocalForce(
        "spring", (AngleVector.constant(row),), (AngleVector.constant(row),), CubicForce(), (constant(0.0),)
    )
    system = replace(system, loads=(Load("wave", unit(5, 0), wave), weight), local_forces=(force,))
    still = replace(system, local_forces=())
    start = equilibrium(still, ConstantSpeed(1.0))
    found = find_active_dofs(still, start.displacement)
    assert found.moving.tolist() == [True, True, False, False, False]
    assert (found.inactive[0].loaded, found.inactive[0].free) == (True, False)
    assert found.offset[4] == start.displacement[4] != 0.0
    rounded = replace(still, free=np.array([[1.0], [1.0], [1e-17], [1e-17], [1e-17]]))
    assert not find_active_dofs(rounded, start.displacement).inactive[0].free
    whole, pruned = run_both(still, start)
    assert pruned.stats.unknowns == 2
    assert_equal_runs(whole, pruned)
    # A start without the static deflection causes vibration, and so does a force that the deflection activates.
    assert find_active_dofs(still).moving.all()
    assert find_active_dofs(system, start.displacement).moving.all()


def test_soft_spring_between_stiff_parts_couples():
    """The coupling is far below the rounding of the diagonals, but it alone moves the second part."""
    K = np.array([[1e12, -1e-4], [-1e-4, 1e12]])
    system = System(Triplets.from_dense(np.eye(2)), Triplets.zeros(2), Triplets.from_dense(K), ("a", "b"))
    assert find_active_dofs(replace(system, loads=(Load("wave", unit(2, 0), wave),))).moving.all()


def shaft(axis, *, tilt=0.0):
    """Return a shaft along an axis between bearings, under a lateral load."""
    nodes = np.linspace(0.0, 0.4, 5)[:, None] * axis
    nodes[:, 1] += tilt * nodes[:, 0]
    mesh = refine(Mesh(nodes, {"shaft": [0, 1, 2, 3, 4]}, {"a": [0], "b": [4], "cam": [2]}), {"shaft": 1})
    section = Section(A=4.9e-4, Iy=1.9e-8, Iz=1.9e-8, J=3.8e-8)
    beams, dofs = (
        build_beams(mesh, {"shaft": Member(STEEL, section)}),
        dof_map(mesh, [(e, ("ux", "uy", "uz")) for e in "ab"]),
    )
    mass, stiffness = fem_mass(beams, dofs), fem_stiffness(beams, dofs)
    system = System(mass, stiffness.scale(1e-6), stiffness, dofs.names)
    return system, dofs, mesh


@pytest.mark.parametrize("tilt", [0.0, 1e-16, 1e-9])
def test_shaft_along_coordinate_axis(tilt):
    """Only the bending plane is active; for a slightly inclined axis, rounding couples the planes."""
    system, dofs, mesh = shaft(np.array([1.0, 0.0, 0.0]), tilt=tilt)
    push = dofs.vector(mesh.node("cam"), np.array([0.0, 1.0, 0.0, 0.0, 0.0, 0.0]))
    system = replace(system, loads=(Load("push", 1e3 * push, wave),))
    kept = {
        name.rpartition(".")[2] for name, one in zip(system.names, find_active_dofs(system).moving, strict=True) if one
    }
    assert kept == {"uy", "rz"} if tilt == 0.0 else kept >= {"uy", "rz"}
    assert_equal_runs(*run_both(system, step=1e-3), parts=BEAM_TOLERANCES)


@settings(max_examples=15, deadline=None)
@example([1.0, 1.0, 0.0, 0.0, 0.0, 1.0])
@given(st.lists(st.floats(-1.0, 1.0), min_size=6, max_size=6).filter(lambda v: np.linalg.norm(v[:3]) > 0.1))
def test_shaft_along_any_axis(numbers):
    axis = np.array(numbers[:3]) / np.linalg.norm(numbers[:3])
    system, dofs, mesh = shaft(axis)
    push = dofs.vector(mesh.node("cam"), np.array([*numbers[3:], 0.0, 0.0, 0.0]))
    system = replace(system, loads=(Load("push", 1e3 * push, wave),))
    assert_equal_runs(*run_both(system, step=1e-3), parts=BEAM_TOLERANCES)


def test_complete_mode_basis_does_not_change_run():
    rng = np.random.default_rng(4)
    system, _ = chains([3, 2], rng)
    row = unit(5, 0) - unit(5, 3)
    force = LocalForce(
        "link", (AngleVector.constant(row),), (AngleVector.constant(row),), CubicForce(), (constant(0.1),)
    )
    system = observe_all(replace(system, local_forces=(force,), loads=(Load("wave", unit(5, 2), wave),)))
    start = State(rng.normal(size=5), rng.normal(size=5))
    problem = Problem(system, ConstantSpeed(1.0), 0.05, 60, start)
    basis = ModeBasis(np.linalg.qr(rng.normal(size=(5, 5)))[0] * rng.uniform(0.5, 2.0, 5))
    assert_equal_runs(solve(problem, newmark()), solve(replace(problem, basis=basis), newmark()), parts=BEAM_TOLERANCES)


def test_incomplete_mode_basis_is_projection():
    rng = np.random.default_rng(5)
    system, _ = chains([4], rng)
    T = rng.normal(size=(4, 2))
    small = project_system(replace(system, loads=(Load("wave", unit(4, 1), wave),)), ModeBasis(T))
    np.testing.assert_allclose(small.stiffness.dense(), T.T @ system.stiffness.dense() @ T)
    np.testing.assert_allclose(small.loads[0].vector, T[1])
    assert small.names == ("shape 1", "shape 2")
    # The nearest motion by kinetic energy: the error has no momentum along the shapes.
    motion = rng.normal(size=4)
    missed = motion - ModeBasis(T).expand(ModeBasis(T).project(motion, system.mass))
    np.testing.assert_allclose(T.T @ system.mass.times(missed), 0.0, atol=1e-12)


def test_free_motions_of_dof_subset():
    """Axial motion and another free motion: the active part remains free, the other one is removed."""
    free = np.array([[1.0, 0.0], [1.0, 0.0], [0.0, 1.0]])
    found = DofSubset(np.array([0, 1]), np.zeros(3)).free(free)
    assert found.shape == (2, 1)
    np.testing.assert_allclose(np.abs(found), np.sqrt(0.5))
