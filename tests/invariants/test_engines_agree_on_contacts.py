"""Kernel and direct engine give the same motion with local forces of every kind.

Two solutions of a contact problem differ by the tolerance of their iterations (1e-12 of the maximum force), and
impacts amplify the difference at every touchdown. The amplification is measured by direct runs with stiffness and
loads changed by this tolerance, and by one with its unknowns in another order.
"""

from dataclasses import replace

import numpy as np
import pytest

from flexcam.core import Triplets
from flexcam.dynamics import (
    AngleVector,
    ConstantSpeed,
    FluctuatingSpeed,
    Load,
    LocalForce,
    Probe,
    Problem,
    State,
    System,
    constant,
    elastic_stop,
    hunt_crossley_contact,
    newmark,
    oil_column_law,
    solve,
    spring_damper,
)
from flexcam.fem.elements.arch import Arch
from flexcam.valvetrain import Lever, Pulsation
from flexcam.valvetrain.cam_contact import HertzLine
from flexcam.valvetrain.contacts import lever_end
from flexcam.valvetrain.strength import arch_laws
from tests import integrators
from tests.rounding import stronger
from tests.thinning import mostly_slow

SCHEMES = {name: one for name, one in integrators.SCHEMES.items() if name in (*integrators.METHODS, "newmark damped")}
SCHEMES_OF_ONE = ("newmark", "generalized-alpha")
STEPS = 60
FORCE_TOLERANCE = 1e-12
"""Tolerance of the forces relative to the maximum, as in `local_newton` and in the compiled step."""

TOLERANCE_FACTORS = (-3.0, 1.0, 5.0)
DIVERGED = 1e-6
"""Spread above which direct runs have diverged: they differ in single bounces."""


def harmonic_function(mean, swing, order=1.0):
    """Return a function of the cam angle with all its derivatives."""
    return lambda angle, k: mean * (k == 0) + swing * order**k * np.sin(order * angle + 0.5 * np.pi * k)


def sine(motion):
    return np.sin(motion.angle)


def steady(motion):
    return np.ones_like(motion.angle)


LINE = HertzLine(0.01, 2e11, 0.3, harmonic_function(0.02, 0.005), 0.03, 0.1)
LEVER = Lever("a", "b", (0.03, 0.04), 1e-4, np.eye(6)[1], angles=(0.1, -0.2), stiffness=(1e5, 2e5), damping=(5.0, 9.0))


def arch(rng):
    pulls = rng.normal(size=(6, 6))
    return arch_laws(Arch(np.array([1e5]), 0.2 * (pulls @ pulls.T)[None], 0.01 * rng.normal(size=(1, 6))))[0]


KINDS = {
    "bilateral": lambda rng, k: (spring_damper(k, 1e-5 * k), 1),
    "stop": lambda rng, k: (elastic_stop(k, 1e-5 * k), 1),
    "stops": lambda rng, k: (elastic_stop(k, 1e-5 * k), 3),
    "hunt-crossley": lambda rng, k: (hunt_crossley_contact(k, 0.3), 1),
    "line": lambda rng, k: (LINE.law(), 1),
    "inclined": lambda rng, k: (LINE.law(harmonic_function(0.9, 0.08)), 1),
    "sliding": lambda rng, k: (replace(hunt_crossley_contact(k, 0.3), friction=(0.1, 0.05)), 2),
    "sliding line": lambda rng, k: (replace(LINE.law(), friction=(0.1, 0.05)), 2),
    "oil": lambda rng, k: (oil_column_law(k, 0.1 * k, 1e-3 * k, 5.0), 1),
    "pulsating": lambda rng, k: (Pulsation(2.0, 0.4).law(k), 2),
    "lever": lambda rng, k: (lever_end(LEVER, int(rng.integers(2))), 2),
    "arch": lambda rng, k: (arch(rng), 7),
}
CONTACTS = ("stop", "stops", "hunt-crossley", "line", "inclined", "sliding", "sliding line")
"""Kinds whose steps end at opening and closing."""


def random_row(rng, n):
    found = np.zeros(n)
    found[rng.integers(n)] = 1.0
    if rng.random() < 0.5:
        found[rng.integers(n)] -= 0.7
    return found


def random_vector(rng, n, *, turning):
    if not turning or rng.random() < 0.5:
        return AngleVector.constant(random_row(rng, n))
    return AngleVector(np.array([random_row(rng, n), random_row(rng, n)]), (constant(1.0), harmonic_function(0.1, 0.2)))


def random_force(rng, n, kind, *, restitution=None, ahead=0.0):
    """Return a local force; `ahead` is the initial distance from contact, m."""
    law, count = KINDS[kind](rng, 10.0 ** rng.uniform(3.0, 6.5))
    sense = tuple(random_vector(rng, n, turning=kind not in ("arch", "lever")) for _ in range(count))
    act = tuple(AngleVector(-one.vectors, one.functions) for one in sense)
    at = 0.0 if kind == "arch" else 1.0
    offset = tuple(harmonic_function(at * (rng.uniform(-1e-4, 3e-4) - ahead), at * 1e-4, 3.0) for _ in range(count))
    return LocalForce(kind, sense, act, law, offset, restitution if kind in CONTACTS else None)


def chain(rng, n, *, massless=False):
    k = 1e3 * 10.0 ** rng.uniform(0.0, 3.0, n)
    K = np.diag(k) + np.diag([*k[1:], 0.0]) - np.diag(k[1:], 1) - np.diag(k[1:], -1)
    M = np.diag(rng.uniform(0.05, 0.5, n))
    if massless:
        M[n // 2] = 0.0
    pulls = rng.normal(size=(n, 1))
    C = 1e-5 * K if rng.random() < 0.5 else 1e-5 * K + pulls @ pulls.T  # the second couples the modes
    return M, C, K


def random_problem(rng, kinds, *, massless=False, drive=None, **options):
    n = int(rng.integers(2, 8))
    M, C, K = chain(rng, n, massless=massless)
    names = tuple(f"x{i}" for i in range(n))
    loads = tuple(Load(f.__name__, size * random_row(rng, n), f) for f, size in ((sine, 100.0), (steady, 30.0)))
    forces = tuple(random_force(rng, n, kind, **options) for kind in kinds)
    matrices = [Triplets.from_dense(one) for one in (M, C, K)]
    system = System(*matrices, names, loads, forces, (Probe("all", names, np.eye(n), (None,) * n),))
    start = State(1e-5 * rng.normal(size=n), 0.1 * rng.normal(size=n))
    return Problem(system, drive or ConstantSpeed(100.0), 10.0 ** rng.uniform(-5.0, -3.7), STEPS, start)


def reorder(problem, order):
    """Return the same problem with its unknowns and probes in another order."""
    system, start = problem.system, problem.start
    names = tuple(system.names[i] for i in order)

    def reorder_vector(one):
        return AngleVector(one.vectors[:, order], one.functions)

    forces = tuple(
        replace(one, sense=tuple(map(reorder_vector, one.sense)), act=tuple(map(reorder_vector, one.act)))
        for one in system.local_forces
    )
    other = replace(
        system, mass=system.mass.part(order), damping=system.damping.part(order),
        stiffness=system.stiffness.part(order), names=names, local_forces=forces,
        loads=tuple(replace(load, vector=load.vector[order]) for load in system.loads),
        probes=tuple(replace(probe, rows=probe.rows[:, order]) for probe in system.probes),
    )  # fmt: skip
    begin = replace(start, displacement=start.displacement[order], velocity=start.velocity[order])
    return replace(problem, system=other, start=begin)


def running_difference(one, other):
    """Return the difference of two runs up to each instant, relative to the maximum displacement, shape (m,).

    Where the other run ended early, for example with a lever out of range, the difference is infinite.
    """
    off, count = np.full(len(one.time), np.inf), len(other.time)
    off[:count] = np.abs(one.probes.displacement[:count] - other.probes.displacement).max(axis=1)
    return np.maximum.accumulate(off) / np.abs(one.probes.displacement).max()


def compare_engines(problem, scheme):
    """Assert that kernel and direct engine agree, and return both runs."""
    general, found = (solve(replace(problem, engine=path), scheme) for path in ("direct", "kernel"))
    assert found.stats.engine == "kernel"
    assert general.status.cause is found.status.cause
    if not general.status.ok:  # a lever or an arch is out of range
        return general, found
    order = np.random.default_rng(0).permutation(problem.system.size)
    others = [reorder(problem, order), *(stronger(problem, FORCE_TOLERANCE * share) for share in TOLERANCE_FACTORS)]
    spread = np.max(
        [running_difference(general, solve(replace(one, engine="direct"), scheme)) for one in others], axis=0
    )
    off = running_difference(general, found)
    known = spread < DIVERGED
    assert known[: STEPS // 10].all()
    assert (off <= 30.0 * spread + 10.0 * FORCE_TOLERANCE)[known].all(), (off[known][-1], spread[known][-1])
    if spread[-1] < 1e-9:  # equal numbers of bounces
        assert found.stats.events == pytest.approx(general.stats.events, abs=2)
    return general, found


@pytest.mark.parametrize(
    ("kind", "scheme"),
    mostly_slow([(kind, s) for i, kind in enumerate(sorted(KINDS)) for s in SCHEMES_OF_ONE[:: 1 - 2 * (i % 2)]], 2),
)
def test_single_force_of_every_kind(kind, scheme):
    rng = np.random.default_rng(list(KINDS).index(kind))
    general, found = compare_engines(random_problem(rng, [kind]), SCHEMES[scheme])
    states = [name for name in general.channels if name.startswith("state.")]
    assert bool(states) == (kind == "oil")
    for name in states:
        values = general.channels[name]
        np.testing.assert_allclose(found.channels[name], values, rtol=0.0, atol=1e-9 * np.abs(values).max())


@pytest.mark.parametrize(
    ("kind", "scheme", "restitution"),
    mostly_slow(
        [(kind, *way) for kind in sorted(CONTACTS) for way in (("newmark", 0.0), ("newmark", 0.5), ("hht", 0.5))], 2
    ),
)
def test_steps_ending_at_contact_events(kind, scheme, restitution):
    rng = np.random.default_rng(10 + list(KINDS).index(kind))
    compare_engines(random_problem(rng, [kind], restitution=restitution), SCHEMES[scheme])


@pytest.mark.parametrize("seed", mostly_slow([3, 0, 1, 2], 4))
def test_several_forces(seed):
    """With massless unknowns, where a shallow arch would have several equilibria, and with fluctuating speed."""
    rng = np.random.default_rng(100 + seed)
    massless = seed % 4 == 0
    kinds = rng.choice([kind for kind in sorted(KINDS) if not (massless and kind == "arch")], size=3).tolist()
    scheme = SCHEMES[rng.choice(sorted(SCHEMES))]
    drive = FluctuatingSpeed(100.0, (2.0,), (0.3,), (0.5,)) if seed % 2 else None
    compare_engines(random_problem(rng, kinds, massless=massless, drive=drive), scheme)


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(100))
def test_many_random_forces(seed):
    rng = np.random.default_rng(1000 + seed)
    kinds = rng.choice(sorted(KINDS), size=int(rng.integers(1, 5))).tolist()
    restitution = [None, 0.0, 0.6][seed % 3]
    problem = random_problem(rng, kinds, restitution=restitution, massless=False)
    compare_engines(problem, SCHEMES[rng.choice(sorted(SCHEMES))])


def test_engines_agree_to_rounding_before_first_contact():
    rng = np.random.default_rng(0)
    problem = random_problem(rng, ["stop", "hunt-crossley"], ahead=1.0)
    general, found = (solve(replace(problem, engine=path), newmark()) for path in ("direct", "kernel"))
    assert general.stats.events == found.stats.events == 0
    assert running_difference(general, found)[-1] < 1e-12


@pytest.mark.parametrize(("scheme", "gain"), [("newmark", 2.0), ("newmark", 30.0), ("hht", 30.0)])
def test_mutually_coupled_forces(scheme, gain):
    """Each force senses the unknown that the other one moves: no direct feedback, but a coupled solution.

    The gain is the feedback of a force through both per step.
    """
    step = 0.01
    k = np.sqrt(gain) / (0.25 * step**2)
    names, eye = ("x", "y"), np.eye(2)
    ends = ((0, 1, k), (1, 0, -k))
    forces = tuple(
        LocalForce(f"on {names[to]}", (AngleVector.constant(eye[at]),), (AngleVector.constant(eye[to]),),
                   spring_damper(stiffness), (constant(0.0),)) for at, to, stiffness in ends
    )  # fmt: skip
    matrices = [Triplets.from_dense(one) for one in (eye, 0.0 * eye, np.diag([100.0, 200.0]))]
    load = Load("sine", eye[0], sine)
    system = System(*matrices, names, (load,), forces, (Probe("all", names, eye, (None, None)),))
    problem = Problem(system, ConstantSpeed(3.0), step, 20)
    general, found = (solve(replace(problem, engine=path), SCHEMES[scheme]) for path in ("direct", "kernel"))
    # Such forces feed energy: the motion grows by orders of magnitude, and so does the iteration error of 1e-12.
    assert (np.abs(found.probes.displacement - general.probes.displacement).max()
            < 1e-9 * np.abs(general.probes.displacement).max())  # fmt: skip
    K = np.array([[100.0, k], [-k, 200.0]])  # the same forces without an iteration
    linear = replace(system, stiffness=Triplets.from_dense(K), local_forces=())
    expected = solve(replace(problem, system=linear, engine="direct"), SCHEMES[scheme]).probes.displacement
    assert np.abs(general.probes.displacement - expected).max() < 1e-9 * np.abs(expected).max()
