"""Selection of the engine, errors of an explicit engine, and reproducibility of runs."""

import hashlib
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from flexcam.core import Triplets
from flexcam.core.errors import InputError
from flexcam.dynamics import (
    Adaptive,
    AngleVector,
    ConstantSpeed,
    Load,
    LocalForce,
    ModeBasis,
    Probe,
    Problem,
    Reaction,
    RunFailedError,
    SaveAt,
    State,
    System,
    bathe,
    collocation,
    constant,
    default_method,
    elastic_stop,
    generalized_alpha,
    hht,
    newmark,
    solve,
)
from flexcam.dynamics.engine_selection import select_engine
from flexcam.dynamics.jit import Program
from flexcam.dynamics.kernel_step import PROGRAM
from tests.thinning import mostly_slow

FORCED = ["modal", "kernel"]


class PythonLaw:
    """Law without compiled code."""

    def respond(self, gap, rate, angle):
        return Reaction(-100.0 * gap**3, np.diag(-300.0 * gap**2), np.zeros((1, 1)))


def sine(motion):
    return np.sin(motion.angle)


def masses(n, *, law=None, damping=0.0, stiffness=None):
    eye = np.eye(n)
    K = 100.0 * np.diag(np.arange(1.0, n + 1.0)) if stiffness is None else stiffness
    local = ()
    if law is not None:
        row = AngleVector.constant(eye[0])
        local = (LocalForce("bumper", (row,), (AngleVector.constant(-eye[0]),), law, (constant(0.0),)),)
    names = tuple(f"x{i}" for i in range(n))
    matrices = (Triplets.from_dense(one) for one in (eye, damping * np.ones((n, n)), K))
    return System(*matrices, names, (Load("push", eye[0], sine),), local, (Probe("all", names, eye, (None,) * n),))


def make_problem(system, engine="auto", steps=20, **options):
    return Problem(system, ConstantSpeed(3.0), 0.01, steps, engine=engine, **options)


def engine_error(problem, method=None):
    with pytest.raises(InputError) as caught:
        solve(problem, method or newmark())
    message = str(caught.value)
    assert "run.engine" in message
    assert repr(problem.engine).strip("'") in message
    assert "Leave run.engine out" in message
    return message + caught.value.faults[0].why


@pytest.mark.parametrize("path", FORCED)
@pytest.mark.parametrize(("options", "method", "words"), [
    ({"adaptive": Adaptive()}, newmark(), "it has no adaptive steps"),
    ({}, bathe(), "only with newmark, hht and generalized-alpha"),
])  # fmt: skip
def test_adaptive_steps_and_bathe_need_direct_engine(path, options, method, words):
    assert words in engine_error(make_problem(masses(2), path, **options), method)
    assert select_engine(make_problem(masses(2), steps=2000, **options), method).engine == "direct"


@pytest.mark.parametrize("path", FORCED)
def test_size_limit_of_engines(path):
    assert "501 unknowns" in engine_error(make_problem(masses(501), path))
    assert select_engine(make_problem(masses(501), steps=100_000), newmark()).engine == "direct"
    assert select_engine(make_problem(masses(250), path), newmark()).engine == path


@pytest.mark.parametrize(("n", "steps", "path"), [
    (100, 1000, "modal"), (200, 1000, "direct"), (200, 3000, "modal"), (400, 3000, "direct"), (400, 12_000, "modal"),
])  # fmt: skip
def test_engine_depends_on_size(n, steps, path):
    """A modal analysis costs the cube of the unknowns and saves a time per step nearly independent of them."""
    assert select_engine(make_problem(masses(n), steps=steps), newmark()).engine == path


def test_engine_errors_name_local_forces_and_damping():
    assert "bumper depends on the motion" in engine_error(make_problem(masses(2, law=elastic_stop(1e3)), "modal"))
    assert "the law of bumper is a Python object" in engine_error(make_problem(masses(2, law=PythonLaw()), "kernel"))
    assert "the damping couples the modes" in engine_error(make_problem(masses(2, damping=1.0), "modal"))


@pytest.mark.parametrize("path", FORCED)
@pytest.mark.parametrize("K", [
    np.array([[1.0, 0.0], [0.0, -1e-3]]), np.array([[1.0, 0.5], [-0.5, 1.0]]), np.array([[1.0, 3.0], [3.0, 1.0]]),
])  # fmt: skip
def test_indefinite_or_unsymmetric_stiffness_needs_direct_engine(path, K):
    """Buckled or with a follower force: growing motions that no natural mode represents."""
    assert "not symmetric and positive" in engine_error(make_problem(masses(2, stiffness=K), path))
    automatic, general = (
        solve(make_problem(masses(2, stiffness=K), one, 2000), newmark()) for one in ("auto", "direct")
    )
    assert automatic.stats.engine == "direct"
    np.testing.assert_array_equal(automatic.probes.displacement, general.probes.displacement)


@pytest.mark.parametrize("path", ["auto", "direct"])
@pytest.mark.parametrize("damping", [0.0, 1.0])
def test_undetermined_unknown_fails_run(path, damping):
    system = masses(2)
    M, C = Triplets.from_dense(np.diag([1.0, 0.0])), Triplets.from_dense(np.diag([0.0, damping]))
    K = Triplets.from_dense(np.diag([1.0, 0.0]))
    with pytest.raises(RunFailedError, match="nothing determines the motion"):
        solve(make_problem(replace(system, mass=M, damping=C, stiffness=K), path, 2000), newmark())


def test_engine_without_compiler(monkeypatch):
    monkeypatch.setattr(Program, "is_available", lambda program: False)
    assert "numba is not installed" in engine_error(make_problem(masses(2), "kernel"))
    assert select_engine(make_problem(masses(2, law=elastic_stop(1e3)), steps=10_000), newmark()).engine == "direct"
    assert select_engine(make_problem(masses(2), steps=400_000), newmark()).engine == "modal"


@pytest.mark.parametrize(("law", "steps", "runs", "path"), [
    (None, 999, 1, "direct"), (None, 1000, 1, "modal"), (None, 1_000_000, 1, "modal"), (None, 999, 100, "direct"),
    (None, 1000, 100, "modal"), (elastic_stop(1e3), 11_000, 1, "direct"),
    (elastic_stop(1e3), 12_000, 1, "kernel"), (elastic_stop(1e3), 120, 100, "kernel"), (PythonLaw(), 5000, 1, "direct"),
])  # fmt: skip
def test_engine_depends_on_total_steps(law, steps, runs, path):
    for method in (newmark(), hht(), generalized_alpha()):
        assert select_engine(make_problem(masses(3, law=law), steps=steps, runs=runs), method).engine == path


@pytest.mark.parametrize(("steps", "runs", "path"), [
    (2000, 1, "direct"), (24_000, 1, "direct"), (26_000, 1, "kernel"), (1000, 100, "kernel"),
])  # fmt: skip
def test_engine_with_coupled_damping(steps, runs, path):
    """No mode is uncoupled: the kernel engine is used, or the direct engine for short runs."""
    problem = make_problem(masses(2, damping=1.0), steps=steps, runs=runs)
    assert select_engine(problem, newmark()).engine == path


def test_engine_depends_on_pruned_system():
    """The contact is on inactive degrees of freedom; the active part is linear."""
    far = np.eye(3)[2]
    force = LocalForce(
        "far", (AngleVector.constant(far),), (AngleVector.constant(-far),), PythonLaw(), (constant(0.0),)
    )
    system = replace(masses(3), local_forces=(force,))
    assert select_engine(make_problem(system, steps=2000, prune=True), newmark()).engine in (
        "direct",
        "modal",
    )
    whole, pruned = (solve(make_problem(system, steps=2000, prune=prune), newmark()) for prune in (False, True))
    assert whole.stats.engine == "direct"
    np.testing.assert_allclose(
        pruned.probes.displacement, whole.probes.displacement, rtol=0.0,
        atol=1e-12 * np.abs(whole.probes.displacement).max(),
    )  # fmt: skip


@pytest.mark.parametrize("path", ["direct", *FORCED])
def test_engines_agree_on_reduced_basis(path):
    """All engines integrate amplitudes of shapes: one rigid shape, and two."""
    system = masses(3)
    for T in (np.array([[1.0], [0.5], [0.2]]), np.array([[1.0, 0.0], [0.5, 1.0], [0.2, -1.0]])):
        problem = make_problem(system, "direct", 300, basis=ModeBasis(T))
        general, found = (solve(replace(problem, engine=one), newmark()) for one in ("direct", path))
        assert found.stats.engine == path
        for kind, most in (("displacement", 1e-12), ("velocity", 1e-12), ("acceleration", 1e-11)):
            one, other = (getattr(run.fields, kind) for run in (general, found))
            np.testing.assert_allclose(other, one, rtol=0.0, atol=most * np.abs(one).max())


@pytest.mark.parametrize(("path", "law"), [("modal", None), ("kernel", None), ("kernel", elastic_stop(1e4, 1.0))])
def test_repeated_run_is_bit_identical(path, law):
    problem = make_problem(masses(6, law=law), path, 700)
    one, other = (solve(problem, hht(), save=SaveAt(fields_per_block=32)) for _ in range(2))
    assert one.fields.acceleration.tobytes() == other.fields.acceleration.tobytes()
    assert np.array(list(one.channels.values())).tobytes() == np.array(list(other.channels.values())).tobytes()


def digest(path):
    law = elastic_stop(1e4, 1.0) if path == "kernel" else None
    run = solve(make_problem(masses(6, law=law), path, 700), hht())
    return hashlib.sha256(run.probes.acceleration.tobytes()).hexdigest()


@pytest.mark.slow
def test_processes_give_bit_identical_runs():
    code = "from tests.dynamics.test_engine_selection import FORCED, digest\nprint(*map(digest, FORCED))"
    words = [sys.executable, "-c", code]
    root = Path(__file__).parents[2]
    other = subprocess.run(words, capture_output=True, text=True, check=True, cwd=root)
    assert other.stdout.split() == [digest(path) for path in FORCED]


@pytest.mark.parametrize("prune", [False, True])
@pytest.mark.parametrize("method", mostly_slow([newmark(), hht(), generalized_alpha(rho_inf=0.5)]))
@pytest.mark.parametrize("path", ["direct", "modal"])
def test_restart_from_saved_field(path, method, prune):
    """Under several loads and from several instants: within a block, at its end, after it."""
    system = masses(7)
    loads = tuple(Load(f"l{i}", np.random.default_rng(i).normal(size=7), sine) for i in range(3))
    problem = Problem(replace(system, loads=loads), ConstantSpeed(3.0), 0.01, 700, engine=path, prune=prune)
    save = SaveAt(field_every=10, fields_per_block=64)
    whole = solve(problem, method, save=save)
    for taken in (320, 640, 650):
        fields = solve(replace(problem, steps=taken), method, save=save).fields
        d, v, a = (one[-1] for one in (fields.displacement, fields.velocity, fields.acceleration))
        start = State(d, v, float(whole.time[taken]), acceleration=a)
        later = solve(replace(problem, steps=700 - taken, start=start), method, save=save)
        for kind in ("displacement", "velocity", "acceleration"):
            expected = getattr(whole.fields, kind)[taken // 10 :]
            # The first acceleration has the rounding of a displacement by the square of the step, 1e-4 s^2.
            most = (1e-9 if kind == "acceleration" else 1e-12) * np.abs(expected).max()
            np.testing.assert_allclose(getattr(later.fields, kind), expected, rtol=0.0, atol=most, err_msg=kind)


def test_numba_is_available():
    assert PROGRAM.is_available()


def massless_system(K, mass=(1.0, 1.0, 0.0)):
    M = Triplets.from_dense(np.diag(mass))
    return replace(masses(3, stiffness=K), mass=M, damping=Triplets.zeros(3))


@pytest.mark.parametrize("soft", [1.0, 1e-3])
def test_free_motion_with_massless_unknown_is_not_indefinite(soft):
    """Two bodies on a stiff and a soft spring with a massless node between; condensation leaves rounding only."""
    stiff = 2.0823e7
    K = np.array([[stiff, 0.0, -stiff], [0.0, soft, -soft], [-stiff, -soft, stiff + soft]])
    for path in FORCED:
        general, found = (solve(make_problem(massless_system(K), one, 200), newmark()) for one in ("direct", path))
        one, other = general.probes.displacement, found.probes.displacement
        # The soft spring is small against the rounding of the stiff one: eps stiff/soft of its force.
        np.testing.assert_allclose(other, one, rtol=0.0, atol=1e-5 * np.abs(one).max())


@pytest.mark.parametrize("push", [-1e-3, -1e3])
def test_negative_stiffness_behind_massless_unknown(push):
    K = np.array([[10.0, 0.0, -10.0], [0.0, 10.0 + push, -10.0], [-10.0, -10.0, 20.0]])
    assert "not symmetric and positive" in engine_error(make_problem(massless_system(K), "modal"))


@pytest.mark.parametrize(("stiffness", "options", "method"), [
    (1.5e5, {}, collocation()),  # (omega h)^2 = 15/16 in a quarter of the step
    (1.7e5, {}, newmark()),
    (1.5e5, {"engine": "direct"}, newmark()),
    (1.5e5, {"adaptive": Adaptive()}, newmark()),
    (None, {}, newmark()),
])  # fmt: skip
def test_default_integration_method(stiffness, options, method):
    law = None if stiffness is None else elastic_stop(stiffness)
    assert default_method(make_problem(masses(2, law=law), **options)) == method
