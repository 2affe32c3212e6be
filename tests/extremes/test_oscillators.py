"""No damping and far too much of it, and jumps of the parabolic law beside the steps: one unknown, closed forms.

- x'' + 2 z w x' + w^2 x = 0 with w = 1: for z > 1 the sum of exp(-t/(z + q)) and exp(-(z + q) t), q = sqrt(z^2 - 1).
- A force that jumps by J within a step: the average acceleration sees it in the middle of the step, so that the impulse
  is wrong by J dt (1/2 - part), part being where in the step the jump lies. The free motion after it is off by that
  over (m w). The parabolic law's own acceleration jumps by 8 h/T^2 in its middle.
- The same law as a motion (y'' + w^2 y = w^2 s) has no jump in its force and keeps the second order wherever it lies.
"""

from __future__ import annotations

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
def struck(system_of):
    """Return an oscillator let go from 1 with a velocity."""

    def made(ratio, velocity):
        system = system_of([[1.0]], [[2.0 * ratio]], [[1.0]])
        return Problem(system, ConstantSpeed(1.0), END / COUNT, COUNT, State(np.ones(1), np.array([velocity])))

    return made


@pytest.fixture
def released(struck):
    """Return the largest deviation from the closed form of an oscillator let go from 1 with a velocity."""

    def run(scheme, ratio, velocity):
        response = solve(struck(ratio, velocity), scheme)
        assert response.status.ok
        return float(np.abs(response["all"].displacement - decay(ratio, response.time, velocity)).max())

    return run


@pytest.mark.parametrize("ratio", [0.0, 1.0, 2.0, 10.0])
@pytest.mark.parametrize("name", WITH_CONTACTS)
def test_damping_that_the_steps_resolve(expect, released, name, ratio):
    # Period error at most (w dt)^2/5 over 10 rad times an amplitude of sqrt 2; of z = 10 the fast rate, 20, in it:
    # (20 dt)^2/5 of its part in the motion, 1/20.
    allowed = (END / COUNT) ** 2 / 5.0 * END * math.sqrt(2.0) + (2.0 * ratio * END / COUNT) ** 2 / 5.0 / 20.0
    expect.right(DAMPED, f"{name}, damping ratio {ratio:g}, struck", what="off the closed form by", reference=0.0,
                 computed=released(WITH_CONTACTS[name], ratio, 1.0), tolerance=allowed, absolute=True)  # fmt: skip


@pytest.mark.parametrize("ratio", [1e3, 1e6])
@pytest.mark.parametrize("name", ["Newmark", "Bathe"])
def test_damping_far_beyond_what_the_steps_resolve(expect, released, name, ratio):
    """The fast part, 1/(2 z) of the motion after the blow, is over within a step; what it leaves is no larger."""
    expect.right(DAMPED, f"{name}, damping ratio {ratio:g}, struck", what="off the closed form by",
                 reference=0.0, computed=released(WITH_CONTACTS[name], ratio, 1.0), tolerance=1.0 / (2.0 * ratio),
                 absolute=True)  # fmt: skip


@pytest.mark.parametrize("name", WITH_CONTACTS)
def test_overdamped_and_let_go(expect, released, name):
    """The velocity settles to 1/(2 z) within the first step, and a dissipative scheme errs by its size there."""
    ratio = 1e6
    expect.right(DAMPED, f"{name}, damping ratio {ratio:g}, let go at rest", what="off the closed form by",
                 reference=0.0, computed=released(WITH_CONTACTS[name], ratio, 0.0), tolerance=1.2 / (2.0 * ratio),
                 absolute=True)  # fmt: skip


@pytest.mark.parametrize("name", ["HHT -0.1", "generalized-alpha 0.8"])
def test_overdamped_and_struck_with_a_dissipative_scheme(expect, released, struck, name):
    """The blow is over within a step, and leaves (1/2 - beta/gamma) dt^2 a0 with a0 = -(2 z v0 + x0): that is told."""
    scheme = WITH_CONTACTS[name]
    size = abs(0.5 - scheme.beta / scheme.gamma) * (END / COUNT) ** 2 * (2e6 + 1.0)
    assert released(scheme, 1e6, 1.0) == pytest.approx(size, rel=0.02)
    (said,) = check_overshoot(struck(1e6, 1.0), scheme)
    assert float(re.search(r"by ([\d.]+) %", said)[1]) == pytest.approx(100.0 * size, rel=0.01)
    expect.warns(DAMPED, f"{name}, damping ratio 1e+06, struck", said, r"overshoots", r"\d %", "bathe")


@pytest.mark.parametrize("name", WITH_CONTACTS)
def test_nothing_overshoots_that_the_steps_resolve(struck, name):
    assert not [*check_overshoot(struck(10.0, 1.0), WITH_CONTACTS[name])]


RISE, HELD = 1.0, 1.0
OMEGA = 2.0 * math.pi * 1.3
EVENT = LiftEvent(LAWS["parabolic"], 1.0, rise=RISE, dwell=4.0, fall=1.0)
PARTS = {"on a step": 0.0, "just before a step": 1.0 - 1e-3, "just after a step": 1e-3, "a quarter into a step": 0.25}


def pulled(t):
    """Return y(t) of y'' + w^2 y = -s'' from rest: s'' is 4, from the middle of the rise -4, then nothing."""
    bumps = ((0.0, -4.0), (0.5 * RISE, 8.0), (RISE, -4.0))
    return sum(size * (1.0 - np.cos(OMEGA * np.maximum(t - at, 0.0))) / OMEGA**2 for at, size in bumps)


def stepped(per_rise, part):
    """Return a step of which an odd number and a part fill half a rise."""
    return 0.5 * RISE / (0.5 * per_rise + part)


def last_motion(system_of, order, per_rise, part):
    """Return time, displacement and velocity well within the dwell."""
    load = ([1.0], lambda m: -EVENT(m.angle, 2)) if order == 2 else ([OMEGA**2], lambda m: EVENT(m.angle, 0))
    system = system_of([[1.0]], [[0.0]], [[OMEGA**2]], [load])
    step = stepped(per_rise, part)
    response = solve(Problem(system, ConstantSpeed(1.0), step, round(1.7 / step)), newmark())
    return response.time, response["all"].displacement


@pytest.mark.parametrize("place", PARTS)
def test_an_inertia_force_that_jumps(expect, system_of, fitted_order, place):
    counts = np.array([400, 800, 1600, 3200])
    errors = []
    for per_rise in counts.tolist():
        time, y = last_motion(system_of, 2, per_rise, PARTS[place])
        errors.append(float(np.abs(y - pulled(time)).max()))
    step = stepped(int(counts[-1]), PARTS[place])
    expect.right(JUMPS, f"as a force, the jump {place}", what="order of the error", reference=1.0, absolute=True,
                 computed=fitted_order(1.0 / counts, errors), tolerance=0.1)  # fmt: skip
    # Each jump J at t_j counts J dt (1/2 - part_j) sin(w (t - t_j))/w more.
    time, y = last_motion(system_of, 2, int(counts[-1]), PARTS[place])
    theory = sum(size * step * late(at, step) * np.sin(OMEGA * np.maximum(time - at, 0.0)) / OMEGA
                 for at, size in ((0.0, -4.0), (0.5 * RISE, 8.0), (RISE, -4.0)))  # fmt: skip
    off = float(np.abs(y - pulled(time) - theory).max())
    # What is left is of second order: the period error over 1.7 s, and the step of a jump itself, J dt^2.
    left = OMEGA * 1.7 * (OMEGA * step) ** 2 / 12.0 + 8.0 * step**2
    expect.right(JUMPS, f"as a force, the jump {place}", what="error off J dt (1/2 - part)/w by", reference=0.0,
                 computed=off, tolerance=left, absolute=True)  # fmt: skip


def late(at, step):
    """Return by which part of a step a jump is felt too early; the start's force is there from the beginning."""
    if at == 0.0:
        return 0.0
    place = at / step
    part = place - math.floor(place + 1e-9)
    return 0.5 if part < 1e-9 else part - 0.5


@pytest.mark.parametrize("place", PARTS)
def test_a_motion_whose_acceleration_jumps(expect, system_of, fitted_order, place):
    counts = np.array([100, 200, 400, 800])
    errors = []
    for per_rise in counts.tolist():
        time, y = last_motion(system_of, 0, per_rise, PARTS[place])
        errors.append(float(np.abs(y - EVENT(time, 0) - pulled(time)).max()))
    # The step with the jump adds J dt^2/12 at most, which changes from count to count with its place.
    expect.right(JUMPS, f"as a lift, the jump {place}", what="order of the error", reference=2.0, absolute=True,
                 computed=fitted_order(1.0 / counts, errors), tolerance=0.1)  # fmt: skip
