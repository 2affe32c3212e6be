"""Direct, modal and kernel engine give the same motion of linear systems.

The allowed difference is measured: direct runs of the same system with its unknowns in other orders and units differ
by the rounding of the system itself.
"""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from flexcam.core import Triplets
from flexcam.core.errors import InputError
from flexcam.dynamics import ConstantSpeed, Load, Probe, Problem, SaveAt, State, System, newmark, solve
from tests.integrators import SCHEMES
from tests.thinning import mostly_slow

SERIES = ("displacement", "velocity", "acceleration")
DAMPING = ["none", "Rayleigh", "any", "massless"]
STEPS = 120


def sine(motion):
    return np.sin(motion.angle)


def ramp(motion):
    return np.minimum(motion.angle, 1.0)


def steady(motion):
    return np.ones_like(motion.angle)


def chain(rng, n, decades, *, free, copies):
    """Return matrices of a chain of masses and springs over some decades; copies repeat all frequencies."""
    k = 10.0 ** (2.0 + rng.uniform(0.0, decades, n))
    K = np.zeros((n, n))
    for i in range(n):
        K[i, i] += 0.0 if free and i == 0 else k[i]
        if i:
            K[i - 1 : i + 1, i - 1 : i + 1] += k[i] * np.array([[1.0, -1.0], [-1.0, 1.0]])
            K[i, i] -= k[i]
    M = np.diag(rng.uniform(0.5, 2.0, n))
    return np.kron(np.eye(copies), M), np.kron(np.eye(copies), K)


def damping_matrix(kind, rng, M, K, light):
    n = len(M)
    if kind == "Rayleigh":
        return 0.3 * M + 1e-4 * K
    if kind == "any":
        pulls = rng.normal(size=(n, 2))
        return pulls @ pulls.T
    return np.diag(light.astype(float)) if kind == "massless" else np.zeros((n, n))


def random_system(seed, n, decades, kind, *, free=False, copies=1, massless=0):
    """Return a random system and an initial state."""
    rng = np.random.default_rng(seed)
    M, K = chain(rng, n, decades, free=free, copies=copies)
    n = len(M)
    light = np.zeros(n, dtype=bool)
    light[rng.permutation(n)[: min(massless, n - 1)]] = True
    M[light] = 0.0
    names = tuple(f"x{i}" for i in range(n))
    loads = tuple(
        Load(history.__name__, rng.normal(size=n) * (rng.random(n) < 0.5), history) for history in (sine, ramp, steady)
    )
    matrices = [Triplets.from_dense(one) for one in (M, damping_matrix(kind, rng, M, K, light), K)]
    system = System(*matrices, names, loads, probes=(Probe("all", names, np.eye(n), (None,) * n),))
    return system, State(0.01 * rng.normal(size=n), rng.normal(size=n))


def permute_and_scale(system, start, rng):
    """Return the same system and start with the unknowns in another order and units, but equal probes."""
    n = system.size
    T = (np.eye(n) * rng.uniform(0.5, 2.0, n))[:, rng.permutation(n)]
    M, C, K = (Triplets.from_dense(T.T @ one.dense() @ T) for one in (system.mass, system.damping, system.stiffness))
    loads = tuple(replace(load, vector=T.T @ load.vector) for load in system.loads)
    probes = tuple(replace(probe, rows=probe.rows @ T) for probe in system.probes)
    other = replace(system, mass=M, damping=C, stiffness=K, loads=loads, probes=probes)
    back = np.linalg.inv(T)
    pushed = None if start.acceleration is None else back @ start.acceleration
    return other, replace(
        start, displacement=back @ start.displacement, velocity=back @ start.velocity, acceleration=pushed
    )


def choose_step(system):
    """Return a step that resolves some modes and not the faster ones."""
    stiff, heavy = system.stiffness.diagonal(), system.mass.diagonal().max()
    middle = np.exp(np.log(np.maximum(stiff, 1.0)).mean())
    return float(0.5 * np.sqrt(heavy / middle))


def relative_differences(one, other):
    """Return the relative differences of two runs in each kind of motion and in the energies."""
    motions = [(getattr(one.probes, kind), getattr(other.probes, kind)) for kind in SERIES]
    energies = ([run.channels[name] for name in one.channels if name.startswith("energy.")] for run in (one, other))
    pairs = [*motions, tuple(np.array(list(its)) for its in energies)]
    return np.array([np.abs(a - b).max() / max(np.abs(a).max(), 1e-300) for a, b in pairs])


ROUNDING = np.array([1e-13, 1e-13, 1e-12, 1e-12])
"""Minimum tolerance if two direct runs agree by chance: some hundred roundings of as many steps."""


def rounding_spread(problem, scheme, reference):
    found = ROUNDING
    for seed in range(3):
        system, start = permute_and_scale(problem.system, problem.start, np.random.default_rng(seed))
        other = solve(replace(problem, system=system, start=start), scheme)
        found = np.maximum(found, relative_differences(reference, other))
    return found


def run_engines(problem, scheme, paths=("modal", "kernel")):
    """Return the direct run and the runs, or errors, of the other engines."""
    general = solve(replace(problem, engine="direct"), scheme)
    others = {}
    for path in paths:
        try:
            others[path] = solve(replace(problem, engine=path), scheme)
        except InputError as refusal:
            others[path] = refusal
    return general, others


def assert_engines_agree(problem, scheme, *, modal=True):
    general, others = run_engines(problem, scheme)
    assert general.status.ok
    allowed = 10.0 * rounding_spread(replace(problem, engine="direct"), scheme, general)
    for path, run in others.items():
        if path == "modal" and not modal:
            assert "damping couples" in str(run)
            continue
        assert not isinstance(run, InputError), f"{path}: {run}"
        assert run.stats.engine == path
        assert run.outline == general.outline
        np.testing.assert_array_equal(run.time, general.time)
        np.testing.assert_array_equal(run.field_time, general.field_time)
        assert (relative_differences(general, run) <= allowed).all(), (
            path,
            relative_differences(general, run),
            allowed,
        )


@settings(max_examples=12, deadline=None, derandomize=True)
@given(
    seed=st.integers(0, 2**16), n=st.integers(1, 10), decades=st.floats(0.0, 10.0), free=st.booleans(),
    copies=st.integers(1, 3), kind=st.sampled_from(["none", "Rayleigh"]), scheme=st.sampled_from(sorted(SCHEMES)),
)  # fmt: skip
def test_random_systems_with_uncoupled_damping(seed, n, decades, free, copies, kind, scheme):
    system, start = random_system(seed, n, decades, kind, free=free, copies=copies)
    assert_engines_agree(Problem(system, ConstantSpeed(3.0), choose_step(system), STEPS, start), SCHEMES[scheme])


@pytest.mark.parametrize("kind", [pytest.param("none", marks=pytest.mark.slow), "Rayleigh"])
def test_systems_with_hundreds_of_unknowns(kind):
    """Modes whose last digits come from sliced products."""
    system, start = random_system(4, 120, 6.0, kind, copies=2)
    assert_engines_agree(Problem(system, ConstantSpeed(3.0), choose_step(system), STEPS, start), SCHEMES["newmark"])


@settings(max_examples=10, deadline=None, derandomize=True)
@given(
    seed=st.integers(0, 2**16), n=st.integers(2, 8), decades=st.floats(0.0, 6.0), massless=st.integers(0, 4),
    kind=st.sampled_from(DAMPING), scheme=st.sampled_from(sorted(SCHEMES)),
)  # fmt: skip
def test_random_systems_with_massless_unknowns(seed, n, decades, massless, kind, scheme):
    """Massless unknowns, alone and in groups; the kernel engine alone supports coupled damping."""
    system, start = random_system(seed, n, decades, kind, massless=massless)
    problem = Problem(system, ConstantSpeed(3.0), choose_step(system), STEPS, start)
    if kind in ("none", "Rayleigh"):
        assert_engines_agree(problem, SCHEMES[scheme])
        return
    general, others = run_engines(problem, SCHEMES[scheme], ("kernel",))
    allowed = 10.0 * rounding_spread(replace(problem, engine="direct"), SCHEMES[scheme], general)
    off = relative_differences(general, others["kernel"])
    assert (off <= allowed).all(), (off, allowed)


@pytest.mark.parametrize(("kind", "scheme"), mostly_slow([(kind, s) for kind in DAMPING for s in sorted(SCHEMES)], 5))
def test_massless_unknowns_with_initial_velocity(kind, scheme):
    """Massless unknowns follow their springs from the first instant; all engines use the same initial state."""
    M, K = np.diag([1.0, 0.0, 2.0]), 10.0 * np.array([[3.0, -2.0, 0.0], [-2.0, 3.0, -1.0], [0.0, -1.0, 2.0]])
    C = damping_matrix(kind, np.random.default_rng(1), M, K, np.array([False, True, False]))
    names = ("a", "b", "c")
    loads = tuple(
        Load(f.__name__, v, f) for f, v in ((sine, np.array([1.0, 0.0, 0.0])), (steady, np.array([0, 1.0, 0])))
    )
    matrices = [Triplets.from_dense(one) for one in (M, C, K)]
    system = System(*matrices, names, loads, probes=(Probe("all", names, np.eye(3), (None,) * 3),))
    start = State(np.array([0.1, 0.2, 0.3]), np.array([1.0, -1.0, 2.0]))
    problem = Problem(system, ConstantSpeed(3.0), 0.01, 200, start)
    assert_engines_agree(problem, SCHEMES[scheme], modal=kind in ("none", "Rayleigh"))


@pytest.mark.parametrize("path", ["direct", "modal", "kernel"])
def test_initial_acceleration_of_massless_unknown(path):
    """A massless unknown between two springs has its share of the initial acceleration of a loaded mass."""
    M, K = np.diag([1.0, 0.0]), np.array([[3.0, -1.0], [-1.0, 2.0]])
    system = System(*(Triplets.from_dense(one) for one in (M, 0.0 * M, K)), ("heavy", "light"),
                    (Load("push", np.array([1.0, 0.0]), steady),))  # fmt: skip
    found = solve(Problem(system, ConstantSpeed(1.0), 0.01, 50, engine=path), newmark(), save=SaveAt(field_every=1))
    a = found.fields.acceleration
    # K a = 0 in the massless row at every instant; Newmark keeps the initial error, and rounding over step^2.
    np.testing.assert_allclose(2.0 * a[:, 1], a[:, 0], rtol=0.0, atol=1e-9)
    assert a[0, 0] == pytest.approx(1.0)


@pytest.mark.parametrize("scheme", ["newmark", "hht", "generalized-alpha 0"])
@pytest.mark.parametrize("path", ["modal", "kernel"])
def test_run_continues_with_other_engine(path, scheme):
    """Half a run with the direct engine and half with another one equals the direct run; a `State` connects them."""
    system, start = random_system(5, 6, 4.0, "Rayleigh")
    problem = Problem(system, ConstantSpeed(3.0), choose_step(system), STEPS, start, engine="direct")
    every = SaveAt(field_every=20)
    whole = solve(problem, SCHEMES[scheme], save=every)
    first = solve(replace(problem, steps=60), SCHEMES[scheme], save=every)
    middle = State(*(getattr(first.fields, kind)[-1] for kind in SERIES[:2]), float(first.time[-1]),
                   acceleration=first.fields.acceleration[-1])  # fmt: skip
    later = solve(replace(problem, steps=60, start=middle, engine=path), SCHEMES[scheme], save=every)
    allowed = 10.0 * rounding_spread(problem, SCHEMES[scheme], whole)
    for kind, most in zip(SERIES, allowed, strict=False):
        one, other = getattr(whole.probes, kind), getattr(later.probes, kind)
        assert np.abs(other - one[60:]).max() <= most * np.abs(one).max()


@pytest.mark.parametrize("steps", [100_000, pytest.param(1_000_000, marks=pytest.mark.slow)])
@pytest.mark.parametrize("path", ["modal", "kernel"])
def test_energy_is_constant_over_long_run(path, steps):
    """Average acceleration, no damping, stiffness ratios of 1e6: the error of 1e5 steps is rounding.

    A step preserves the energy of a motion exactly; roundings add up as a random walk, sqrt(1e5) eps = 7e-14, and to at
    most 1e5 eps = 2e-11 if all have one sign.
    """
    system, start = random_system(3, 6, 6.0, "none")
    still = replace(system, loads=())
    problem = Problem(still, ConstantSpeed(1.0), choose_step(system), steps, start, engine=path)
    found = solve(problem, newmark(), save=SaveAt(field_every=100_000))
    energy = found.channels["energy.kinetic"] + found.channels["energy.strain"]
    assert found.stats.engine == path
    assert np.abs(energy / energy[0] - 1.0).max() < 1e-11


@pytest.mark.parametrize("path", ["direct", "modal", "kernel"])
@pytest.mark.parametrize("save", [SaveAt(1, 1), SaveAt(1, 2), SaveAt(7, 1), SaveAt(1000), SaveAt(10, 3)])
def test_save_options_do_not_change_histories(path, save):
    """Blocks of one instant, of two, and longer than the run: equal histories to rounding, exact saved fields."""
    system, start = random_system(8, 4, 2.0, "Rayleigh")
    problem = Problem(system, ConstantSpeed(3.0), choose_step(system), 45, start, engine=path)
    plain, found = solve(problem, newmark()), solve(problem, newmark(), save=save)
    assert (relative_differences(plain, found) <= 10.0 * ROUNDING).all()
    np.testing.assert_array_equal(found.field_time, found.time[np.unique([*range(0, 46, save.field_every), 45])])
    picked = np.isin(found.time, found.field_time)
    # A saved field is computed from the same amplitudes as a probe, but in other sums.
    np.testing.assert_allclose(found.fields.displacement, found.probes.displacement[picked], rtol=1e-12, atol=1e-14)
