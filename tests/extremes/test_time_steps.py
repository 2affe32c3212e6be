"""Omega dt from 1e-4 to 1e6, a million steps and ten thousand periods of an oscillator with omega = 1.

Average acceleration advances the phase by exactly 2 atan(w dt/2) per step and keeps the amplitude (T. J. R. Hughes,
The Finite Element Method (1987), ch. 9): the displacement is cos(2 n atan(w dt/2)) after n steps.
"""

import math

import numpy as np
import pytest

from flexcam.dynamics import ConstantSpeed, Problem, SaveAt, State, newmark, solve
from tests.integrators import WITH_CONTACTS
from tests.thinning import slow_if

STEPS, TURNS = "step times frequency", "many revolutions"
EPS = float(np.finfo(float).eps)
SWEEP = [10.0**n for n in range(-4, 7)]


@pytest.fixture
def free_vibration(system_of):
    """Return a function that solves free vibration from d = 1 with a given omega dt and saves all steps."""
    system = system_of([[1.0]], [[0.0]], [[1.0]])

    def run(scheme, x, steps):
        problem = Problem(system, ConstantSpeed(1.0), x, steps, State(np.ones(1), np.zeros(1)))
        response = solve(problem, scheme, save=SaveAt(field_every=1000))
        assert response.status.ok
        return response

    return run


@pytest.mark.parametrize("name", WITH_CONTACTS)
def test_spectral_radius_is_at_most_one(expect, name):
    worst = max(WITH_CONTACTS[name].spectral_radius(x) for x in SWEEP)
    # Double eigenvalues at -1 are accurate to half the digits, sqrt(eps) = 1.5e-8.
    expect.right(STEPS, f"{name}, omega dt 1e-4 to 1e6", what="spectral radius above 1 by", reference=0.0,
                 computed=max(worst - 1.0, 0.0), tolerance=1e-7, absolute=True)  # fmt: skip


@pytest.mark.parametrize("name", slow_if(lambda name: name != "Newmark", WITH_CONTACTS))
def test_amplitude_is_bounded_for_all_steps(expect, free_vibration, name):
    peaks = [np.abs(free_vibration(WITH_CONTACTS[name], x, 300)["all"].displacement).max() for x in SWEEP]
    # The initial acceleration, (w dt)^2 in dt^2 a, is rounded: at most eps (w dt)^2 = 2e-4 of the displacement.
    expect.right(STEPS, f"{name}, omega dt 1e-4 to 1e6, 300 steps", what="amplitude above 1 by", reference=0.0,
                 computed=max(0.0, max(peaks) - 1.0), tolerance=EPS * SWEEP[-1] ** 2, absolute=True)  # fmt: skip


@pytest.mark.parametrize("x", [1e-4, 1e-2, 1.0, 10.0, 1e3, 1e6])
def test_average_acceleration_matches_discrete_solution(expect, free_vibration, x):
    history = free_vibration(newmark(), x, 500)["all"]
    exact = np.cos(2.0 * math.atan(0.5 * x) * np.arange(501))
    # A step adds rounding of dt^2 a, eps (1 + x^2), and of the angle, eps; in the worst case 500 of them add up.
    expect.right(STEPS, f"Newmark, omega dt = {x:g}, 500 steps", what="off cos(2 n atan(omega dt/2)) by", reference=0.0,
                 computed=float(np.abs(history.displacement - exact).max()), absolute=True,
                 tolerance=500 * EPS * (1.0 + 0.25 * x**2))  # fmt: skip


@pytest.mark.parametrize("name", slow_if(lambda name: name == "Bathe", WITH_CONTACTS))
def test_small_steps_match_exact_vibration(expect, free_vibration, name):
    """The period error is of order (w dt)^2: at most 1/5 of it for these schemes, times the angle."""
    x, steps = 1e-4, 10_000
    history = free_vibration(WITH_CONTACTS[name], x, steps)
    exact = np.cos(history.time)
    expect.right(STEPS, f"{name}, omega dt = 1e-4, {steps} steps", what="off cos(omega t) by", reference=0.0,
                 computed=float(np.abs(history["all"].displacement - exact).max()), absolute=True,
                 tolerance=0.2 * x**2 * x * steps)  # fmt: skip


def phase(history):
    """Return the phase angle at the last step, modulo 2 pi."""
    return math.atan2(-history.velocity[-1], history.displacement[-1])


def expect_phase_and_energy(expect, response, turns, per_turn):
    x, history = 2.0 * math.pi / per_turn, response["all"]
    drift = turns * per_turn * (x - 2.0 * math.atan(0.5 * x))
    found = math.remainder(-phase(history) - drift, 2.0 * math.pi) + drift
    given = f"Newmark, {turns} turns of {per_turn} steps"
    # Rounding of a step, eps, adds up over n steps: at most n eps = 2e-10 for a million.
    allowed = turns * per_turn * EPS
    expect.right(TURNS, given, what="phase behind by", reference=drift, computed=found, tolerance=allowed,
                 absolute=True, unit=" rad")  # fmt: skip
    energy = 0.5 * (history.velocity**2 + history.displacement**2)
    expect.right(TURNS, given, what="energy relative to that of the start", reference=1.0, tolerance=1e-9,
                 computed=float(energy[np.argmax(np.abs(energy - 0.5))] / 0.5))  # fmt: skip


def test_phase_and_energy_after_ten_thousand_periods(expect, free_vibration):
    """The phase lag is (w dt)^2/12 per radian: 509 rad after 10 000 periods of 20 steps."""
    expect_phase_and_energy(expect, free_vibration(newmark(), 2.0 * math.pi / 20, 200_000), 10_000, 20)


@pytest.mark.slow
def test_phase_and_energy_after_million_steps(expect, free_vibration):
    expect_phase_and_energy(expect, free_vibration(newmark(), 2.0 * math.pi / 100, 1_000_000), 10_000, 100)
