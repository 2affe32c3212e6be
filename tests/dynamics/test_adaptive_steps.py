"""Adaptive steps and interpolation of the motion between the instants.

O. C. Zienkiewicz and Y. M. Xie, Earthq. Eng. Struct. Dyn. 20 (1991): the local error of Newmark's method is
h^2 (beta - 1/6) (a1 - a0), of third order, so the error of a run follows tolerance^(2/3).
"""

from dataclasses import replace

import numpy as np
import pytest

from flexcam import InputError
from flexcam.dynamics import Adaptive, Cause, ConstantSpeed, Problem, State, bathe, newmark, solve
from tests.integrators import WITH_CONTACTS

START, SPEED0, END = np.array([0.2, -0.1]), np.array([-0.5, 0.8]), 2.0


def run(system, method, steps, adaptive=None):
    problem = Problem(system, ConstantSpeed(3.0), END / steps, steps, State(START, SPEED0), adaptive)
    return solve(problem, method)


@pytest.mark.parametrize(
    "method",
    [
        pytest.param(method, id=name, marks=[pytest.mark.slow] * (name not in ("Bathe", "Newmark")))
        for name, method in WITH_CONTACTS.items()
    ],
)
def test_error_follows_tolerance(pair, exact_end, fitted_order, method):
    d, _ = exact_end()
    tolerances = np.array([1e-4, 1e-5, 1e-6, 1e-7])
    errors = []
    for tolerance in tolerances:
        response = run(pair(), method, 20, Adaptive(tolerance))
        assert response.status.ok
        assert len(response.time) == 21
        errors.append(np.linalg.norm(response["all"].displacement[-1] - d))
    # Step lengths are powers of two: each may be off by a factor of up to 2, the fit over three decades by 0.15.
    assert fitted_order(tolerances, errors) == pytest.approx(2 / 3, abs=0.15)
    assert errors[-1] < 1e-4


@pytest.mark.parametrize("beta", [1 / 6, 0.17, 1 / 12])
def test_error_follows_tolerance_by_velocity_estimate(pair, exact_end, beta):
    """The error estimate of displacements vanishes for linear acceleration, but not that of velocities."""
    d, _ = exact_end()
    response = run(pair(), newmark(beta=beta), 20, Adaptive(1e-7))
    reference = run(pair(), newmark(), 20, Adaptive(1e-7))
    assert response.status.ok
    assert np.linalg.norm(response["all"].displacement[-1] - d) < 1e-4
    # The trapezoidal rule has the same velocity error: the number of steps is equal up to one halving.
    assert 0.5 < response.stats.substeps / reference.stats.substeps < 2.0


def test_unstable_steps_are_divided(system_of):
    """With the given step, the first revolution of linear acceleration grows by 1e100 and gives no reference size."""
    system = system_of([[1.0]], [[0.0]], [[100.0]])
    problem = Problem(system, ConstantSpeed(0.02), 1.0, 300, State(np.ones(1), np.zeros(1)), Adaptive(1e-3))
    response = solve(problem, newmark(beta=1 / 6))
    assert response.status.ok
    assert np.abs(response["all"].displacement).max() < 1.0 + 1e-6
    assert response.stats.substeps > 30 * problem.steps


def test_loose_tolerance_uses_given_steps(pair):
    fixed, loose = run(pair(), newmark(), 50), run(pair(), newmark(), 50, Adaptive(0.5))
    np.testing.assert_array_equal(loose["all"].displacement, fixed["all"].displacement)
    assert (loose.stats.substeps, loose.stats.rejected) == (51, 0)
    assert (fixed.stats.substeps, fixed.stats.rejected) == (0, 0)


def test_halved_steps_match_finer_run(pair):
    """Between two tolerances all steps are halved: the run equals one with fixed smaller steps."""
    finer = run(pair(), newmark(), 800)["all"].displacement
    found = run(pair(), newmark(), 50, Adaptive(1e-9, smallest=END / 800))
    assert found.status.cause is Cause.STEP_TOO_SMALL
    found = run(pair(), newmark(), 50, Adaptive(4e-6))
    gap = np.abs(found["all"].displacement - finer[::16]).max()
    assert gap < 0.1 * np.abs(run(pair(), newmark(), 50)["all"].displacement - finer[::16]).max()


def test_minimum_step_status_states_position_and_remedy(pair):
    response = run(pair(), newmark(), 20, Adaptive(1e-12, smallest=END / 20 / 4))
    status = response.status
    assert status.cause is Cause.STEP_TOO_SMALL
    for part in ("the error of", "times the tolerance", "t = ", "cam angle", "0.025 s"):
        assert part in status.text
    assert "tolerance" in status.remedy
    assert len(response.time) == 1  # the initial state is saved


class StepLoad:
    """Step load."""

    def __init__(self, at):
        self.at = at

    def __call__(self, motion):
        return np.where(motion.angle >= self.at, 1.0, 0.0)


@pytest.mark.parametrize("at", [2.0, 2.0001, 2.1])
def test_steps_are_short_at_load_step(system_of, at):
    """On, just after and off a step: only there is the step divided often, and the error follows the tolerance."""
    system = system_of([[1.0]], [[0.0]], [[4.0]], [(np.ones(1), StepLoad(at))])
    problem = Problem(system, ConstantSpeed(1.0), 0.1, 40)
    exact = 0.25 * (1.0 - np.cos(2.0 * (4.0 - at)))
    fixed, found = (
        solve(replace(problem, adaptive=adaptive), newmark())["all"].displacement[-1]
        for adaptive in (None, Adaptive(1e-6))
    )
    assert abs(found - exact) < 5e-4
    assert abs(found - exact) < 0.2 * abs(fixed - exact)


def test_adaptive_steps_of_free_mass(system_of):
    """Without stiffness, the reference size is the displacement at the frequency of the load."""
    system = system_of([[2.0]], [[0.0]], [[0.0]], [(np.ones(1), lambda motion: np.cos(motion.angle))])
    problem = Problem(system, ConstantSpeed(3.0), 0.1, 20, adaptive=Adaptive(1e-6))
    response = solve(problem, newmark())
    assert response.status.ok
    exact = (1.0 - np.cos(3.0 * response.time)) / 18.0
    assert np.abs(response["all"].displacement - exact).max() < 2e-5


def test_adaptive_steps_are_independent_of_units(system_of):
    """Lengths times 1e-3 and masses times 1e6 need the same steps."""
    counts = []
    for mass, length in ((1.0, 1.0), (1e6, 1e-3)):
        system = system_of([[mass]], [[0.0]], [[4.0 * mass]])
        start = State(np.array([length]), np.zeros(1))
        problem = Problem(system, ConstantSpeed(1.0), 0.1, 40, start, Adaptive(1e-6))
        counts.append(solve(problem, newmark()).stats.substeps)
    assert counts[0] == counts[1] > 41


@pytest.mark.parametrize("given", [{"tolerance": 0.0}, {"tolerance": -1.0}, {"smallest": 0.0}, {"tolerance": np.nan}])
def test_invalid_tolerance_raises_error(given):
    with pytest.raises(InputError, match="adaptive"):
        Adaptive(**given)


def test_order_of_interpolation_between_instants(pair, fitted_order):
    """The reference has 6400 steps: interpolation errors are of higher order than integration errors."""
    fine = run(pair(), bathe(), 6400)
    errors = {"displacement": [], "velocity": [], "acceleration": []}
    steps = np.array([25, 50, 100])
    for n in steps:
        kept = fine.at(np.linspace(0.0, END, n + 1))
        between = kept.at(fine.time)
        for name, values in errors.items():
            values.append(np.abs(getattr(between["all"], name) - getattr(fine["all"], name)).max())
    orders = {name: fitted_order(1 / steps, values) for name, values in errors.items()}
    # Velocities are cubics of the accelerations, also of order four; linear accelerations are of order two.
    assert orders["displacement"] == pytest.approx(4, abs=0.2)
    assert orders["velocity"] == pytest.approx(4, abs=0.2)
    assert orders["acceleration"] == pytest.approx(2, abs=0.2)


def test_interpolation_at_instants_is_exact(pair):
    response = run(pair(), newmark(), 40)
    again = response.at(response.time)
    np.testing.assert_allclose(again["all"].displacement, response["all"].displacement, rtol=1e-15)
    np.testing.assert_allclose(again.angle, response.angle, rtol=1e-15)
    for name, values in response.channels.items():
        np.testing.assert_allclose(again.channels[name], values, rtol=1e-15)


@pytest.mark.parametrize("times", [[-0.1, 0.5], [0.5, 2.1], [0.5, 0.4], [], [np.nan]])
def test_times_outside_run_raise_error(pair, times):
    with pytest.raises(InputError, match="times"):
        run(pair(), newmark(), 40).at(np.array(times))


def test_error_estimate_matches_literature(system_of):
    """h^2 (beta - 1/6) (a1 - a0) of a Newmark step, relative to the motion; a slightly larger tolerance accepts it."""
    h, omega = 0.1, 2.0
    system = system_of([[1.0]], [[0.0]], [[omega**2]])
    problem = Problem(system, ConstantSpeed(1.0), h, 200, State(np.ones(1), np.zeros(1)))
    plain = solve(problem, newmark())
    accelerations = plain["all"].acceleration
    largest = h**2 * (1 / 4 - 1 / 6) * np.abs(np.diff(accelerations[:64])).max()
    moved = np.abs(plain["all"].displacement[:64] - 1.0).max()  # from the start, within the first revolution
    share = largest / moved
    whole = solve(replace(problem, steps=63, adaptive=Adaptive(1.02 * share)), newmark()).stats
    cut = solve(replace(problem, steps=63, adaptive=Adaptive(0.98 * share)), newmark()).stats
    assert whole.rejected == 0
    assert cut.rejected > 0
