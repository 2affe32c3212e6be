"""Inactive bending planes of a straight strut are removed until something excites them, without change of results."""

from dataclasses import replace

import numpy as np
import pytest

from flexcam import prepare, read_case
from flexcam.dynamics import Load, State, active_dofs_of, equilibrium, solve
from flexcam.dynamics.engine_selection import select_engine
from flexcam.dynamics.local_forces import LocalForces
from tests.pinned_rod import pinned_rod, push

FASTER = 'speed = "3000 rpm"\nsteps_per_revolution = 400\nrevolutions = 0.1'
PLANES = {"y": {"uy", "rz"}, "z": {"uz", "ry"}, "along": {"ux"}}


@pytest.fixture
def rod(tmp_path):
    """Return a function that prepares a compressed tube with a bow in its x-y plane and lateral loads."""

    def make(bow=2e-4, *aside):
        path = tmp_path / "rod.toml"
        path.write_text(pinned_rod(bow, push(-200.0), elements=2, rotary_inertia=True, run=FASTER), encoding="utf-8")
        ready = prepare(read_case(path))
        pushes = [("tip.ux", -150.0), *((f"mid.{one}", size) for one, size in aside)]
        return replace(ready, problem=add_loads(ready.problem, pushes, wave))

    return make


def wave(motion):
    return np.sin(motion.angle)


def add_loads(problem, pushes, history, *, steady=False):
    """Return a problem with loads on unknowns by name, N, over time."""
    names = problem.system.names
    loads = [Load(name, size * np.eye(len(names))[names.index(name)], history, steady) for name, size in pushes]
    return replace(problem, system=replace(problem.system, loads=(*problem.system.loads, *loads)))


def active_components(problem):
    """Return the components of the active unknowns."""
    found = active_dofs_of(problem).moving
    return {name.rpartition(".")[2] for name, one in zip(problem.system.names, found, strict=True) if one}


@pytest.mark.parametrize(("bow", "across", "planes"), [
    (2e-4, (), ("along", "y")), (0.0, (), ("along",)), (0.0, (("uz", 1.0),), ("along", "z")),
    (0.0, (("uy", 1.0),), ("along", "y")), (2e-4, (("uz", 1e-9),), ("along", "y", "z")),
    (0.0, (("uy", 1.0), ("uz", 1.0)), ("along", "y", "z")),
])  # fmt: skip
def test_only_excited_planes_are_active(rod, bow, across, planes):
    ready = rod(bow, *across)
    assert active_components(ready.problem) == set().union(*(PLANES[one] for one in planes))
    if len(planes) == 3:  # both runs would be equal
        return
    whole, pruned = (
        solve(replace(ready.problem, prune=prune), ready.scheme, save=ready.save) for prune in (False, True)
    )
    assert pruned.stats.unknowns < whole.stats.unknowns
    for kind in ("displacement", "velocity"):
        one, other = (getattr(run.probes, kind) for run in (whole, pruned))
        # rounding of a matrix whose axial entries are 1e4 times those of bending; divided by the step for a velocity
        np.testing.assert_allclose(other, one, rtol=0.0, atol=1e-9 * np.abs(one).max())


@pytest.mark.parametrize("kind", ["displacement", "velocity"])
def test_lateral_initial_state_activates_plane(rod, kind):
    problem = rod().problem
    begun = np.zeros(problem.system.size)
    begun[problem.system.names.index("mid.uz")] = 1e-6
    start = problem.start or State.rest(problem.system.size)
    assert active_components(problem) == PLANES["along"] | PLANES["y"]
    problem = replace(problem, start=replace(start, **{kind: getattr(start, kind) + begun}))
    assert active_components(problem) == PLANES["along"] | PLANES["y"] | PLANES["z"]


def test_rounding_does_not_activate_plane(rod):
    """Some equilibrium solutions are not exactly zero in unloaded unknowns."""
    problem = rod().problem
    rounding = np.zeros(problem.system.size)
    rounding[problem.system.names.index("mid.uz")] = 1e-40
    problem = replace(problem, start=replace(problem.start, displacement=problem.start.displacement + rounding))
    assert active_components(problem) == PLANES["along"] | PLANES["y"]


def test_bow_activates_plane_from_rest(rod):
    """The tube is straight at the start, but the axial force bends it."""
    problem = rod().problem
    assert active_components(replace(problem, start=State.rest(problem.system.size))) == PLANES["along"] | PLANES["y"]


def test_bending_activates_axial_motion(rod):
    """A lateral load alone bends the tube and moves its ends."""
    plain = rod(0.0).problem
    plain = replace(plain, system=replace(plain.system, loads=plain.system.loads[:-1]))
    assert active_components(plain) == set()
    assert active_components(add_loads(plain, [("mid.uz", 1.0)], wave)) == PLANES["along"] | PLANES["z"]


def test_steady_lateral_load_activates_plane(rod):
    """A lateral load is in equilibrium under constant axial force; a change of this force changes the bending."""
    pushed = add_loads(rod(0.0).problem, [("mid.uz", 1.0)], lambda motion: np.ones_like(motion.angle), steady=True)
    resting = replace(pushed, start=equilibrium(pushed.system, pushed.drive))
    assert np.abs(resting.start.displacement[resting.system.names.index("mid.uz")]) > 0.0
    assert active_components(resting) == PLANES["along"] | PLANES["z"]


@pytest.mark.parametrize(("across", "scalars"), [((), 4), pytest.param((("uz", 1.0),), 7, marks=pytest.mark.slow)])
def test_kernel_engine_skips_inactive_plane(rod, across, scalars):
    ready = rod(2e-4, *across)
    general, compiled = (solve(replace(ready.problem, engine=path), ready.scheme) for path in ("direct", "kernel"))
    selection = select_engine(replace(ready.problem, engine="kernel"), ready.scheme)
    assert set(LocalForces(selection.problem.system).table.laws[:, 2].tolist()) == {scalars}
    for kind in ("displacement", "velocity"):
        one, other = (getattr(run.probes, kind) for run in (general, compiled))
        np.testing.assert_allclose(other, one, rtol=0.0, atol=1e-9 * np.abs(one).max())


def test_kernel_engine_reduces_straight_strut_to_bar(rod):
    """Without bending, only the elongation of an element remains, and no force beyond that of a bar."""
    ready = rod(0.0)
    selection = select_engine(replace(ready.problem, engine="kernel"), ready.scheme)
    assert set(LocalForces(selection.problem.system).table.laws[:, 2].tolist()) == {1}
    general, compiled = (solve(replace(ready.problem, engine=path), ready.scheme) for path in ("direct", "kernel"))
    one, other = general.probes.displacement, compiled.probes.displacement
    np.testing.assert_allclose(other, one, rtol=0.0, atol=1e-9 * np.abs(one).max())
