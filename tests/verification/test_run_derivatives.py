"""Exact derivatives of runs by parameters: complex step, closed forms with impacts, and differences of runs.

- A linear system: the recursion of the average acceleration in complex numbers, with a step of 1e-30 i in a parameter.
  W. Squire and G. Trapp, SIAM Review 40 (1998) 110.
- A ball that falls on a floor: its height after the impact by initial height, gravity, restitution and mass.
- Valve trains in contact, with an adjuster, and from a periodic state: central differences of full runs, extrapolated.
"""

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from flexcam import prepare, read_case
from flexcam.case.builder import build_model
from flexcam.case.reader import CaseFile
from flexcam.core import Triplets
from flexcam.core.errors import InputError
from flexcam.dynamics import (
    AngleVector,
    ConstantSpeed,
    Load,
    LocalForce,
    Probe,
    Problem,
    State,
    System,
    Variation,
    constant,
    hht,
    newmark,
    solve,
    tangent_run,
)
from flexcam.dynamics.kernel_step import PROGRAM
from flexcam.dynamics.law_data import force_table_law
from flexcam.dynamics.linearization import Linear, LinearStep, StepSequence
from flexcam.studies.evaluation import evaluate
from flexcam.studies.gradients import compute_gradient, make_neighbours
from flexcam.studies.sensitivity import get_numbers

BUCKET = "cases/direct-acting/bucket.toml"
FINGER = "cases/direct-acting/finger.toml"
INTAKE = "cases/pushrod-engine/intake.toml"
DIFFERENCES = "Central differences of runs, extrapolated"


def mean_derivative(found, widths, value):
    """Return the derivative of a scalar result, the mean over some changes of a parameter."""
    pairs = zip(found.neighbours, widths, strict=True)
    return np.mean([(value(high) - value(low)) / width for (low, high), width in pairs], axis=0)


def chain_matrices(p):
    """Return M, C, K and the load of a chain of three masses whose entries are polynomials of p."""
    M = np.diag([1.0, 0.5 + 0.25 * p, 2.0])
    K = np.array([[300.0, -100.0, 0.0], [-100.0, 100.0 + 40.0 * p**2, -40.0 * p**2], [0.0, -40.0 * p**2, 40.0 * p**2]])
    return M, 0.01 * M + 2e-4 * K, K, np.array([0.0, 0.0, 1.0 + p])


def chain_problem(p, engine="direct"):
    M, C, K, load = chain_matrices(p)
    push = Load("push", load, lambda motion: np.sin(3.0 * motion.angle))
    probe = Probe("end", ("x",), np.eye(3)[2:], (None,))
    system_matrices = (Triplets.from_dense(one) for one in (M, C, K))
    system = System(*system_matrices, ("a", "b", "c"), (push,), probes=(probe,))
    return Problem(system, ConstantSpeed(2.0), step=5e-3, steps=1000, engine=engine)


def integrate_complex_step(p):
    """Return the history of the last displacement by the average acceleration, and its derivative by p."""
    M, C, K, load = chain_matrices(p + 1e-30j)
    h, d, v = 5e-3, np.zeros(3, complex), np.zeros(3, complex)
    a, S = np.linalg.solve(M, -C @ v - K @ d), M + 0.5 * h * C + 0.25 * h**2 * K
    found = [d[2]]
    for k in range(1, 1001):
        there, moving = d + h * v + 0.25 * h**2 * a, v + 0.5 * h * a
        a = np.linalg.solve(S, load * np.sin(6.0 * k * h) - C @ moving - K @ there)
        d, v = there + 0.25 * h**2 * a, moving + 0.5 * h * a
        found.append(d[2])
    return np.real(found), np.imag(found) / 1e-30


@pytest.mark.parametrize("engine", ["direct", "modal", "kernel"])
def test_linear_system_matches_complex_step(record, engine):
    p, e = 1.0, 1e-5
    found = tangent_run(
        chain_problem(p, engine), newmark(), [Variation(chain_problem(p + width, engine), width) for width in (-e, e)]
    )
    slopes = mean_derivative(found, (-e, e), lambda one: one["end"].displacement)
    moved, exact = integrate_complex_step(p)
    assert found.response["end"].displacement == pytest.approx(moved, rel=1e-9, abs=1e-12)
    worst = np.abs(slopes - exact).max() / np.abs(exact).max()
    record(source="Complex step", case=f"chain of three masses, {engine} engine",
           quantity="relative error of d(history)/dp", unit="1", reference=0.0, computed=float(worst),
           tolerance=1e-9, absolute=True,
           reason="differences of the matrices over 2e-5: rounding 1e-16/1e-5")  # fmt: skip


BALL_CASE = """
format = 1
nodes = {{ ground = [0.0, -1.0, 0.0], body = [0.0, 0.0, 0.0] }}
supports = {{ body = ["ux", "uz"] }}
output = {{ probes = ["body"] }}
masses.body = {{ at = "body", mass = "2 kg" }}
contacts.floor = {{ at = "body", model = "seat", direction = "uy", stiffness = 1e9, restitution = {e!r} }}
[run]
speed = "1 rad/s"
gravity = [0, {g!r}, 0]
step = {step!r}
revolutions = {turns!r}
start = {{ displacement = {{ "body.uy" = {h!r} }}, velocity = {{ "body.uy" = {v!r} }} }}
"""


def ball_problem(folder, **values):
    given = {"e": 0.8, "g": -9.81, "h": 0.5, "v": -1e-6, "T": 0.7, **values}
    T = given["T"]
    path = folder / "ball.toml"
    path.write_text(BALL_CASE.format(**given, step=T / 1000, turns=T / (2.0 * math.pi)), encoding="utf-8")
    return prepare(read_case(path)).problem


def bounce_height(e=0.8, g=-9.81, h=0.5, v=-1e-6, T=0.7):
    """Return the height at the time T, after one impact."""
    fall = (math.sqrt(v * v - 2.0 * g * h) + v) / -g if g else -h / v
    speed, left = e * math.sqrt(v * v - 2.0 * g * h), T - fall
    return speed * left + 0.5 * g * left**2


@pytest.mark.parametrize("key", ["h", "v", "e", "g"])
@pytest.mark.parametrize("gravity", [-9.81, 0.0])
def test_derivatives_of_ball_after_impact(record, tmp_path, key, gravity):
    fixed = {"g": gravity, "v": -1.5 if gravity == 0.0 else -0.2}
    value = {"h": 0.5, "e": 0.8, **fixed}[key]
    step = 1e-6 * (abs(value) or 1.0)
    sides = [Variation(ball_problem(tmp_path, **{**fixed, key: value + width}), width) for width in (-step, step)]
    found = tangent_run(ball_problem(tmp_path, **fixed), newmark(), sides)
    near = 1e-4 * (abs(value) or 1.0)
    far = [bounce_height(**{**fixed, key: value + k * near}) for k in (-2, -1, 1, 2)]
    reference = (far[0] - 8.0 * far[1] + 8.0 * far[2] - far[3]) / (12.0 * near)
    computed = mean_derivative(found, (-step, step), lambda one: one["body.uy"].displacement[-1])
    record(source="Ball on a floor", case=f"fall from 0.5 m, restitution 0.8, gravity {abs(gravity):g} m/s^2",
           quantity=f"d(height at the end)/d{key}", unit="", reference=reference, computed=computed,
           tolerance=2e-7, reason="the motion is exact; differences over 1e-6 and 1e-4")  # fmt: skip


def test_derivative_of_cam_impacts_matches_differences(record):
    """The lift changes the time of every impact; the reference are differences of runs, half a revolution later."""
    fixed = ["run.speed=3000rpm", "contacts.k.restitution=0.6", "springs.one.installed_force=20 N",
             "springs.one.stiffness=10 kN/m", "run.steps_per_revolution=1440"]  # fmt: skip

    def follower(lift):
        return prepare(read_case("tests/verification/cam-follower.toml", [*fixed, f"cams.c.lift={lift!r}"])).problem

    e = 1e-6 * 0.006
    found = tangent_run(follower(0.006), newmark(), [Variation(follower(0.006 + width), width) for width in (-e, e)])
    assert solve(follower(0.006), newmark()).stats.events > 2
    far = [solve(follower(0.006 + k * 10.0 * e), newmark())["mass.uy"].displacement[-1] for k in (-2, -1, 1, 2)]
    record(source=DIFFERENCES, case="follower struck by its cam, by the lift", quantity="d(displacement at the end)",
           unit="1", reference=float((far[0] - 8.0 * far[1] + 8.0 * far[2] - far[3]) / (120.0 * e)),
           computed=mean_derivative(found, (-e, e), lambda one: one["mass.uy"].displacement[-1]), tolerance=1e-4,
           reason="differences over 1e-5 of the lift")  # fmt: skip


def finite_differences(file, fixed, number, names):
    """Return the derivatives of scalars by differences of runs over two step sizes, extrapolated."""
    slopes = list[np.ndarray]()
    for relative in (1e-4, 5e-5):
        step = relative * abs(number.value)
        low, high = (
            np.array([scalars[name] for name in names])
            for one in make_neighbours(file.read(fixed), number, (-step, step))
            for scalars in (evaluate(file.read((*fixed, *one)), runs=100).scalars,)
        )
        slopes.append((high - low) / (2.0 * step))
    return (4.0 * slopes[1] - slopes[0]) / 3.0


ONE_REVOLUTION = ("run.revolutions=1", "run.steps_per_revolution=1440", "run.integrator.method=newmark")


@pytest.mark.parametrize(
    ("path", "key", "names", "fixed"),
    [
        (BUCKET, "run.crank_speed",
         ("contacts.seat.seating_velocity", "contacts.intake.pressure.largest", "deviation.peak"), ()),
        (BUCKET, "masses.bucket.mass", ("contacts.intake.pressure.largest", "contacts.intake.nose_force.least"), ()),
        pytest.param(INTAKE, "springs.valve.stiffness",
                     ("contacts.intake.nose_force.least", "contacts.seat.seating_velocity"), (),
                     marks=pytest.mark.slow),
        (FINGER, "contacts.adjuster.leak",
         ("contacts.adjuster.leak_down.largest", "contacts.intake.force.largest"), ()),
        (FINGER, "run.crank_speed", ("contacts.adjuster.force.largest", "contacts.seat.seating_velocity"),
         ("run.start=periodic",)),
    ],
    ids=["speed", "extremes", "spring", "adjuster", "periodic"],
)  # fmt: skip
def test_trains_in_contact_match_differences(record, path, key, names, fixed):
    file, fixed = CaseFile.open(Path(path)), (*ONE_REVOLUTION, "run.engine=kernel", *fixed)
    (number,) = get_numbers(file.read(fixed), [key])
    found = compute_gradient(file.read(fixed), names, [number])
    start = ", periodic" if "run.start=periodic" in fixed else ""
    for name, reference in zip(names, finite_differences(file, fixed, number, names), strict=True):
        record(source=DIFFERENCES, case=f"{Path(path).stem}, by {key}{start}",
               quantity=f"d({name})", unit="", reference=reference,
               computed=found.derivatives[name, key], tolerance=2e-5,
               reason="differences of contact runs over 1e-4 contain the noise of events")  # fmt: skip


@pytest.mark.slow
def test_second_local_maximum_matches_differences(record):
    """The second highest local maximum of the cam force has a value and a derivative at a constant instant."""
    file, fixed = CaseFile.open(Path(BUCKET)), (*ONE_REVOLUTION, "run.engine=kernel")
    name, case = "contacts.intake.force.largest", file.read(fixed)
    (number,) = get_numbers(case, ["masses.bucket.mass"])
    offset, mean_derivative = compute_gradient(case, [name], [number]).extremes[name][0]

    def force(*overrides):
        ready = prepare(file.read((*fixed, *overrides)))
        return solve(ready.problem, ready.scheme).channels["contacts.intake.force"]

    history, step = force(), 1e-4 * number.value
    at = int(np.argmin(np.abs(history - history.max() - offset)))
    assert history[at] - history.max() == pytest.approx(offset, rel=1e-6)
    low, high = (force(*one)[at] for one in make_neighbours(case, number, (-step, step)))
    record(source=DIFFERENCES, case="bucket, by masses.bucket.mass", quantity="d(second largest maximum of the force)",
           unit="N/kg", reference=float(high - low) / (2.0 * step), computed=mean_derivative, tolerance=1e-4,
           reason="differences over 1e-4")  # fmt: skip


def test_derivative_is_independent_of_step_size():
    """The equilibria of a case and of its neighbour use equal iterations; otherwise the tolerance shows, here 7e-6."""
    case = CaseFile.open(Path(BUCKET)).read((*ONE_REVOLUTION, "run.engine=kernel"))
    name = "contacts.intake.pressure.largest"
    (number,) = get_numbers(case, ["masses.bucket.mass"])
    small, large = (
        compute_gradient(case, [name], [number], [size * number.value]).derivatives[name, number.key]
        for size in (1.0, 10.0)
    )
    assert small == pytest.approx(large, rel=1e-6)


@pytest.mark.slow
def test_growth_indicates_chaotic_motion():
    """In three revolutions the pushrod train bounces on the base circle: neighbouring motions diverge exponentially."""
    file = CaseFile.open(Path(INTAKE))
    numbers = get_numbers(file.read(), ["springs.valve.stiffness"])
    calm, wild = (
        compute_gradient(file.read((f"run.revolutions={n}", "run.steps_per_revolution=720", "run.engine=kernel")),
                         ["contacts.seat.seating_velocity"], numbers).growth
        for n in (1, 3)
    )  # fmt: skip
    assert calm < 100.0
    assert wild > 1e5


def test_other_methods_and_structures_raise_error(tmp_path):
    problem = chain_problem(1.0)
    with pytest.raises(InputError, match="newmark with beta 1/4"):
        tangent_run(problem, hht(alpha=-0.1), [])
    shorter = replace(problem, steps=999)
    with pytest.raises(InputError, match="unknowns, contacts or steps"):
        tangent_run(problem, newmark(), [Variation(shorter, 1.0)])
    start = State(np.zeros(3), np.ones(3))
    moved = tangent_run(problem, newmark(), [Variation(replace(problem, start=start), 1.0)])
    low, high = moved.neighbours[0]
    assert (high["end"].velocity - low["end"].velocity)[0] == pytest.approx(1.0, rel=1e-12)


def test_linearized_steps_satisfy_equations():
    """A random system with local forces and an internal state satisfies the dense equations of a step, to rounding."""
    rng, n, c, m, h = np.random.default_rng(3), 4, 3, 5, 1e-3
    A = rng.normal(size=(n, n))
    M, C, K = A @ A.T + np.eye(n), 0.1 * A @ A.T, 1e4 * np.eye(n)
    system = System(*(Triplets.from_dense(matrix) for matrix in (M, C, K)), tuple("abcd"))
    linear = Linear(
        act=rng.normal(size=(m, c, n)), by_d=1e3 * rng.normal(size=(m, c, n)), by_v=rng.normal(size=(m, c, n)),
        by_state=1e3 * rng.normal(size=(m, c, 1)), followed=rng.normal(size=(m, 1, n)),
        by_penetration=np.zeros((m, c, c)), by_rate=np.zeros((m, c, c)),
    )  # fmt: skip
    T, B = rng.random((2, m - 1, 1))
    sequence = StepSequence(LinearStep(system), h, linear, T, B)
    state, more = rng.normal(size=(2 * n + 1, 2)), rng.normal(size=(m - 1, 2 * n + 1, 2))
    force = [
        np.hstack([act.T @ by_d - K, act.T @ by_v - C, act.T @ by_state])
        for act, by_d, by_v, by_state in zip(linear.act, linear.by_d, linear.by_v, linear.by_state, strict=True)
    ]
    I, none = np.eye(n), np.zeros((n, 1))
    for i in range(m - 1):
        new = np.vstack(
            [
                np.hstack([I, -0.5 * h * I, none]),
                np.hstack([0.0 * I, M, none]) - 0.5 * h * force[i + 1],
                np.hstack([-(1.0 - T[i]) * linear.followed[i + 1], 0.0 * none.T, np.eye(1)]),
            ]
        )
        old = np.vstack(
            [
                np.hstack([I, 0.5 * h * I, none]),
                np.hstack([0.0 * I, M, none]) + 0.5 * h * force[i],
                np.hstack([(T[i] - B[i]) * linear.followed[i], 0.0 * none.T, B[i] * np.eye(1)]),
            ]
        )
        # An increment of the free displacement also changes the forces at the new end.
        expected = np.linalg.solve(new, old @ state + more[i])
        state = sequence.propagate(i, state, more[i])
        assert state == pytest.approx(expected, rel=1e-9, abs=1e-9)


def test_compiled_steps_match_numpy():
    """The modes are coupled by a damper, with local forces and two internal states; the difference is rounding."""
    rng, n, c, s, m, h = np.random.default_rng(5), 5, 3, 2, 6, 1e-3
    A = rng.normal(size=(n, n))
    M, K = np.diag(1.0 + rng.random(n)), np.diag(1e4 * rng.random(n))
    system = System(*(Triplets.from_dense(matrix) for matrix in (M, 10.0 * A @ A.T, K)), tuple("abcde"))
    linear = Linear(
        act=rng.normal(size=(m, c, n)), by_d=1e3 * rng.normal(size=(m, c, n)), by_v=rng.normal(size=(m, c, n)),
        by_state=1e3 * rng.normal(size=(m, c, s)), followed=rng.normal(size=(m, s, n)),
        by_penetration=np.zeros((m, c, c)), by_rate=np.zeros((m, c, c)),
    )  # fmt: skip
    T, B = rng.random((2, m - 1, s))
    state, more = rng.normal(size=(2 * n + s, 4)), rng.normal(size=(m - 1, 2 * n + s, 4))
    stepper = LinearStep(system)
    compiled, plain = (
        StepSequence(stepper, h, linear, T, B, functions).propagate_all(state, more)
        for functions in (PROGRAM.compile(), None)
    )
    assert compiled == pytest.approx(plain, rel=1e-11, abs=1e-11)


@pytest.mark.parametrize("engine", ["direct", "kernel"])
def test_derivative_by_constant_force(engine):
    """For a constant force F of a table on an oscillator, d(displacement)/dF = (1 - cos(omega t))/k."""

    def oscillator(F):
        one, row = Triplets.from_dense([[1.0]]), AngleVector.constant(np.ones(1))
        law = force_table_law([-1.0, 1.0], [F, F])
        push = LocalForce("push", (row,), (row,), law, (constant(0.0),))
        probe = Probe("x", ("x",), np.eye(1), (None,))
        system = System(one, Triplets.zeros(1), one.scale(4.0), ("x",), (), (push,), (probe,))
        return Problem(system, ConstantSpeed(1.0), step=1e-3, steps=1000, engine=engine)

    found = tangent_run(oscillator(0.3), newmark(), [Variation(oscillator(0.301), 0.001)])
    low, high = (one["x"].displacement[-1] for one in found.neighbours[0])
    assert (high - low) / 0.001 == pytest.approx(0.25 * (1.0 - math.cos(2.0)), rel=1e-6)


def test_similar_models_share_only_equal_lift_events():
    case = read_case(INTAKE)
    model = build_model(case)
    same, other = (
        build_model(case.replace({key: value})).cams["intake"]
        for key, value in (("masses.valve.mass", 0.1), ("cams.intake.lift", 0.0061))
    )
    assert same.event is model.cams["intake"].event
    assert other.event.height > same.event.height


def test_cams_of_a_shaft_have_one_phaser(tmp_path):
    text = Path("flexcam/templates/cam-phaser.toml").read_text(encoding="utf-8")
    text = text.replace('cams = ["intake"]', 'cams = ["intake", "second"]')
    at = '{ at = "rear-intake", law = "4-5-6-7", lift = "6 mm", rise = "64 deg", return = "64 deg", phase = 0 }'
    (tmp_path / "two.toml").write_text(
        text.replace("[cams.intake]", f"[cams]\nsecond = {at}\n\n[cams.intake]"), encoding="utf-8"
    )
    case = read_case(tmp_path / "two.toml")
    varied = build_model(case.replace({"cams.second.lift": 0.007})).cams
    assert varied["second"].phaser is varied["intake"].phaser
