"""Exponential collocation: exact without contacts, fourth order with them, against closed forms and DOP853."""

import math

import numpy as np
import pytest

from flexcam import InputError, read_case, run
from flexcam.core import Triplets
from flexcam.dynamics import (
    AngleVector,
    ConstantSpeed,
    Load,
    LocalForce,
    Probe,
    Problem,
    State,
    System,
    collocation,
    constant,
    dop853,
    elastic_stop,
    hunt_crossley_contact,
    newmark,
    solve,
)
from tests.thinning import mostly_slow

SOURCE = "Hochbruck and Ostermann (2010), exponential collocation"
STIFFNESS, PUSH = 2e4, np.array([20.0, 0.0, 100.0])
BUCKET = "cases/direct-acting/bucket.toml"


def preloaded_chain():
    """Return three masses in equilibrium, with dampers that couple the modes and a contact that stays closed."""
    K, C = np.array([[5.0, -2, 0], [-2, 6, -4], [0, -4, 4]]) * 1e3, np.array([[3.0, -3, 0], [-3, 3, 0], [0, 0, 0.5]])
    one = (AngleVector(np.eye(3)[2:], ()),)
    law = hunt_crossley_contact(STIFFNESS, 0.4)
    contact = LocalForce("contact", one, (AngleVector(-np.eye(3)[2:], ()),), law, (constant(0.0),))
    load = Load("push", PUSH, lambda motion: 1.0 + 0.05 * np.sin(motion.angle))
    probe = Probe("all", ("a", "b", "c"), np.eye(3), (None,) * 3)
    matrices = (Triplets.from_dense(one) for one in (np.diag([1.0, 0.5, 0.2]), C, K))
    rest = np.linalg.solve(K + np.diag([0.0, 0.0, STIFFNESS]), PUSH)
    return System(*matrices, ("a", "b", "c"), (load,), (contact,), (probe,)), State(rest, np.zeros(3))


def displacement_history(system, method, steps, time=0.5, start=None):
    response = solve(Problem(system, ConstantSpeed(30.0), time / steps, steps, start), method)
    assert response.status.ok, str(response.status)
    return response["all"].displacement


def test_parabolic_load_is_integrated_exactly(record):
    """Under p = 3 + 4 t + 5 t^2 the oscillator x'' + w^2 x = p has the particular solution p/w^2 - 10/w^4."""
    w, steps = 7.0, 6
    load = Load("push", np.ones(1), lambda motion: 3.0 + 4.0 * motion.angle + 5.0 * motion.angle**2)
    probe = Probe("all", ("x",), np.eye(1), (None,))
    matrices = (Triplets.from_dense(np.array([[one]])) for one in (1.0, 0.0, w**2))
    system = System(*matrices, ("x",), (load,), (), (probe,))
    response = solve(Problem(system, ConstantSpeed(1.0), 2.0 / steps, steps), collocation())
    t = response.time
    particular = (3.0 + 4.0 * t + 5.0 * t**2) / w**2 - 10.0 / w**4
    exact = particular - (3.0 / w**2 - 10.0 / w**4) * np.cos(w * t) - 4.0 / w**3 * np.sin(w * t)
    np.testing.assert_allclose(response["all"].displacement, exact, rtol=1e-13, atol=1e-15)
    record(source=SOURCE, case="oscillator under a parabolic load, 2.3 rad per step", quantity="displacement, 2 s",
           unit="m", reference=exact[-1], computed=response["all"].displacement[-1], tolerance=1e-13,
           reason="exact for parabolic loads; rounding")  # fmt: skip


def mass_on_a_contact(stiffness, *, mass=1.0, spring=0.0, damper=0.0):
    """Return a mass, or a massless point, on a contact that stays closed, with a spring and damper to ground."""
    one = (AngleVector(np.eye(1), ()),)
    law, reaction = hunt_crossley_contact(stiffness, 0.0), (AngleVector(-np.eye(1), ()),)
    contact = LocalForce("contact", one, reaction, law, (constant(1.0),))
    load = Load("push", np.array([stiffness]), lambda motion: np.ones_like(motion.angle))
    matrices = (Triplets.from_dense(np.array([[value]])) for value in (mass, damper, spring))
    return System(*matrices, ("x",), (load,), (contact,), (Probe("all", ("x",), np.eye(1), (None,)),))


@pytest.mark.parametrize("ratio", [0.9, 1.6, 5.0, 60.0])
def test_closed_contact_is_stable_for_any_step(ratio):
    """A mass on a contact alone oscillates; undivided steps above omega dt = 1.55 would let the amplitude grow."""
    start = State(np.array([1e-3]), np.zeros(1))
    moved = displacement_history(mass_on_a_contact(1.0), collocation(), 200, time=200 * ratio, start=start)
    assert np.abs(moved).max() < 1.02e-3
    assert np.abs(moved[-40:]).max() > 0.8e-3


def test_run_stops_if_contact_is_too_stiff():
    problem = Problem(mass_on_a_contact(1.0), ConstantSpeed(30.0), 100.0, 10, State(np.array([1e-3]), np.zeros(1)))
    response = solve(problem, collocation())
    assert response.status.cause.value == "no-convergence"
    assert "too stiff for the collocation" in str(response.status)
    assert "newmark" in str(response.status)


@pytest.mark.parametrize("damper", [0.0, 1.0])
def test_contact_of_massless_point_does_not_divide_steps(damper):
    """Spring and damper of the point determine its motion, so no frequency limits the step."""
    system = mass_on_a_contact(100.0, mass=0.0, spring=1.0, damper=damper)
    response = solve(Problem(system, ConstantSpeed(30.0), 1.0, 50), collocation())
    assert response.status.ok
    assert response.stats.iterations <= 2 * 50
    np.testing.assert_allclose(response["all"].displacement, 0.0, atol=1e-12)


@pytest.mark.parametrize(
    ("steps", "change"), mostly_slow([(360, ()), (900, ()), (3600, ("contacts.seat.restitution=0.3",)), (3600, ())], 2)
)
def test_contact_force_of_bouncing_tappet(steps, change):
    """The pushrod engine runs over its lift; the errors of Newmark's method are 42 %, 39 % and 20 %.

    Without the division of steps in which a contact opens or closes the error is 2.7 %, with it 0.2 %.
    """
    words = ("run.revolutions=0.5", "run.integrator.method=collocation", *change)
    found, fine = (
        run(read_case("cases/pushrod-engine/intake.toml", [*words, f"run.steps_per_revolution={count}"])).channels[
            "contacts.intake.force"
        ]
        for count in (steps, 14400)
    )
    fine = fine[:: 14400 // steps]
    assert np.sqrt(np.mean((found - fine) ** 2) / np.mean(fine**2)) < 0.004


def test_massless_motion_is_exact(record):
    """Massless motion has an exact solution under p = 3 + 4 t + 5 t^2: c x' + k x = p from rest, and k y = p.

    x decays to the particular solution A + B t + C t^2 with C = 5/k, B = (4 - 2 c C)/k and A = (3 - c B)/k; y follows p
    without delay.
    """
    c, k, stiff, steps = 2.0, 5.0, 3.0, 6
    load = Load("push", np.ones(2), lambda motion: 3.0 + 4.0 * motion.angle + 5.0 * motion.angle**2)
    probe = Probe("all", ("x", "y"), np.eye(2), (None,) * 2)
    matrices = (Triplets.from_dense(np.diag(one)) for one in ([0.0, 0.0], [c, 0.0], [k, stiff]))
    system = System(*matrices, ("x", "y"), (load,), (), (probe,))
    response = solve(Problem(system, ConstantSpeed(1.0), 2.0 / steps, steps), collocation())
    t, found = response.time, response["all"]
    C = 5.0 / k
    B = (4.0 - 2.0 * c * C) / k
    A = (3.0 - c * B) / k
    rest = (3.0 / k - A) * np.exp(-k / c * t)
    x, y = A + B * t + C * t**2 + rest, (3.0 + 4.0 * t + 5.0 * t**2) / stiff
    np.testing.assert_allclose(found.displacement, np.column_stack([x, y]), rtol=1e-13)
    velocity = np.column_stack([B + 2.0 * C * t - k / c * rest, (4.0 + 10.0 * t) / stiff])
    np.testing.assert_allclose(found.velocity[1:], velocity[1:], rtol=1e-12)
    acceleration = np.column_stack([2.0 * C + (k / c) ** 2 * rest, np.full(len(t), 10.0 / stiff)])
    np.testing.assert_allclose(found.acceleration[1:], acceleration[1:], rtol=1e-12)
    record(source=SOURCE, case="damper and spring without mass, parabolic load", quantity="displacement, 2 s",
           unit="m", reference=x[-1], computed=found.displacement[-1, 0], tolerance=1e-13,
           reason="exact for parabolic loads; rounding")  # fmt: skip


def test_oil_column_of_hydraulic_adjuster():
    """Force and leak-down over a lift of the finger train match Newmark's method with 32 times as many steps."""

    def channels(method, steps):
        words = ("run.revolutions=0.75", f"run.integrator.method={method}", f"run.steps_per_revolution={steps}")
        return run(read_case("cases/direct-acting/finger.toml", words)).channels

    coarse, fine = channels("collocation", 1440), channels("newmark", 46080)
    for name in ("contacts.adjuster.force", "contacts.adjuster.leak_down"):
        exact = fine[name][::32]
        assert np.abs(coarse[name] - exact).max() < 2e-4 * np.ptp(exact), name


def test_fourth_order_with_closed_contact(record):
    """Hunt-Crossley contact with coupled modes, against DOP853; half the step reduces the error to a sixteenth."""
    system, start = preloaded_chain()
    exact = displacement_history(system, dop853(tolerance=1e-12), 20, start=start)
    size = np.ptp(exact, axis=0).max()
    errors = [
        np.abs(displacement_history(system, collocation(), steps, start=start)[:: steps // 20] - exact).max() / size
        for steps in (320, 640)
    ]
    assert errors[1] < 1e-6
    order = math.log2(errors[0] / errors[1])
    record(source=SOURCE, case="three masses on a closed contact, coupled damping", quantity="order of convergence",
           unit="1", reference=4.0, computed=order, tolerance=0.1, reason="the next term of the error")  # fmt: skip
    second = np.abs(displacement_history(system, newmark(), 640, start=start)[::32] - exact).max() / size
    assert second > 1000.0 * errors[1]


@pytest.mark.slow
def test_fourth_order_of_flexible_train_with_contacts():
    """The error of the bucket train with contacts has fourth order before the first closing of a contact."""
    words = ("run.revolutions=0.4", "run.integrator.method=collocation")
    force = {
        steps: run(read_case(BUCKET, [*words, f"run.steps_per_revolution={steps}"])).channels["contacts.intake.force"]
        for steps in (2880, 5760, 23040)
    }
    fine = force[23040]
    coarse, middle = (
        np.sqrt(np.mean((force[steps] - fine[:: 23040 // steps]) ** 2)) / np.sqrt(np.mean(fine**2))
        for steps in (2880, 5760)
    )
    assert coarse < 1e-4  # the average acceleration method: 2e-3
    assert coarse > 10.0 * middle


@pytest.fixture
def ball():
    """Return a ball under constant force above the ground, e = 0.8."""
    one = Triplets.from_dense(np.eye(1))
    none = Triplets.zeros(1)
    ground = LocalForce(
        "ground",
        (AngleVector(-np.eye(1), ()),),
        (AngleVector(np.eye(1), ()),),
        elastic_stop(1e9),
        (constant(0.0),),
        0.8,
    )
    load = Load("weight", -9.81 * np.ones(1), lambda motion: np.ones_like(motion.angle))
    return System(one, none, none, ("x",), (load,), (ground,), (Probe("all", ("x",), np.eye(1), (None,)),))


def test_bounce_height_with_restitution(record, ball):
    """A ball under constant force bounces to e^2 of its height; flight is exact, and impacts are located."""
    fall = math.sqrt(2.0 / 9.81)
    end = fall * (1.0 + 0.8 * 2.0 + 0.8**2)  # at the top of the second bounce
    height = displacement_history(ball, collocation(), 101, end, State(np.ones(1), np.zeros(1)))
    record(source="Contact and springs, closed-form solutions", case="ball, e = 0.8, collocation",
           quantity="height of the second bounce", unit="m",
           reference=0.8**4, computed=height[-1], tolerance=1e-9, reason="location of the impacts")  # fmt: skip


def test_impacts_within_a_step_that_begins_at_rest(ball):
    """The ball falls from rest and lands three times within the first step: its ends and rates show no impact."""
    step, start = 0.005, 6.3e-6
    landing, speed = math.sqrt(2.0 * start / 9.81), math.sqrt(2.0 * start * 9.81)
    for _ in range(2):
        speed *= 0.8
        landing += 2.0 * speed / 9.81
    after = step - landing
    exact = 0.8 * speed * after - 0.5 * 9.81 * after**2
    assert 0.0 < exact < start
    height = displacement_history(ball, collocation(), 2, 2.0 * step, State(np.array([start]), np.zeros(1)))
    assert height[1] == pytest.approx(exact, abs=1e-10)  # impacts to 1e-9 of a step; flight is exact


def test_energy_balance_with_short_contacts():
    """The bouncing tappet loses energy in contacts of a few steps; the mean force would misplace 1.7 % of the work."""
    words = ("run.revolutions=0.3", "run.steps_per_revolution=2880", "run.integrator.method=collocation")
    channels = run(read_case("cases/pushrod-engine/intake.toml", words)).channels
    work = channels["energy.work"][-1]
    assert abs(channels["energy.numerical"][-1]) < 3e-3 * work
    assert np.abs(channels["energy.residual"]).max() < 2e-3 * work


@pytest.mark.slow
def test_saved_output_does_not_change_result():
    """The steps of one run are divided from a certain step on, those of the other are not."""
    words = ("run.revolutions=0.3", "run.integrator.method=collocation")
    found = [
        [
            run(read_case(BUCKET, [*words, f"run.steps_per_revolution={steps}", f"output.field_every={every}"]))
            .channels["contacts.intake.force"]
            for every in (1, 7, 50)
        ]
        for steps in (130, 1000)
    ]  # fmt: skip
    for first, *others in found:
        for one in others:
            np.testing.assert_allclose(one, first, rtol=1e-8, atol=1e-6)


@pytest.mark.parametrize(
    ("override", "remedy"),
    [
        ("run.engine=direct", "engine"),
        ("run.engine=modal", "engine"),
        ("run.adaptive={ tolerance = 1e-6 }", "adaptive"),
    ],
)
def test_incompatible_options_raise_error(override, remedy):
    with pytest.raises(InputError, match=rf"method = collocation.*Remove {remedy}"):
        read_case(BUCKET, [override, "run.integrator.method=collocation"])
