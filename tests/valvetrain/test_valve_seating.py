"""Seating of a valve: velocity and bounces, independent of the start of the revolution."""

import math

import numpy as np
import pytest

from flexcam.valvetrain import seating

STEPS = 360
ANGLE = np.radians(np.arange(STEPS, dtype=float))


def revolution():
    """Return gap and velocity: a lift from 100 to 250 deg, a bounce of 0.2 mm from 252 to 260 deg."""
    gap = np.full(STEPS, -1e-5)
    gap[100:251] = 8e-3 * np.sin(np.linspace(0.0, np.pi, 151)) + 2e-6
    gap[252:261] = 2e-4 * np.sin(np.linspace(0.0, np.pi, 9)) + 2e-6
    return gap, np.gradient(gap, ANGLE)


@pytest.mark.parametrize("cut", [0, 90, 101, 130, 174, 175, 176, 200, 249, 251, 255, 260, 300])
def test_seating_is_independent_of_start_of_revolution(cut):
    gap, velocity = revolution()
    whole = seating(gap, velocity, ANGLE)
    shifted = seating(np.roll(gap, -cut), np.roll(velocity, -cut), ANGLE)
    assert whole is not None
    assert whole.bounces == 1
    assert shifted is not None
    assert (shifted.velocity, shifted.bounces, shifted.height) == (whole.velocity, whole.bounces, whole.height)


@pytest.mark.parametrize("size", [1.0, 1e-2, 1e-3, 1e2])
def test_seating_is_independent_of_size(size):
    gap, velocity = revolution()
    found = seating(size * gap, size * velocity, ANGLE)
    assert found is not None
    assert (found.bounces, found.height / size) == (1, pytest.approx(2.02e-4, rel=1e-3))


@pytest.mark.parametrize("steps", [4001, 16000])
def test_rebounds_between_instants_count(steps):
    """A ball falls 0.1 m with e = 0.7: bounce n rises e^(2 n) 0.1 m, above 1 um up to n = 16."""
    fall, e = math.sqrt(0.2 / 9.81), 0.7
    time = np.linspace(0.0, 1.0, steps)
    bounces = [(fall * (1.0 + 2.0 * e * (1.0 - e**n) / (1.0 - e)), e ** (n + 1)) for n in range(60)]
    gap, velocity = 0.1 - 0.5 * 9.81 * time**2, -9.81 * time
    for begin, part in bounces:
        since, speed = time - begin, part * 9.81 * fall
        gap = np.where(since > 0.0, speed * since - 0.5 * 9.81 * since**2, gap)
        velocity = np.where(since > 0.0, speed - 9.81 * since, velocity)
    at_rest = time > bounces[-1][0]
    gap, velocity = np.where(at_rest, 0.0, gap), np.where(at_rest, 0.0, velocity)
    found = seating(gap, velocity, np.linspace(0.0, 2.0 * math.pi, steps, endpoint=False))
    assert found is not None
    assert found.bounces == 16
    assert found.height == pytest.approx(0.049, rel=1e-3)


def test_rebound_into_the_lift_is_no_bounce():
    """An oscillator strikes its stop once per revolution: the rebound is the lift itself."""
    angle = np.linspace(0.0, 2.0 * math.pi, 720, endpoint=False)
    gap, velocity = 1e-3 * np.abs(np.sin(0.5 * (angle - 1.0037))), 0.5e-3 * np.cos(0.5 * (angle - 1.0037))
    velocity = np.where(np.sin(0.5 * (angle - 1.0037)) < 0.0, -velocity, velocity)
    found = seating(gap, velocity, angle)
    assert found is not None
    assert (found.bounces, found.height) == (0, 0.0)


@pytest.mark.parametrize("last", [120, 200, 256])
def test_record_ending_with_open_valve_has_no_seating(last):
    gap, velocity = revolution()
    assert seating(gap[:last], velocity[:last], ANGLE[:last]) is None


def test_record_from_lift_into_bounce_has_no_seating():
    gap, velocity = revolution()
    assert seating(gap[180:256], velocity[180:256], ANGLE[180:256]) is None


def test_revolution_ending_with_open_valve_has_no_seating():
    """The end does not match the start: the valve has not closed at the end."""
    gap, velocity = revolution()
    gap[300:] = np.linspace(0.0, 9e-3, 60)
    assert seating(gap, velocity, ANGLE) is None


def test_seating_velocity_is_that_at_touchdown():
    """A body falling from 3 mm passes the seat within a step: sqrt(2 g h), for any phase of the steps."""
    for phase in (0.1, 0.5, 0.9):
        time = (np.arange(-200, 123) + phase) * 2e-4
        fall = np.clip(time, 0.0, None)
        gap, velocity = 3e-3 - 0.5 * 9.81 * fall**2, -9.81 * fall
        angle = np.linspace(0.0, 2.0 * np.pi, len(time))
        gap, velocity = np.append(gap, np.full(100, -1e-6)), np.append(velocity, np.zeros(100))
        gap[0] = -1e-6  # the revolution starts on the seat
        found = seating(gap, velocity, np.append(angle, angle[-1] + angle[1] * np.arange(1, 101)))
        assert found is not None
        assert found.velocity == pytest.approx(np.sqrt(2.0 * 9.81 * 3e-3), rel=1e-9)


def test_seating_with_restitution():
    """A valve rises 1 mm and falls on a seat with e = 0.3; closed form sqrt(2 g h), then heights e^2 h, e^4 h."""
    g, height, e = 9.81, 1e-3, 0.3
    speed = np.sqrt(2.0 * g * height)
    time = np.arange(0.0, 4.0 * speed / g, 7.3e-5)
    gap, velocity = np.zeros_like(time), np.zeros_like(time)
    begin, up = 0.0, speed
    for _ in range(12):
        flight = 2.0 * up / g
        inside = (time >= begin) & (time < begin + flight)
        own = time[inside] - begin
        gap[inside], velocity[inside] = up * own - 0.5 * g * own**2, up - g * own
        begin, up = begin + flight, e * up
    found = seating(gap, velocity, 100.0 * time)
    assert found is not None
    assert found.velocity == pytest.approx(speed, rel=1e-3)  # the touchdown is extrapolated from the last instants
    assert found.height == pytest.approx(e**2 * height, rel=1e-3)
    assert found.bounces >= 2


def test_seating_of_rigid_train():
    """A rigid valve closes without bounce, except for rounding, at the velocity of the ramp."""
    angle = np.linspace(0.0, 2.0 * np.pi, 721)[:-1]
    gap = np.maximum(1e-3 * (1.0 - np.abs(angle - 3.0) / 0.7), 0.0)
    velocity = np.where(gap > 0.0, -1e-3 / 0.7 * np.sign(angle - 3.0), 0.0)
    noise = np.where(gap > 0.0, 0.0, 1e-18 * np.cos(50.0 * angle))
    found = seating(gap + noise, velocity - noise, angle)
    assert found is not None
    assert (found.bounces, found.height) == (0, 0.0)
    assert found.velocity == pytest.approx(1e-3 / 0.7, rel=1e-6)


def test_several_rebounds_within_step():
    """The velocity after the step is again towards the seat, but much smaller than before."""
    angle = np.linspace(0.0, 1.0, 101)[:-1]
    gap = np.maximum(1e-3 * (1.0 - np.abs(angle - 0.4) / 0.3), 1e-9)
    velocity = np.where(angle < 0.4, 1e-3 / 0.3, -1e-3 / 0.3) * (gap > 1e-9)
    velocity[70:] = -1e-6  # small drops at the end of each step
    found = seating(gap, velocity, angle)
    assert found is not None
    assert found.velocity == pytest.approx(1e-3 / 0.3, rel=1e-6)


def test_touch_during_opening_is_not_bounce():
    gap, velocity = revolution()
    gap[96:99] = 1e-5  # the valve leaves the seat and touches it again before the lift
    assert seating(gap, velocity, ANGLE).bounces == 2
    assert seating(gap, velocity, ANGLE, (math.radians(90.0) < ANGLE) & (math.radians(175.0) > ANGLE)).bounces == 1


def test_revolution_ending_in_bounce_has_seating():
    """The valve closed, and then rebounds until the end."""
    gap, velocity = revolution()
    gap[300:] = 3e-3 * np.sin(np.linspace(0.0, 2.0, 60))
    found = seating(gap, velocity, ANGLE)
    assert (found.bounces, found.height) == (2, pytest.approx(3e-3, rel=1e-3))
    assert found.angle == seating(*revolution(), ANGLE).angle
