"""Bathe's composite step: amplification by its two formulas, order, damping, and a stiff oscillator.

K. J. Bathe and M. M. I. Baig, Computers and Structures 83 (2005); K. J. Bathe, Computers and Structures 85 (2007). The
reference is built here from the trapezoidal rule and the backward difference, not taken from the code.
"""

import math

import numpy as np
import pytest

from flexcam.dynamics import ConstantSpeed, Problem, State, bathe, newmark, solve

SOURCE = "Bathe's composite step"


def integrate_by_formulas(w, step, steps, d, v, damping=0.0):
    """Return displacement and velocity of a free oscillator after a number of steps of both formulas."""
    for _ in range(steps):
        h = 0.5 * step
        a = -(w**2) * d - 2 * damping * w * v
        # trapezoidal rule over h: two equations for (dh, vh)
        matrix = np.array([[1.0, -0.5 * h], [0.5 * h * w**2, 1.0 + damping * w * h]])
        dh, vh = np.linalg.solve(matrix, [d + 0.5 * h * v, v + 0.5 * h * a])
        # v1 = (d - 4 dh + 3 d1)/step, a1 = (v - 4 vh + 3 v1)/step = -w^2 d1 - 2 xi w v1
        matrix = np.array([[3.0 / step, -1.0], [w**2, 3.0 / step + 2 * damping * w]])
        d, v = np.linalg.solve(matrix, [(4 * dh - d) / step, (4 * vh - v) / step])
    return d, v


@pytest.mark.parametrize("damping", [0.0, 0.05])
@pytest.mark.parametrize("turns", [0.05, 0.3, 2.0])
def test_solve_matches_composite_formulas(system_of, turns, damping):
    w, steps = 2 * math.pi, 25
    C = np.array([[2 * damping * w]])
    response = solve(
        Problem(system_of(np.eye(1), C, np.array([[w**2]])), ConstantSpeed(1.0), turns, steps,
                State(np.array([1.0]), np.array([2.0]))),
        bathe(),
    )  # fmt: skip
    d, v = integrate_by_formulas(w, turns, steps, 1.0, 2.0, damping)
    assert response["all"].displacement[-1] == pytest.approx(d, rel=1e-9, abs=1e-12)
    assert response["all"].velocity[-1] == pytest.approx(v, rel=1e-9, abs=1e-12)


@pytest.mark.parametrize("damping", [0.0, 0.1])
def test_spectral_radius_is_stable_and_damps_high_frequencies(damping):
    radii = [bathe().spectral_radius(x, damping) for x in np.geomspace(1e-2, 1e4, 60)]
    assert max(radii) <= 1.0 + 1e-12
    assert radii[-1] < 1e-3


def test_second_order_of_displacement_velocity_and_acceleration(system_of, fitted_order):
    w = 3.0
    counts = np.array([50, 100, 200, 400])
    errors = []
    for n in counts.tolist():
        response = solve(
            Problem(system_of(np.eye(1), np.zeros((1, 1)), np.array([[w**2]])), ConstantSpeed(1.0), 2.0 / n, n,
                    State(np.array([1.0]), np.zeros(1))),
            bathe(),
        )["all"]  # fmt: skip
        exact = (math.cos(2 * w), -w * math.sin(2 * w), -(w**2) * math.cos(2 * w))
        found = (response.displacement[-1], response.velocity[-1], response.acceleration[-1])
        errors.append([abs(a - b) for a, b in zip(exact, found, strict=True)])
    for column in np.array(errors).T:
        assert fitted_order(1.0 / counts, column) == pytest.approx(2.0, abs=0.1)


def test_period_error_at_a_tenth_of_the_period(record):
    """The ratio T'/T follows from the angle of the eigenvalues of both formulas."""
    w, step = 2 * math.pi, 0.1
    A = np.array([integrate_by_formulas(w, step, 1, *start) for start in ((1.0, 0.0), (0.0, 1.0))]).T
    turned = abs(np.angle(np.linalg.eigvals(A)[0]))
    values = np.linalg.eigvals(bathe().amplification(w * step))
    own = abs(np.angle(values[np.argmax(np.abs(values))]))
    record(source=SOURCE, case="dt/T = 0.1", quantity="period error", unit="1", reference=w * step / turned - 1.0,
           computed=w * step / own - 1.0, tolerance=1e-9, reason="the same numbers in two ways")  # fmt: skip


def test_stiff_oscillator_is_damped(system_of):
    """Bathe's step damps the stiff oscillator at once; with Newmark it oscillates undamped."""
    K = np.array([[1.0, 0.0], [0.0, 1e8]])
    start = State(np.zeros(2), np.array([0.0, 1.0]))
    ring = {}
    for name, method in (("bathe", bathe()), ("newmark", newmark())):
        problem = Problem(system_of(np.eye(2), np.zeros((2, 2)), K), ConstantSpeed(1.0), 0.05, 100, start)
        ring[name] = float(np.abs(solve(problem, method)["all"].velocity[50:, 1]).max())
    assert ring["newmark"] > 0.9
    assert ring["bathe"] < 1e-12
