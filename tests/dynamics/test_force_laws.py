"""Every force law: tangent, energy, dissipation, Python and compiled code, at rest and in a step.

A new law needs a row in `CASES`; everything here then applies to it.
"""

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from flexcam.core import Triplets
from flexcam.dynamics import (
    AngleVector,
    CamMotion,
    ConstantSpeed,
    Load,
    LocalForce,
    Probe,
    Problem,
    State,
    System,
    constant,
    elastic_stop,
    equilibrium,
    hunt_crossley_contact,
    newmark,
    oil_column_law,
    solve,
    spring_damper,
)
from flexcam.dynamics.force_laws import LAWS, OIL_CHAMBER, SHORT_BEARING, SLIDING_FRICTION, line_load
from flexcam.dynamics.force_laws import LEVER as LEVER_KIND
from flexcam.dynamics.kernel_step import PROGRAM
from flexcam.dynamics.law_data import CamLift, ForceLaw, force_table_law
from flexcam.dynamics.local_forces import LocalForces
from flexcam.dynamics.oil_laws import oil_column
from flexcam.fem.elements.arch import Arch
from flexcam.valvetrain import Lever, Pulsation
from flexcam.valvetrain.cam_contact import HertzLine
from flexcam.valvetrain.contacts import lever_end
from flexcam.valvetrain.strength import arch_laws


def radius(angle, order):
    return 0.02 + 0.015 * np.sin(angle) if order == 0 else 0.015 * np.cos(angle)


def cosine(angle, order):
    return 0.9 + 0.09 * np.cos(2.0 * angle)


def wave(angle, order):
    """Return a lift whose derivative jumps at 0."""
    return (-0.15 * np.polynomial.Polynomial.fromroots([0.0, math.tau])).deriv(order)(np.mod(angle, math.tau))


LIFT = CamLift.of(wave, (0.0,))
LINE = HertzLine(0.01, 2.07e11, 0.29, radius, 0.03, 0.2)
LEVER = Lever(
    "a", "b", (0.03, 0.045), 1e-4, np.eye(6)[1], angles=(0.1, -0.2), stiffness=(1e7, 2e7), damping=(50.0, 9.0)
)


def arch():
    rng = np.random.default_rng(7)
    pulls = rng.normal(size=(6, 6))
    return Arch(np.array([1e6]), 0.2 * (pulls @ pulls.T)[None], 0.01 * rng.normal(size=(1, 6)))


CHAMBER = (9.5e-5, 5e-3, 1.5e9, 0.05, 3e5, 2e5, 1.5, 60.0, 90.0, 30.0)
NO_AIR = (9.5e-5, 5e-3, 1.5e9, 1e-6, 3e5, 2e5, 0.0, 60.0, 0.0, 20.0)

CASES = {
    "bilateral": (spring_damper(2e6, 30.0), 1e-3, 2.0),
    "stop": (elastic_stop(2e6, 300.0, 3e-5), 1e-4, 2.0),
    "hunt-crossley": (hunt_crossley_contact(5e7, 0.3), 1e-4, 2.0),
    "line contact": (LINE.law(), 1e-4, 2.0),
    "inclined line contact": (LINE.law(cosine), 1e-4, 2.0),
    "oil column": (oil_column_law(2e7, 5e4, 60.0, 12.0), 1e-4, 2.0),
    "oil chamber": (ForceLaw(OIL_CHAMBER, CHAMBER), 1e-4, 2.0),
    "chamber without much air": (ForceLaw(OIL_CHAMBER, NO_AIR), 1e-4, 2.0),
    "pulsating": (Pulsation(2.0, 0.7, 0.3).law(4e4), 1e-3, 2.0),
    "lever, driven end": (lever_end(LEVER, 0), 2e-3, 2.0),
    "lever, point": (lever_end(LEVER, 1), 2e-3, 2.0),
    "table": (force_table_law([-4e-4, 0.0, 2e-4, 7e-4], [-20.0, 0.0, 25.0, 30.0]), 1e-3, 2.0),
    "arch": (arch_laws(arch())[0], 1e-2, 0.0),
    "short bearing": (ForceLaw(SHORT_BEARING, (3e3, 3e-5, 150.0)), 2e-5, 2e-3),
    "journal at its shell": (ForceLaw(SHORT_BEARING, (3e3, 3e-5, 150.0)), 5e-5, 2e-3),
    "sliding friction": (ForceLaw(SLIDING_FRICTION, (20.0, 30.0, 0.1, 3.0, 0.01)), 1e-3, 0.3),
    "friction": (replace(hunt_crossley_contact(5e7, 0.3), friction=(0.12, 1e-2)), 1e-4, 2.0),
    "lift": (replace(spring_damper(2e6, 30.0), lift=LIFT), 5e-2, 2.0),
    "lift of a contact": (replace(hunt_crossley_contact(5e7, 0.3), lift=LIFT), 5e-2, 2.0),
    "lift and friction": (replace(LINE.law(cosine), friction=(0.1, 1e-2), lift=LIFT), 5e-2, 2.0),
    "friction of a line contact": (replace(LINE.law(cosine), friction=(0.1, 1e-2)), 1e-4, 2.0),
}
"""Law, size of its scalars and of their rates."""
ANGLE = 0.7


def stack_law(law, *, compiled=False):
    """Return the stacked local force of a law on its own unknowns, and its inputs at a cam angle."""
    rows = [AngleVector.constant(row) for row in np.eye(law.scalars)]
    acts = [AngleVector.constant(-row) for row in np.eye(law.scalars)]
    force = LocalForce("force", tuple(rows), tuple(acts), law, (constant(0.0),) * law.scalars)
    unit = Triplets.from_dense(np.eye(law.scalars))
    system = System(unit, unit, unit, tuple(map(str, range(law.scalars))), local_forces=(force,))
    forces = LocalForces(system, PROGRAM.compile() if compiled else None)
    return forces, forces.prescribed_inputs(CamMotion(*(np.array([x]) for x in (ANGLE, 1.0, 0.0, 0.0))))


def sample_points(name, count=200):
    law, size, speed = CASES[name]
    rng = np.random.default_rng(11)
    spread = np.concatenate(
        [rng.uniform(-1.0, 1.0, (count // 2, law.scalars)), rng.uniform(0, 1, (count // 2, law.scalars))]
    )
    return (
        size * spread,
        speed * rng.uniform(-1.0, 1.0, (count, law.scalars)),
        size * rng.uniform(-1, 1, (count, law.states)),
    )


def test_every_law_has_case():
    assert {law.kind for law, _, _ in CASES.values()} >= {kind for kind, row in LAWS.items() if row.name != "custom"}


@pytest.mark.parametrize("name", CASES)
def test_tangent_is_derivative_of_force(name):
    """Central differences; where two step sizes disagree, the law has a corner in between."""
    law, size, speed = CASES[name]
    forces, inputs = stack_law(law)
    checked = 0
    for x, v, z in zip(*sample_points(name, 60), strict=True):
        answer = forces.respond(x, v, z, inputs)
        for which, tangent, h in ((0, answer.by_penetration, 1e-6 * size), (1, answer.by_rate, 1e-6 * max(speed, 1.0))):
            for i in range(law.scalars):
                step = h * np.eye(law.scalars)[i]

                def force(k, step=step, which=which, x=x, v=v, z=z):
                    moved = (x + k * step, v) if which == 0 else (x, v + k * step)
                    return forces.respond(*moved, z, inputs).force

                wide, narrow = (force(2) - force(-2)) / (4 * h), (force(1) - force(-1)) / (2 * h)
                scale = np.abs(tangent).max(initial=1.0)
                if np.abs(wide - narrow).max() < 1e-6 * scale:
                    checked += 1
                    # rounding of the force over the step of the difference
                    np.testing.assert_allclose(tangent[:, i], narrow, rtol=1e-5, atol=2e-7 * scale)
    assert checked > 60


@pytest.mark.parametrize(
    "name", [n for n, one in CASES.items() if "friction" not in n and not LAWS[one[0].kind].circulatory]
)
def test_elastic_force_is_derivative_of_energy(name):
    law, size, _ = CASES[name]
    forces, inputs = stack_law(law)
    x, _, z = sample_points(name)
    functions = np.repeat(inputs.functions, len(x), axis=0)
    _, elastic, by_state = forces.evaluate(x, z, functions)
    h = 1e-6 * size
    for i in range(law.scalars):
        step = h * np.eye(law.scalars)[i]
        far = [forces.evaluate(x + k * step, z, functions)[0].sum(axis=1) for k in (2, 1, -1, -2)]
        found, wide = (far[1] - far[2]) / (2 * h), (far[0] - far[3]) / (4 * h)
        smooth = np.abs(found - wide) < 1e-6 * np.abs(elastic).max()
        np.testing.assert_allclose(elastic[smooth, i], found[smooth], rtol=1e-5, atol=1e-6 * np.abs(elastic).max())
        assert smooth.mean() > 0.8
    if law.states:
        step = h * np.eye(law.states)[0]
        found = (forces.evaluate(x, z + step, functions)[0] - forces.evaluate(x, z - step, functions)[0]).sum(axis=1)
        smooth = np.abs(x[:, 0] - z[:, 0]) > 2 * h
        np.testing.assert_allclose(
            by_state[smooth, 0], found[smooth] / (2 * h), rtol=1e-5, atol=1e-6 * np.abs(by_state).max()
        )


@pytest.mark.parametrize("name", CASES)
def test_dissipated_power_is_never_negative(name):
    """Dissipated power is (f - f_elastic) v, plus the energy rate of an internal state."""
    law, _, _ = CASES[name]
    forces, inputs = stack_law(law)
    for x, v, z in zip(*sample_points(name), strict=True):
        moving, still = forces.respond(x, v, z, inputs), forces.respond(x, 0.0 * v, z, inputs)
        power = float((moving.force - still.force) @ v)
        if law.states:
            _, _, by_state = forces.evaluate(x[None], z[None], inputs.functions)
            power -= float(by_state[0] @ moving.state_rate)
        if law.kind == LEVER_KIND:  # the law excludes the linear spring and damper of the structure
            damping, arm, driven, start = law.constants[1:]
            power += damping * (arm / driven * math.cos(start) * v[0] - v[1]) ** 2
        size = np.abs(moving.force).max() * np.abs(v).max()
        assert power >= -1e-12 * size


@pytest.mark.parametrize("name", CASES)
def test_compiled_and_python_laws_agree(name):
    law, _, _ = CASES[name]
    x, _, z = sample_points(name)
    (python, inputs), (compiled, _) = stack_law(law), stack_law(law, compiled=True)
    functions = np.repeat(inputs.functions, len(x), axis=0)
    for one, other in zip(python.evaluate(x, z, functions), compiled.evaluate(x, z, functions), strict=True):
        # a dozen roundings, which the compiler may reorder
        np.testing.assert_allclose(other, one, rtol=1e-12, atol=1e-13 * np.abs(one).max(initial=0.0))


def chain(law):
    """Return masses on springs, one per scalar of a law, under a constant compressive load."""
    n = law.scalars
    sense = tuple(AngleVector.constant(row) for row in np.eye(n))
    act = tuple(AngleVector.constant(-row) for row in np.eye(n))
    force = LocalForce("force", sense, act, law, (constant(0.0),) * n)
    push = Load("push", np.full(n, 1.0), lambda motion: np.full_like(motion.angle, 50.0), steady=True)
    K = np.diag(np.full(n, 1e5))
    probe = Probe("all", tuple(f"x{i}" for i in range(n)), np.eye(n), (None,) * n)
    matrices = (Triplets.from_dense(one) for one in (np.eye(n), np.diag(np.full(n, 200.0)), K))
    return System(*matrices, tuple(f"x{i}" for i in range(n)), (push,), (force,), (probe,))


@pytest.mark.parametrize("path", ["direct", "kernel"])
@pytest.mark.parametrize(
    "name", ["bilateral", "stop", "hunt-crossley", "line contact", "table", "lever, point", "arch", "lift of a contact"]
)
def test_run_from_static_equilibrium_is_constant(name, path):
    law, _, _ = CASES[name]
    system, drive = chain(law), ConstantSpeed(1e-9)
    start = equilibrium(system, drive)
    response = solve(Problem(system, drive, 1e-4, 50, start, engine=path), newmark())
    assert response.stats.engine == path
    np.testing.assert_allclose(response["all"].displacement, np.tile(start.displacement, (51, 1)).reshape(
        response["all"].displacement.shape), rtol=1e-8, atol=1e-13)  # fmt: skip


def test_section_forces_of_arch_match_law():
    forces, inputs = stack_law(CASES["arch"][0])
    values = sample_points("arch")[0]
    law = [forces.respond(x, 0.0 * x, np.zeros(0), inputs).force for x in values]
    np.testing.assert_allclose(arch().forces(values[:, None])[:, 0], law, rtol=1e-12, atol=1e-12 * np.abs(law).max())


@pytest.mark.parametrize("name", CASES)
def test_direct_and_kernel_engine_agree(name):
    """The direct engine evaluates the laws in Python, the kernel engine in compiled code."""
    law, size, _ = CASES[name]
    system = chain(law)
    start = State(np.full(law.scalars, 0.1 * size), np.full(law.scalars, 0.01))
    runs = [
        solve(Problem(system, ConstantSpeed(30.0), 2e-5, 120, start, engine=path), newmark())
        for path in ("direct", "kernel")
    ]
    one, other = (run["all"].displacement for run in runs)
    # residual tolerance 1e-12 of the forces in every step
    np.testing.assert_allclose(other, one, rtol=0, atol=1e-9 * np.abs(one).max())


def test_table_law_interpolates_and_extrapolates():
    """Also with a row between two others, where the search for the interval must find both sides."""
    travel, force = [-1e-3, 1e-3, 2e-3, 5e-3], [-30.0, 10.0, 40.0, 60.0]
    forces, inputs = stack_law(force_table_law(travel, force))
    far = [-3e-3, *travel, 9e-3]
    found = [float(forces.respond(np.array([x]), np.zeros(1), np.zeros(0), inputs).force[0]) for x in far]
    np.testing.assert_allclose(found, [-70.0, *force, 60.0 + 4e-3 * 20.0 / 3e-3], rtol=1e-14)
    assert float(forces.evaluate(np.zeros((1, 1)), np.zeros((1, 0)), np.zeros((1, 0)))[0][0, 0]) == 0.0


@settings(max_examples=60, deadline=None, derandomize=True)
@given(
    begin=st.floats(-1e-3, 1e-3), travel=st.floats(-1e-3, 1e-3), pieces=st.sampled_from([2, 7]),
    step=st.sampled_from([1e-6, 1e-4, 1e-2]),
)  # fmt: skip
def test_oil_column_is_exact_for_linear_motion(begin, travel, pieces, step):
    """One step of a linear motion gives the same end as several parts of it."""
    k, leak, refill = 2e7, 5e3, 60.0
    end, _, _ = oil_column(begin + travel, begin, 0.0, step, k, leak, refill)
    state, x = 0.0, begin
    for i in range(1, pieces + 1):
        new = begin + travel * i / pieces
        state, x = new - oil_column(new, x, state, step / pieces, k, leak, refill)[0], new
    assert end == pytest.approx(x - state, rel=1e-8, abs=1e-15)


@pytest.mark.parametrize(("begin", "travel"), [(1e-4, 2e-5), (1e-4, -3e-4), (-1e-4, 3e-4), (0.0, 1e-4), (0.0, -1e-4)])
def test_oil_column_derivatives(begin, travel):
    h = 1e-10
    arguments = (begin, 0.0, 1e-4, 2e7, 5e3, 60.0)
    ends = [oil_column(begin + travel + side * h, *arguments)[0] for side in (1, -1)]
    assert oil_column(begin + travel, *arguments)[1] == pytest.approx((ends[0] - ends[1]) / (2 * h), rel=1e-4)
    ends = [oil_column(begin + side * h + travel, begin + side * h, *arguments[1:])[0] for side in (1, -1)]
    # Rounding of 1e-20 in the compression, over the step of the difference.
    found = oil_column(begin + travel, *arguments)[2]
    assert found == pytest.approx((ends[0] - ends[1]) / (2 * h), rel=1e-4, abs=1e-9)


def test_oil_column_does_not_oscillate_in_long_steps():
    """The column follows an extending plunger at once; the trapezoidal rule would oscillate about the solution."""
    state, x = 0.0, 0.0
    for i in range(1, 20):
        new = -1e-6 * i
        pressed, _, _ = oil_column(new, x, state, 0.1, 2e7, 5e4, 60.0)
        state, x = new - pressed, new
        assert -1e-9 < pressed <= 0.0


def test_line_load_is_smooth_at_linear_limit():
    give, rest, limit, depth = 1e-12, 1.4, 1e9, 0.02
    end = give * limit * (2.0 * math.log(depth / (give * limit)) - rest)
    below, above = (line_load(end * (1.0 + side * 1e-9), limit, give, rest, depth) for side in (-1, 1))
    assert below[0] == pytest.approx(above[0], rel=4e-9)
    assert below[1] == pytest.approx(above[1], rel=1e-8)
    assert line_load(end, limit, give, rest, depth)[0] == pytest.approx(limit, rel=1e-14)
