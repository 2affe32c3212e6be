"""Zero and excessive damping, and jumps of the parabolic law between steps: one unknown, closed-form solutions.

- x'' + 2 z w x' + w^2 x = 0 with w = 1: for z > 1 the sum of exp(-t/(z + q)) and exp(-(z + q) t), q = sqrt(z^2 - 1).
- A force jumps by J within a step, but average acceleration has it in the middle of the step: the impulse is wrong by
  J dt (1/2 - part), where part is the position of the jump within the step. The free motion after it is wrong by that
  over (m w). The acceleration of the parabolic law jumps by 8 h/T^2 in its middle.
- The same law as a motion (y'' + w^2 y = w^2 s) has no jump in its force and stays of second order for all positions.
"""

import math
import re

import numpy as np
import pytest

from flexcam.cams import LAWS, LiftEvent
from flexcam.case.input_checks import check_overshoot
from flexcam.dynamics import ConstantSpeed, Problem, State, newmark, solve
from tests.integrators import WITH_CONTACTS

DAMPED, JUMPS = "damping", "jumps of the parabolic law"
END, COUNT = 10.0, 1000


def decay(ratio, t, velocity):
    """Return x(t) from x = 1 and a velocity."""
    if ratio < 1.0:
        w = math.sqrt(1.0 - ratio**2)
        return np.exp(-ratio * t) * (np.cos(w * t) + (velocity + ratio) / w * np.sin(w * t))
    if ratio == 1.0:
        return (1.0 + (velocity + 1.0) * t) * np.exp(-t)
    fast = ratio + math.sqrt(ratio**2 - 1.0)
    slow = 1.0 / fast  # their product is 1; the difference would lose digits
    part = (velocity + fast) / (fast - slow)
    return part * np.exp(-slow * t) + (1.0 - part) * np.exp(-fast * t)


@pytest.fixture
def make_oscillator(system_of):
    """Return a function that makes an oscillator with initial displacement 1 and an initial velocity."""

    def make(ratio, velocity):
        system = system_of([[1.0]], [[2.0 * ratio]], [[1.0]])
        return Problem(system, ConstantSpeed(1.0), END / COUNT, COUNT, State(np.ones(1), np.array([velocity])))

    return make


@pytest.fixture
def max_deviation(make_oscillator):
    """Return a function that computes the maximum deviation from the closed form."""

    def run(scheme, ratio, velocity):
        response = solve(make_oscillator(ratio, velocity), scheme)
        assert response.status.ok
        return float(np.abs(response["all"].displacement - decay(ratio, response.time, velocity)).max())

    return run


@pytest.mark.parametrize("ratio", [0.0, 1.0, 2.0, 10.0])
@pytest.mark.parametrize("name", WITH_CONTACTS)
def test_resolved_damping_matches_closed_form(expect, max_deviation, name, ratio):
    # Period error at most (w dt)^2/5 over 10 rad times an amplitude of sqrt 2; for z = 10 also the fast rate 20:
    # (20 dt)^2/5 of its contribution, 1/20.
    allowed = (END / COUNT) ** 2 / 5.0 * END * math.sqrt(2.0) + (2.0 * ratio * END / COUNT) ** 2 / 5.0 / 20.0
    expect.right(DAMPED, f"{name}, damping ratio {ratio:g}, struck", what="off the closed form by", reference=0.0,
                 computed=max_deviation(WITH_CONTACTS[name], ratio, 1.0), tolerance=allowed, absolute=True)  # fmt: skip


@pytest.mark.parametrize("ratio", [1e3, 1e6])
@pytest.mark.parametrize("name", ["Newmark", "Bathe"])
def test_unresolved_damping_after_impact_is_bounded(expect, max_deviation, name, ratio):
    """The fast part, 1/(2 z) of the motion after the impact, decays within a step; the remaining error is no larger."""
    expect.right(DAMPED, f"{name}, damping ratio {ratio:g}, struck", what="off the closed form by",
                 reference=0.0, computed=max_deviation(WITH_CONTACTS[name], ratio, 1.0), tolerance=1.0 / (2.0 * ratio),
                 absolute=True)  # fmt: skip


@pytest.mark.parametrize("name", WITH_CONTACTS)
def test_overdamped_release_from_rest_is_bounded(expect, max_deviation, name):
    """The velocity reaches 1/(2 z) within the first step, and the error of a dissipative scheme is of that size."""
    ratio = 1e6
    expect.right(DAMPED, f"{name}, damping ratio {ratio:g}, let go at rest", what="off the closed form by",
                 reference=0.0, computed=max_deviation(WITH_CONTACTS[name], ratio, 0.0), tolerance=1.2 / (2.0 * ratio),
                 absolute=True)  # fmt: skip


@pytest.mark.parametrize("name", ["HHT -0.1", "generalized-alpha 0.8"])
def test_overshoot_of_dissipative_scheme_gives_warning(expect, max_deviation, make_oscillator, name):
    """The overshoot is (1/2 - beta/gamma) dt^2 a0 with a0 = -(2 z v0 + x0); the warning gives it."""
    scheme = WITH_CONTACTS[name]
    size = abs(0.5 - scheme.beta / scheme.gamma) * (END / COUNT) ** 2 * (2e6 + 1.0)
    assert max_deviation(scheme, 1e6, 1.0) == pytest.approx(size, rel=0.02)
    (warning,) = check_overshoot(make_oscillator(1e6, 1.0), scheme)
    assert float(re.search(r"by ([\d.]+) %", warning)[1]) == pytest.approx(100.0 * size, rel=0.01)
    expect.warns(DAMPED, f"{name}, damping ratio 1e+06, struck", warning, r"overshoots", r"\d %", "bathe")


@pytest.mark.parametrize("name", WITH_CONTACTS)
def test_resolved_damping_gives_no_overshoot_warning(make_oscillator, name):
    assert not [*check_overshoot(make_oscillator(10.0, 1.0), WITH_CONTACTS[name])]


RISE = 1.0
OMEGA = 2.0 * math.pi * 1.3
EVENT = LiftEvent(LAWS["parabolic"], 1.0, rise=RISE, dwell=4.0, fall=1.0)
PARTS = {"on a step": 0.0, "just before a step": 1.0 - 1e-3, "just after a step": 1e-3, "a quarter into a step": 0.25}


def exact_response(t):
    """Return y(t) of y'' + w^2 y = -s'' from rest: s'' is 4, from the middle of the rise -4, then zero."""
    bumps = ((0.0, -4.0), (0.5 * RISE, 8.0), (RISE, -4.0))
    return sum(size * (1.0 - np.cos(OMEGA * np.maximum(t - at, 0.0))) / OMEGA**2 for at, size in bumps)


def step_size(per_rise, part):
    """Return a step size so that half a rise is half of `per_rise` steps and a fraction of a step."""
    return 0.5 * RISE / (0.5 * per_rise + part)


def solve_through_rise(system_of, order, per_rise, part):
    """Return time and displacement up to a time well within the dwell."""
    load = ([1.0], lambda m: -EVENT(m.angle, 2)) if order == 2 else ([OMEGA**2], lambda m: EVENT(m.angle, 0))
    system = system_of([[1.0]], [[0.0]], [[OMEGA**2]], [load])
    step = step_size(per_rise, part)
    response = solve(Problem(system, ConstantSpeed(1.0), step, round(1.7 / step)), newmark())
    return response.time, response["all"].displacement


@pytest.mark.parametrize("place", PARTS)
def test_jump_of_inertia_force_gives_first_order_error(expect, system_of, fitted_order, place):
    counts = np.array([400, 800, 1600, 3200])
    errors = []
    for per_rise in counts.tolist():
        time, y = solve_through_rise(system_of, 2, per_rise, PARTS[place])
        errors.append(float(np.abs(y - exact_response(time)).max()))
    step = step_size(int(counts[-1]), PARTS[place])
    expect.right(JUMPS, f"as a force, the jump {place}", what="order of the error", reference=1.0, absolute=True,
                 computed=fitted_order(1.0 / counts, errors), tolerance=0.1)  # fmt: skip
    # Each jump J at t_j adds J dt (1/2 - part_j) sin(w (t - t_j))/w.
    time, y = solve_through_rise(system_of, 2, int(counts[-1]), PARTS[place])
    theory = sum(size * step * jump_lead(at, step) * np.sin(OMEGA * np.maximum(time - at, 0.0)) / OMEGA
                 for at, size in ((0.0, -4.0), (0.5 * RISE, 8.0), (RISE, -4.0)))  # fmt: skip
    off = float(np.abs(y - exact_response(time) - theory).max())
    # The remainder is of second order: the period error over 1.7 s, and the step of a jump itself, J dt^2.
    left = OMEGA * 1.7 * (OMEGA * step) ** 2 / 12.0 + 8.0 * step**2
    expect.right(JUMPS, f"as a force, the jump {place}", what="error off J dt (1/2 - part)/w by", reference=0.0,
                 computed=off, tolerance=left, absolute=True)  # fmt: skip


def jump_lead(at, step):
    """Return the fraction of a step by which the jump acts too early; the initial force acts from the start."""
    if at == 0.0:
        return 0.0
    place = at / step
    part = place - math.floor(place + 1e-9)
    return 0.5 if part < 1e-9 else part - 0.5


@pytest.mark.parametrize("place", PARTS)
def test_jump_of_lift_acceleration_keeps_second_order(expect, system_of, fitted_order, place):
    counts = np.array([100, 200, 400, 800])
    errors = []
    for per_rise in counts.tolist():
        time, y = solve_through_rise(system_of, 0, per_rise, PARTS[place])
        errors.append(float(np.abs(y - EVENT(time, 0) - exact_response(time)).max()))
    # The step with the jump adds at most J dt^2/12, which depends on its position and so on the count.
    expect.right(JUMPS, f"as a lift, the jump {place}", what="order of the error", reference=2.0, absolute=True,
                 computed=fitted_order(1.0 / counts, errors), tolerance=0.1)  # fmt: skip
