"""Polydyne cams against the closed form of a single mass and its motion by time integration."""

import math

import numpy as np
import pytest

from flexcam.cams import LAWS, LiftEvent, SingleMass, harmonics, off_design_deviation, polydyne
from flexcam.core.errors import InputError

WANTED = LiftEvent(LAWS["5-6-7-8-9"], lift=0.008, rise=1.5, fall=1.3, dwell=0.5, phase=0.2)
"""Smooth to the fourth derivative, so that sixty harmonics represent it to 1e-8 m."""

FREQUENCY, SPEED = 1000.0, 150.0
GRID = np.linspace(0.0, 2 * math.pi, 721)


def steady_motion(cam, frequency, damping, speed):
    """Return the steady motion of y'' + 2 D w0 (y' - s') + w0^2 (y - s) = 0 over the cam angle, by time integration.

    The state after a revolution is linear in the initial state; three runs give the periodic one.
    """
    from scipy.integrate import solve_ivp

    ratio = frequency / speed

    def rate(angle, state):
        y, v = state
        s, ds = (cam(np.array([angle]), order)[0] for order in (0, 1))
        return [v, -2 * damping * ratio * (v - ds) - ratio**2 * (y - s)]

    def run(state, drive=True):
        field = rate if drive else lambda _, q: [q[1], -2 * damping * ratio * q[1] - ratio**2 * q[0]]
        return solve_ivp(field, (0.0, 2 * math.pi), state, "DOP853", t_eval=GRID, rtol=1e-10, atol=1e-13).y

    forced = run([0.0, 0.0])
    free = np.column_stack([run(unit, drive=False)[:, -1] for unit in ([1.0, 0.0], [0.0, 1.0])])
    start = np.linalg.solve(np.eye(2) - free, forced[:, -1])
    return run(start)[0]


def test_undamped_cam_matches_stoddart():
    """The known form s = y + (w/w0)^2 y''."""
    made = polydyne(WANTED, SingleMass(FREQUENCY), SPEED)
    exact = made.target(GRID) + (SPEED / FREQUENCY) ** 2 * made.target(GRID, 2)
    np.testing.assert_allclose(made.event(GRID), exact, atol=1e-15)
    # The harmonics missing in y'' dominate: sixty harmonics represent it to 1e-3 of its 0.07 m.
    whole = WANTED(GRID) + (SPEED / FREQUENCY) ** 2 * WANTED(GRID, 2)
    np.testing.assert_allclose(made.event(GRID), whole, atol=2e-6)
    assert np.abs(made.event(GRID) - WANTED(GRID)).max() > 1e-4


def test_left_out_deviation():
    few, many = (polydyne(WANTED, SingleMass(FREQUENCY), SPEED, count=n) for n in (6, 60))
    for made in (few, many):
        assert made.left_out == pytest.approx(np.abs(made.target(GRID) - WANTED(GRID)).max(), rel=0.05)
    assert few.left_out > 1e-5
    assert many.left_out < 1e-8
    assert len(few.event.cosine) == len(few.target.cosine) == 6


@pytest.mark.parametrize("damping", [0.02, pytest.param(1.5, marks=pytest.mark.slow)])
def test_mass_follows_wanted_lift(damping):
    made = polydyne(WANTED, SingleMass(FREQUENCY, damping), SPEED, count=30)
    moved = steady_motion(made.event, FREQUENCY, damping, SPEED)
    np.testing.assert_allclose(moved, made.target(GRID), atol=1e-9, rtol=0)
    # A cam with the wanted lift does not: the dynamics make the difference.
    assert np.abs(steady_motion(made.target, FREQUENCY, damping, SPEED) - made.target(GRID)).max() > 1e-5


@pytest.mark.parametrize("damping", [0.0, 0.1])
def test_single_mass_response(damping):
    """The response to s = exp(i w t), inserted into y'' + 2 D w0 (y' - s') + w0^2 (y - s) = 0."""
    omega = np.array([0.0, 300.0, 999.0, 5000.0])
    y = SingleMass(FREQUENCY, damping)(omega)
    rest = -(omega**2) * y + 2j * damping * FREQUENCY * omega * (y - 1) + FREQUENCY**2 * (y - 1)
    np.testing.assert_allclose(rest, 0.0, atol=1e-7)  # of terms up to 5e8
    assert y[0] == 1.0


def test_off_design_deviation():
    train = SingleMass(FREQUENCY, 0.05)
    made = polydyne(WANTED, train, SPEED, count=40)
    away = off_design_deviation(
        made, train, [0.8 * SPEED, 0.9 * SPEED, 0.97 * SPEED, SPEED, 1.03 * SPEED, 1.1 * SPEED, 1.2 * SPEED]
    )
    assert away[3] < 1e-14
    assert list(away[:4]) == sorted(away[:4], reverse=True)
    assert list(away[3:]) == sorted(away[3:])
    assert away[2] > 1e-6
    worst = np.abs(steady_motion(made.event, FREQUENCY, 0.05, 1.2 * SPEED) - made.target(GRID)).max()
    assert away[-1] == pytest.approx(worst, rel=1e-3)  # each on its own grid


def test_train_without_response_raises_error():
    def no_response(omega):
        return np.where(np.abs(omega - 3 * SPEED) < 1.0, 0.0, 1.0 + 0j)

    with pytest.raises(InputError, match=r"does not respond to harmonic 3 at 1432\.39 rpm"):
        polydyne(WANTED, no_response, SPEED)
    assert polydyne(WANTED, no_response, SPEED, count=2).left_out > 0.0  # the third harmonic is not needed
    with pytest.raises(InputError, match="does not respond"):
        polydyne(WANTED, lambda omega: np.where(omega == 0.0, np.inf, 1.0), SPEED)


def test_resonant_harmonic_is_not_in_cam():
    """Undamped at w0 = 5 w: the mass oscillates freely; the fifth harmonic in the cam would grow without bound."""
    train = SingleMass(5 * SPEED)
    made = polydyne(WANTED, train, SPEED)
    wanted = harmonics(WANTED, 60)
    assert abs(wanted[5]) > 1e-6
    assert made.event.cosine[4] == made.event.sine[4] == 0.0
    n = np.arange(1, 61)
    cam = wanted[1:] * (1 - (n / 5.0) ** 2)  # Stoddart's factor, zero for the fifth
    np.testing.assert_allclose(np.array(made.event.cosine) - 1j * np.array(made.event.sine), cam, atol=1e-16)
    # The deviation at the design speed is the omitted harmonic; with the harmonic in the cam, the motion is unbounded.
    assert off_design_deviation(made, train, [SPEED]) == pytest.approx(abs(wanted[5]), rel=1e-3)
    assert off_design_deviation(made, train, [5 * SPEED / 3]).tolist() == [math.inf]
    assert np.isfinite(off_design_deviation(made, train, [1.01 * SPEED])).all()


def test_invalid_polydyne_arguments_raise_error():
    with pytest.raises(InputError, match="speed"):
        polydyne(WANTED, SingleMass(FREQUENCY), 0.0)
    with pytest.raises(InputError, match="count"):
        polydyne(WANTED, SingleMass(FREQUENCY), SPEED, count=0)
    with pytest.raises(InputError, match="frequency"):
        SingleMass(0.0)
    with pytest.raises(InputError, match="damping"):
        SingleMass(FREQUENCY, -0.1)
