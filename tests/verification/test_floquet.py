"""Floquet multipliers against Mathieu's equation, a parametrically excited damped oscillator, and linear systems.

x'' + (a - 2 q cos 2t) x = 0: M. Abramowitz and I. A. Stegun, Handbook of Mathematical Functions (1964), ch. 20: near a
= 1 the unstable tongue is between a = 1 - q - q^2/8 + q^3/64 and a = 1 + q - q^2/8 - q^3/64 (eq. 20.2.25). The
characteristic exponent is also computed here with solve_ivp at 1e-12.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from flexcam import prepare, read_case
from flexcam.core import Triplets
from flexcam.dynamics import (
    AngleVector,
    ConstantSpeed,
    Load,
    LocalForce,
    Problem,
    Reaction,
    SaveAt,
    State,
    System,
    constant,
    elastic_stop,
    floquet,
    newmark,
    solve,
)
from flexcam.dynamics.engine_selection import select_engine
from flexcam.dynamics.periodic import period_map
from tests.thinning import mostly_slow

SOURCE = "Mathieu's equation"
IMPACTS = "Disturbances through impacts and contacts"
FINGER = "cases/direct-acting/finger.toml"


@dataclass(frozen=True)
class PulsatingLaw:
    q: float

    def respond(self, gap, rate, angle):
        k = -2.0 * self.q * math.cos(2.0 * angle)
        return Reaction(k * gap, np.array([[k]]), np.zeros((1, 1)))


def mathieu_system(a, q, damping=0.0):
    one = Triplets.from_dense([[1.0]])
    row = np.array([1.0])
    force = LocalForce(
        "pulse", (AngleVector.constant(row),), (AngleVector.constant(-row),), PulsatingLaw(q), (constant(0.0),)
    )
    return System(one, one.scale(damping), one.scale(a), ("x",), (), (force,))


def multipliers(a, q, damping=0.0, steps=2000):
    """Return the multipliers over pi, the period of the coefficient."""
    return floquet(Problem(mathieu_system(a, q, damping), ConstantSpeed(1.0), math.pi / steps, steps)).multipliers


def exact_multipliers(a, q, damping=0.0):
    def f(t, y):
        return [y[1], -(a - 2 * q * math.cos(2 * t)) * y[0] - damping * y[1]]

    ends = [solve_ivp(f, (0, math.pi), start, rtol=1e-12, atol=1e-13).y[:, -1] for start in ([1.0, 0.0], [0.0, 1.0])]
    return sorted(np.linalg.eigvals(np.array(ends).T), key=abs, reverse=True)


@pytest.mark.parametrize(
    ("a", "q", "damping"), mostly_slow([(2.5, 0.3, 0.1), (1.0, 0.1, 0.02), (1.0, 0.1, 0.0), (4.0, 1.0, 0.0)], 4)
)
def test_multipliers_of_mathieu_equation(record, a, q, damping):
    found, reference = multipliers(a, q, damping), exact_multipliers(a, q, damping)
    record(source=SOURCE, case=f"a = {a:g}, q = {q:g}, damping {damping:g}", quantity="largest multiplier", unit="1",
           reference=abs(reference[0]), computed=float(abs(found[0])), tolerance=1e-5,
           reason="average acceleration at 2000 steps")  # fmt: skip


@pytest.mark.slow
def test_unstable_tongue_at_one():
    """The period error of 500 steps, h^2/12, shifts the ends by less than 1e-5."""
    q = 0.1
    low, high = 1 - q - q**2 / 8 + q**3 / 64, 1 + q - q**2 / 8 - q**3 / 64
    for a, stable in ((low - 2e-4, True), (low + 2e-4, False), (1.0, False), (high - 2e-4, False), (high + 2e-4, True)):
        assert bool(abs(multipliers(a, q, steps=500)[0]) <= 1.0 + 1e-6) is stable


def test_multipliers_without_pulsation_have_unit_modulus():
    np.testing.assert_allclose(np.abs(multipliers(1.3, 0.0)), 1.0, atol=1e-9)


@pytest.mark.slow
def test_product_of_multipliers_follows_from_damping():
    """By Liouville's formula the determinant is exp(-c T)."""
    found = multipliers(1.7, 0.4, damping=0.2)
    assert abs(np.prod(found)) == pytest.approx(math.exp(-0.2 * math.pi), rel=1e-6)


class LinearLaw:
    """Law f = 3 gamma, independent of the angle."""

    def respond(self, gap, rate, angle):
        return Reaction(3.0 * gap, np.array([[3.0]]), np.zeros((1, 1)))


def test_local_spring_adds_stiffness(record):
    """The stiffness is 1 + 3, so the disturbance turns by 2 rad/s; a tangent of the wrong sign would make it grow."""
    one, row = Triplets.from_dense([[1.0]]), np.array([1.0])
    force = LocalForce(
        "spring", (AngleVector.constant(row),), (AngleVector.constant(-row),), LinearLaw(), (constant(0.0),)
    )
    system = System(one, Triplets.zeros(1), one, ("x",), (), (force,))
    found = floquet(Problem(system, ConstantSpeed(1.0), 0.001, 500)).multipliers
    case = "mass between a spring of 1 and a local one of 3, over 0.5 s"
    record(source=SOURCE, case=case, quantity="turn", unit="rad", reference=1.0, computed=abs(np.angle(found[0])),
           tolerance=1e-6, reason="period error (w dt)^2/12")  # fmt: skip
    assert abs(found[0]) == pytest.approx(1.0, abs=1e-9)


def impact_oscillator(w, e, phase=0.0):
    """Return a mass on a spring of 1 under cos(w t + phase), on a seat at its middle position."""
    one, row = Triplets.from_dense([[1.0]]), np.array([1.0])
    push = Load("drive", np.ones(1), lambda motion: np.cos(motion.angle + phase))
    seat = LocalForce(
        "seat", (AngleVector.constant(-row),), (AngleVector.constant(row),), elastic_stop(1e9), (constant(0.0),), e
    )
    return System(one, Triplets.zeros(1), one, ("x",), (push,), (seat,))


def map_derivative(problem, step):
    """Return the derivative of the map of a period by central differences, inner states after the velocities."""
    n, inner = problem.system.size, problem.start.inner
    state = np.concatenate([problem.start.displacement, problem.start.velocity, [] if inner is None else inner])

    def after(x):
        start = State(x[:n], x[n : 2 * n], problem.start.time, None if inner is None else x[2 * n :])
        done = solve(replace(problem, start=start, engine="direct"), newmark(), save=SaveAt(field_every=problem.steps))
        assert done.status.ok
        return np.concatenate([done.fields.displacement[-1], done.fields.velocity[-1], done.inner])

    units = step[:, None] * np.eye(len(state))
    return np.array([(after(state + unit) - after(state - unit)) / (2.0 * unit.max()) for unit in units]).T


@pytest.mark.slow
def test_impact_oscillator_matches_finite_differences(record):
    """The disturbance changes the times of the impacts."""
    w, steps = 2.6, 1000
    start = State(np.array([0.197423]), np.array([-1.2]))
    problem = Problem(impact_oscillator(w, 0.8), ConstantSpeed(w), 2.0 * math.pi / w / steps, steps, start)
    found = floquet(problem)
    assert found.events >= 1
    exact_values = np.linalg.eigvals(map_derivative(problem, np.full(2, 1e-6)))
    for name, pick in (("largest", np.max), ("smallest", np.min)):
        record(source=IMPACTS, case=f"impact oscillator, {found.events} impacts", quantity=f"{name} multiplier",
               unit="1", reference=float(pick(np.abs(exact_values))), computed=float(pick(np.abs(found.multipliers))),
               tolerance=1e-5, reason="central differences of the map of the run")  # fmt: skip


@pytest.mark.parametrize("e", [0.3, 0.8, 1.0])
def test_impact_oscillator_matches_closed_form(record, e):
    """The orbit has one impact per period of the drive: x'' + x = cos w t with x > 0.

    The velocity is -V before the impact and e V after it; x = 0 at both ends determines the phase. With the matrix F of
    the free motion over T and the saltation matrix S = [[-e, 0], [-(e a- + a+)/V, -e]], S = R_x + (f+ - R f-) g_x/g',
    the multipliers are those of F S: S. W. Shaw and P. J. Holmes, J. Sound Vib. 90 (1983). det F S = e^2.
    """
    w, steps = 2.6, 4000
    T = 2.0 * math.pi / w
    amount = 1.0 / (1.0 - w**2)
    c, s = math.cos(T), math.sin(T)
    # After the impact at t = 0: x = A cos t + B sin t + amount cos(w t + p), x(0) = 0 = x(T), x'(T) = -x'(0)/e. Unknown
    # are A, B, amount cos p, amount sin p up to the scale: three equations, the scale by |amount|.
    rows = np.array([
        [1.0, 0.0, 1.0, 0.0], [c, s, 1.0, 0.0], [-e * s, e * c + 1.0, 0.0, -w * (1.0 + e)],
    ])  # fmt: skip
    A, B, pc, ps = np.linalg.svd(rows)[2][-1]
    sign = math.copysign(1.0, B - w * ps)  # the velocity after the impact is upwards
    A, B, pc, ps = (sign * abs(amount) / math.hypot(pc, ps) * one for one in (A, B, pc, ps))
    phase = math.atan2(ps / amount, pc / amount)
    after = B - w * ps
    times = np.linspace(0.0, T, 2001)[1:-1]
    flight = A * np.cos(times) + B * np.sin(times) + amount * np.cos(w * times + phase)
    assert after > 0.0
    assert flight.min() > 0.0
    force = math.cos(phase)  # acceleration at x = 0, before and after the impact
    V = after / e
    free = np.array([[c, s], [-s, c]])
    jump = np.array([[-e, 0.0], [-(1.0 + e) * force / V, -e]])
    reference = np.linalg.eigvals(free @ jump)
    # The period begins in mid-flight, so that the impact is inside it.
    half = 0.4 * T
    x = A * math.cos(half) + B * math.sin(half) + amount * math.cos(w * half + phase)
    v = -A * math.sin(half) + B * math.cos(half) - w * amount * math.sin(w * half + phase)
    start = State(np.array([x]), np.array([v]))
    found = floquet(Problem(impact_oscillator(w, e, phase + w * half), ConstantSpeed(w), T / steps, steps, start))
    assert found.events == 1
    record(source=IMPACTS, case=f"impact oscillator, one impact per period, e = {e:g}", quantity="largest multiplier",
           unit="1", reference=float(np.abs(reference).max()), computed=float(abs(found.multipliers[0])),
           tolerance=1e-5, reason="average acceleration at 4000 steps")  # fmt: skip
    assert abs(np.prod(found.multipliers)) == pytest.approx(e**2, rel=1e-6)


class Lift:
    """Lift of a moving seat and its derivatives."""

    def __call__(self, angle, order):
        return 0.05 * np.sin(angle + order * math.pi / 2.0)


@pytest.mark.slow
def test_moving_seat_matches_finite_differences():
    """The prescribed motion changes the time of the impact and the approach velocity."""
    w, steps = 2.6, 700
    still = impact_oscillator(w, 0.7)
    seat = replace(still.local_forces[0], offset=(Lift(),))
    start = State(np.array([0.3]), np.array([-0.4]))
    problem = Problem(replace(still, local_forces=(seat,)), ConstantSpeed(w), 2.0 * math.pi / w / steps, steps, start)
    found, differences = floquet(problem), map_derivative(problem, np.full(2, 1e-6))
    assert found.events >= 1
    np.testing.assert_allclose(
        np.sort(np.abs(found.multipliers)), np.sort(np.abs(np.linalg.eigvals(differences))), rtol=1e-6
    )


@pytest.mark.slow
@pytest.mark.parametrize(("speed", "engine"), [
    ("6000rpm", "direct"), ("8500rpm", "direct"), ("8500rpm", "kernel"),
])  # fmt: skip
def test_train_with_adjuster_matches_finite_differences(record, speed, engine):
    """The train has an internal state, a massless lever and contacts that open and close; the direction is random."""
    case = read_case(FINGER, [f"run.crank_speed={speed}", "run.revolutions=1", "run.steps_per_revolution=720"])
    problem = prepare(case).problem
    selected = select_engine(replace(problem, engine=engine), newmark())
    inside = selected.problem
    n = inside.system.size

    def period(state, *, derived):
        start = State(state[:n], state[n : 2 * n], 0.0, state[2 * n :])
        one = replace(selected, problem=replace(inside, start=start))
        return period_map(one, newmark(), lambda: False, derived=derived)

    first = period_map(selected, newmark(), lambda: False, derived=False).end
    found = period(first, derived=True)
    stiff, heavy = (np.sqrt(np.abs(one.diagonal())) for one in (inside.system.stiffness, inside.system.mass))
    weights = np.concatenate([stiff, heavy, [np.sqrt(problem.system.stiffness.diagonal().max())]])
    random = np.random.default_rng(0)
    unit = random.normal(size=2 * n + 1) / np.where(weights > 0.0, weights, np.inf)
    unit *= 1e-6 / np.linalg.norm(weights * unit)

    def after(sign):
        return period(first + sign * unit, derived=False).end

    change, expected = found.derivative @ unit, 0.5 * (after(1.0) - after(-1.0))
    missed = np.linalg.norm(weights * (change - expected)) / np.linalg.norm(weights * expected)
    record(source=IMPACTS, case=f"finger follower with adjuster, {speed}, {engine} engine, {found.events} events",
           quantity="change after a revolution", unit="1", reference=0.0, computed=missed, tolerance=1e-4,
           absolute=True, reason="central differences of the map of the run")  # fmt: skip


def test_unloaded_mass_with_negative_damping_is_unstable():
    """No load excites the second mass, so a run leaves it out; its damping is negative."""
    one, damping = (Triplets.from_dense(np.diag(row)) for row in ([1.0, 1.0], [0.1, -0.1]))
    push = Load("push", np.array([1.0, 0.0]), lambda motion: np.cos(motion.angle))
    system = System(one, damping, one, ("x", "y"), (push,))
    found = floquet(Problem(system, ConstantSpeed(2.0), math.pi / 500, 500, prune=True))
    assert not found.stable()
    assert found.growth == pytest.approx(0.05, rel=1e-3)
    assert found.moving(1) == ["y"]
