"""Ramps before and after the main lift: height, slope, and continuity at the joints."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from flexcam.cams import LAWS, LiftEvent, Ramp, ReversedLaw, joints
from flexcam.cams.motion_law import RampTransition
from flexcam.core.errors import InputError

TURN = 2 * math.pi
RAMP = Ramp(0.0002, math.radians(15), 0.3)
CLOSING = Ramp(0.00035, math.radians(20), 0.6)
RISE, FALL, DWELL, LIFT, PHASE = 1.05, 1.3, 0.2, 0.0053, 0.9

# Velocity and acceleration are zero at both ends, so that the law itself has no steps.
SMOOTH = ("cycloidal", "3-4-5", "4-5-6-7", "modified-sine", "5-6-7-8-9", "gutman-1-3")

TAKE_OFF = st.just(0.0) | st.floats(0.01, 1.0)
HEIGHT, DURATION = st.floats(1e-5, 1e-3), st.floats(0.05, 0.8)


def evaluate(curve, angles, order=0):
    return curve(np.atleast_1d(np.asarray(angles, float)), order)


@settings(max_examples=60, deadline=None)
@given(HEIGHT, DURATION, TAKE_OFF)
def test_ramp_height_and_slope(height, duration, take_off):
    ramp = Ramp(height, duration, take_off)
    ends = np.array([0.0, 1.0])
    np.testing.assert_allclose(ramp(ends), [0.0, 1.0], rtol=0, atol=1e-14)
    assert height / duration * evaluate(ramp, 1.0, 1)[0] == pytest.approx(ramp.slope, rel=1e-12)
    # The take-off gains 0.4 of the height at full velocity, the rest of the ramp all of it.
    assert ramp.slope * duration * (1 - 0.6 * take_off) == pytest.approx(height, rel=1e-12)


@settings(max_examples=60, deadline=None)
@given(st.floats(0.01, 1.0))
def test_take_off_starts_at_rest_and_is_monotonic(take_off):
    ramp = Ramp(1e-4, 0.3, take_off)
    for order in (1, 2):
        assert evaluate(ramp, 0.0, order)[0] == pytest.approx(0.0, abs=1e-12 / take_off**order)
    z = np.linspace(0.0, 1.0, 501)
    assert ramp(z, 1).min() >= -1e-12
    assert (ramp(z[z >= take_off], 2) == 0.0).all()  # constant velocity after it


@pytest.mark.parametrize("order", [1, 2, 3, 4])
@pytest.mark.parametrize("take_off", [0.0, 0.1, 0.25, 0.5, 1.0])
def test_ramp_derivatives(take_off, order, derivative_error):
    ramp = Ramp(1e-4, 0.3, take_off)
    assert derivative_error(ramp, order, [0.0, *ramp.breaks, 1.0]) < 1e-12


def test_velocity_steps_without_take_off():
    ramp = Ramp(0.0002, 0.25, take_off=0.0)
    assert ramp.breaks == ()
    event = LiftEvent(LAWS["3-4-5"], LIFT, RISE, RISE, ramp=ramp)
    first = joints(event)[0] if event.start >= 0 else joints(event)[-1]
    assert first.angle == pytest.approx(event.start % TURN)
    assert first.steps[1] == pytest.approx(0.0008, rel=1e-9)


@pytest.mark.parametrize("k", [0.0, 0.3, 1.0])
@pytest.mark.parametrize("name", SMOOTH)
def test_main_lift_continues_ramp(name, k):
    """From velocity k without acceleration to 1 at rest; the correction preserves the end of the law."""
    law = RampTransition(LAWS[name], k)
    np.testing.assert_allclose(evaluate(law, [0.0, 1.0]), [0.0, 1.0], rtol=0, atol=1e-14)
    np.testing.assert_allclose(evaluate(law, [0.0, 1.0], 1), [k, 0.0], rtol=0, atol=1e-12)
    np.testing.assert_allclose(evaluate(law, [0.0, 1.0], 2), [0.0, 0.0], rtol=0, atol=1e-11)
    assert law(np.linspace(0, 1, 501), 1).min() >= -1e-12  # monotonic up to k = 1


def test_main_lift_matches_formula():
    """It is (1 - 0.4 k) law + k g with g' = (1 - z)^3 (1 + 3 z), integrated by hand."""
    z, k = np.linspace(0.0, 1.0, 101), 0.35
    g = z - 2 * z**3 + 2 * z**4 - 0.6 * z**5
    slope = (1 - z) ** 3 * (1 + 3 * z)
    law = RampTransition(LAWS["4-5-6-7"], k)
    np.testing.assert_allclose(law(z), (1 - 0.4 * k) * LAWS["4-5-6-7"](z) + k * g, rtol=0, atol=1e-15)
    np.testing.assert_allclose(law(z, 1), (1 - 0.4 * k) * LAWS["4-5-6-7"](z, 1) + k * slope, rtol=0, atol=1e-14)


def ramped_event(name="4-5-6-7", **changes):
    given = {"dwell": DWELL, "phase": PHASE, "ramp": RAMP, "closing_ramp": CLOSING} | changes
    return LiftEvent(LAWS[name], LIFT, RISE, FALL, **given)


@pytest.mark.parametrize("dwell", [0.0, DWELL])
@pytest.mark.parametrize("name", SMOOTH)
def test_acceleration_is_continuous_at_joints(name, dwell):
    for one in joints(ramped_event(name, dwell=dwell)):
        assert one.steps[:3] == (0.0, 0.0, 0.0), one


@pytest.mark.parametrize("name", SMOOTH)
def test_one_sided_values_agree_at_joints(name):
    """Values 1e-7 rad on both sides of each joint differ by no more than the next derivative allows."""
    event, beside = ramped_event(name), 1e-7
    grid = np.linspace(0, TURN, 3601)
    for angle in event.joints:
        for order in range(3):
            left, right = event(np.array([angle - beside, angle + beside]), order)
            assert abs(right - left) <= 2.1 * beside * np.abs(event(grid, order + 1)).max()


def test_heights_of_ramped_event():
    """The ramp adds to the lift; the return falls from there to the closing ramp, which ends at the base circle."""
    event = ramped_event()
    assert event.height == pytest.approx(LIFT + RAMP.height, rel=1e-15)
    opens, top = PHASE, PHASE + RISE
    falls, closes = top + DWELL, top + DWELL + FALL
    places = [opens - RAMP.duration, opens, top, falls, closes, closes + CLOSING.duration]
    expected = [0.0, RAMP.height, event.height, event.height, CLOSING.height, 0.0]
    np.testing.assert_allclose(event(np.array(places)), expected, rtol=0, atol=1e-17)
    np.testing.assert_allclose(event(np.array([opens, closes]), 1), [RAMP.slope, -CLOSING.slope], rtol=1e-12)
    assert event.start == pytest.approx(PHASE - RAMP.duration)


def test_opening_ramp_is_default_closing_ramp():
    one, same = ramped_event(closing_ramp=None), ramped_event(closing_ramp=RAMP)
    grid = np.linspace(0.0, TURN, 721)
    for order in range(4):
        np.testing.assert_array_equal(one(grid, order), same(grid, order))


def test_return_mirrors_rise_for_equal_ramps_and_angles():
    event = LiftEvent(LAWS["modified-sine"], LIFT, RISE, RISE, dwell=DWELL, ramp=RAMP)
    middle, away = RISE + DWELL / 2, np.linspace(0.0, 2.0, 301)
    np.testing.assert_allclose(event(middle - away), event(middle + away), rtol=0, atol=1e-17)


def test_event_with_closing_ramp_only():
    event = ramped_event(ramp=None)
    assert event.height == LIFT
    assert event.start == PHASE
    assert all(one.steps[:3] == (0.0, 0.0, 0.0) for one in joints(event))


def test_ramps_of_single_low_dwell():
    """The reversed law starts from the ramp; rise meets return under acceleration, equal on both sides."""
    event = LiftEvent(LAWS["quinquinomial"], LIFT, RISE, RISE, phase=PHASE, ramp=RAMP, single_dwell="low")
    assert all(one.steps[:3] == (0.0, 0.0, 0.0) for one in joints(event))
    k = RAMP.slope * RISE / LIFT
    law = RampTransition(ReversedLaw(LAWS["quinquinomial"]), k)
    z = np.linspace(0.0, 0.999, 101)
    expected = RAMP.height + LIFT * law(z)
    np.testing.assert_allclose(event(PHASE + z * RISE), expected, rtol=0, atol=1e-16)


@settings(max_examples=40, deadline=None)
@given(st.floats(1e-5, 4e-4), st.floats(0.1, 0.5), TAKE_OFF, st.floats(0.8, 1.6), st.floats(-7.0, 7.0))
def test_lift_and_velocity_are_continuous_after_ramp(height, duration, take_off, rise, phase):
    """Lift and velocity at both ends of the opening ramp; a steeper ramp is an error that states the valid slope."""
    ramp = Ramp(height, duration, take_off)
    if ramp.slope * max(rise, 1.2) > LIFT:
        with pytest.raises(InputError, match="cannot continue such a slope"):
            LiftEvent(LAWS["cycloidal"], LIFT, rise, 1.2, phase=phase, ramp=ramp)
        return
    event = LiftEvent(LAWS["cycloidal"], LIFT, rise, 1.2, phase=phase, ramp=ramp)
    left, right = (event(np.array([phase + side]), 1)[0] for side in (-1e-7, 1e-7))
    assert left == pytest.approx(ramp.slope, rel=1e-5)
    assert right == pytest.approx(ramp.slope, rel=1e-5)
    assert event(np.array([phase]))[0] == pytest.approx(height, rel=1e-9)


@pytest.mark.parametrize(
    "changes", [{"height": 0.0}, {"duration": 0.0}, {"take_off": -0.1}, {"take_off": 1.1}, {"take_off": math.nan}]
)
def test_invalid_ramp_raises_error(changes):
    (name,) = changes
    with pytest.raises(InputError, match=f"^ramps.{name}:"):
        Ramp(**({"height": 1e-4, "duration": 0.2} | changes))


@pytest.mark.parametrize(
    ("changes", "allowed"),
    [
        ({"ramp": Ramp(0.002, 0.2)}, 1e3 * LIFT / RISE),
        ({"ramp": None, "closing_ramp": Ramp(0.002, 0.2)}, 1e3 * (LIFT - 0.002) / FALL),
        ({"closing_ramp": Ramp(0.002, 0.2)}, 1e3 * (LIFT + RAMP.height - 0.002) / FALL),
    ],
)
def test_too_steep_ramp_raises_error(changes, allowed):
    with pytest.raises(InputError, match=f"of at most {allowed:.4g} mm/rad. The main lift"):
        ramped_event(**changes)


def test_steepest_valid_ramp():
    """Slope times rise equal to the lift is k = 1; a thousandth more raises an error."""
    duration, take_off = 0.3, 0.25
    steepest = LIFT / RISE * duration * (1 - 0.6 * take_off)
    LiftEvent(LAWS["3-4-5"], LIFT, RISE, RISE, ramp=Ramp(steepest * 0.9999, duration, take_off))
    message = r"maximum slope of .* in the opening ramp, expected a maximum slope of .* at least 17.3 deg long"
    with pytest.raises(InputError, match=message):
        LiftEvent(LAWS["3-4-5"], LIFT, RISE, RISE, ramp=Ramp(steepest * 1.001, duration, take_off))
    LiftEvent(LAWS["3-4-5"], LIFT, RISE, RISE, ramp=Ramp(steepest * 1.001, np.radians(17.3), take_off))
