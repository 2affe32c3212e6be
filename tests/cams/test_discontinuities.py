"""Discontinuities at the joints of an event: exact size and side."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from flexcam.cams import LAWS, HarmonicLift, LiftEvent, PeriodicSpline, Ramp, joints

RISE, DWELL, FALL, PHASE, LIFT = 1.1, 0.4, 1.7, 0.6, 0.008
AT = PHASE + np.array([0.0, RISE, RISE + DWELL, RISE + DWELL + FALL])
A, B = LIFT / RISE**2, LIFT / FALL**2
A3, B3 = LIFT / RISE**3, LIFT / FALL**3

ENDS = {
    # acceleration of the law at both ends, jerk at both ends; a return reverses the law and the sign of the jerk
    "shm": (math.pi**2 / 2, -(math.pi**2) / 2, 0.0, 0.0),
    "2-3": (6.0, -6.0, -12.0, -12.0),
    "cycloidal": (0.0, 0.0, 4 * math.pi**2, 4 * math.pi**2),
    "3-4-5": (0.0, 0.0, 60.0, 60.0),
}


def event(law, **changes):
    return LiftEvent(
        LAWS[law], **({"lift": LIFT, "rise": RISE, "fall": FALL, "dwell": DWELL, "phase": PHASE} | changes)
    )


@pytest.mark.parametrize("law", ENDS)
def test_steps_at_ends_of_rise_and_return(law):
    a0, a1, j0, j1 = ENDS[law]
    found = joints(event(law))
    np.testing.assert_allclose([one.angle for one in found], AT, rtol=0, atol=1e-12)
    steps = np.array([one.steps for one in found])
    assert not steps[:, :2].any()  # lift and velocity are continuous
    # Evaluated 4e-9 rad from the joint; the change of the curve over this distance is removed to second order.
    size, jerk = LIFT / RISE**2 * 6, LIFT / RISE**3 * 60
    np.testing.assert_allclose(steps[:, 2], [a0 * A, -a1 * A, a1 * B, -a0 * B], rtol=0, atol=1e-9 * size)
    np.testing.assert_allclose(steps[:, 3], [j0 * A3, -j1 * A3, -j1 * B3, j0 * B3], rtol=0, atol=1e-6 * jerk)
    assert not any(one.smooth for one in found)


def test_parabolic_law_steps_by_twice_acceleration_at_middle():
    found = joints(event("parabolic"))
    middle = [PHASE + RISE / 2, PHASE + RISE + DWELL + FALL / 2]
    np.testing.assert_allclose([one.angle for one in found], np.sort([*AT, *middle]), rtol=0, atol=1e-12)
    np.testing.assert_allclose([one.steps[2] for one in found], 4 * np.array([A, -2 * A, A, -B, 2 * B, -B]), rtol=1e-9)


def test_steps_at_nose_without_dwell():
    """Simple harmonic motion is smooth at the nose for equal angles; for unequal ones the acceleration steps."""
    equal = joints(LiftEvent(LAWS["shm"], LIFT, RISE, RISE))
    assert equal[1].smooth
    unequal = joints(LiftEvent(LAWS["shm"], LIFT, RISE, FALL))
    assert unequal[1].steps[2] == pytest.approx(-(math.pi**2) / 2 * (B - A), rel=1e-9)


def test_simple_harmonic_event_over_full_turn_is_smooth():
    assert all(one.smooth for one in joints(LiftEvent(LAWS["shm"], LIFT, math.pi, math.pi)))


@pytest.mark.parametrize("law", ["4-5-6-7", "5-6-7-8-9"])
def test_smooth_laws_have_no_steps(law):
    assert all(one.smooth for one in joints(event(law)))


def test_velocity_steps_of_ramp_without_take_off():
    """0.2 mm in 0.25 rad: the velocity steps by 0.8 mm/rad at both outer ends, and not at the main lift."""
    found = joints(event("4-5-6-7", ramp=Ramp(0.0002, 0.25, take_off=0.0)))
    stepping = [one for one in found if one.steps[1]]
    assert [one.steps[1] for one in stepping] == pytest.approx([0.0008, 0.0008], rel=1e-9)
    assert [one.angle for one in stepping] == pytest.approx([PHASE - 0.25, PHASE + RISE + DWELL + FALL + 0.25])


@pytest.mark.parametrize("law", ["pavlovic-trigonometric", "pavlovic-new"])
def test_published_laws_with_steps_at_start(law):
    first = joints(event(law))[0]
    if law == "pavlovic-trigonometric":
        assert first.steps[1] == pytest.approx(LIFT / RISE / 48, rel=1e-9)
    else:
        assert first.steps[2] == pytest.approx(math.pi**2 * A, rel=1e-9)


@settings(max_examples=30, deadline=None)
@given(st.floats(1e-6, 1e3), st.floats(-10.0, 10.0))
def test_steps_scale_with_lift_for_any_phase(lift, phase):
    found = joints(event("shm", lift=lift, phase=phase))
    sizes = sorted(one.steps[2] / lift for one in found)
    expected = math.pi**2 / 2 * np.sort([1 / RISE**2, 1 / RISE**2, -1 / FALL**2, -1 / FALL**2])
    np.testing.assert_allclose(sizes, expected, rtol=1e-6)


def test_periodic_lifts_have_no_joints():
    assert joints(HarmonicLift(0.003, (-0.003,), (0.0,))) == []
    assert joints(PeriodicSpline(0.001 * np.arange(12.0))) == []
