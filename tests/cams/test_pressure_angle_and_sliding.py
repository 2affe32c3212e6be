"""Pressure angle and sliding against textbook formulas and against the motion of the contact point.

R. L. Norton, Cam Design and Manufacturing Handbook, 2nd ed. (2009), ch. 7; J. Volmer, Getriebetechnik: Kurvengetriebe
(1989). The pressure angle is measured from the normal to the motion, counterclockwise.
"""

import math

import numpy as np
import pytest

from flexcam.cams import FlatFollower, RollerFollower, SwingFlatFollower, SwingRollerFollower, cam_profile

TOLERANCE = {"atol": 1e-13, "rtol": 1e-12}


@pytest.mark.parametrize("offset", [0.0, 0.006, -0.006])
def test_pressure_angle_of_translating_roller(offset, turn, smooth_event):
    """The formula tan phi = (s' -+ e)/(sqrt((rb + rr)^2 - e^2) + s): minus where the offset is on the rising side."""
    made = cam_profile(smooth_event, RollerFollower(0.018, 0.008, offset), turn=turn)
    s, v = smooth_event(made.angle), smooth_event(made.angle, 1)
    tangent = (v - turn * offset) / (math.sqrt(0.026**2 - offset**2) + s)
    # A positive tan phi pushes the follower away from the rising side, to which the normal inclines.
    np.testing.assert_allclose(np.tan(made.pressure_angle), -turn * tangent, **TOLERANCE)


def test_offset_to_rising_side_reduces_pressure_angle(turn, smooth_event):
    rise = np.argmax(smooth_event(np.linspace(0.0, 2 * math.pi, 720, endpoint=False), 1))
    steep = [
        abs(cam_profile(smooth_event, RollerFollower(0.018, 0.008, turn * e), turn=turn).pressure_angle[rise])
        for e in (0.002, 0.0, -0.002)
    ]
    assert steep[0] < steep[1] < steep[2]


@pytest.mark.parametrize("side", [1, -1])
def test_pressure_angle_of_swinging_roller(side, turn, smooth_event, arm_angle):
    """Formula tan alpha = (l (1 +- psi') - a cos psi)/(a sin psi): minus for equal sense of rotation."""
    follower = SwingRollerFollower(0.020, 0.009, 0.055, 0.060, side)
    made = cam_profile(smooth_event, follower, turn=turn)
    psi, rate = arm_angle(follower, smooth_event(made.angle)), smooth_event(made.angle, 1) / 0.055
    alike = -turn * side  # on the rise the follower turns clockwise where its side is 1
    tangent = (0.055 * (1 - alike * rate) - 0.060 * np.cos(psi)) / (0.060 * np.sin(psi))
    np.testing.assert_allclose(np.abs(np.tan(made.pressure_angle)), np.abs(tangent), **TOLERANCE)
    # On the base circle the normal passes through the cam's centre, below or above the motion by l - a cos psi.
    away = made.touch.trace[0] / abs(made.touch.trace[0])
    assert np.angle(made.touch.motion[0] / away) == pytest.approx(made.pressure_angle[0], abs=1e-13)


@pytest.mark.parametrize(("face", "side"), [(0.0, 1), (0.004, 1), (0.004, -1), (-0.003, -1)])
def test_pressure_angle_of_swinging_face(face, side, turn, smooth_event, arm_angle):
    """The contact is at q along the face and e off it, and the force is normal to the face: tan alpha = e/q."""
    follower = SwingFlatFollower(0.018, 0.050, 0.055, face, side)
    made = cam_profile(smooth_event, follower, turn=turn)
    psi, rate = arm_angle(follower, smooth_event(made.angle)), smooth_event(made.angle, 1) / 0.050
    q = 0.055 * np.cos(psi) / (1 + turn * side * rate)
    np.testing.assert_allclose(np.tan(made.pressure_angle), -side * face / q, **TOLERANCE)


def test_pressure_angle_of_flat_face_is_zero(turn, smooth_event):
    np.testing.assert_array_equal(cam_profile(smooth_event, FlatFollower(0.018), turn=turn).pressure_angle, 0.0)


def test_sliding_of_flat_face(turn, smooth_event):
    """The surface of the cam moves along the face at w (r0 + s), backwards above a counterclockwise cam."""
    made = cam_profile(smooth_event, FlatFollower(0.018), turn=turn)
    np.testing.assert_allclose(made.touch.sliding, -turn * (0.018 + smooth_event(made.angle)), rtol=1e-14)


def test_sliding_is_contact_travel_on_follower_minus_cam(follower, turn, harmonic_event, slope):
    """Both rates by Fourier series; that of the follower along its rotating face or non-rotating roller."""
    made = cam_profile(harmonic_event, follower, count=256, turn=turn)
    tangent = -1j * made.touch.normal
    own = np.exp(-1j * turn * made.angle)
    on_cam = (slope(made.touch.point * own) * np.conj(tangent * own)).real
    if isinstance(follower, SwingFlatFollower):
        on_follower = slope(((made.touch.point - follower.distance) * np.conj(tangent)).real)
    elif isinstance(follower, FlatFollower):
        on_follower = slope(made.touch.point.real)
    else:
        on_follower = (slope(made.touch.point - made.touch.trace) * np.conj(tangent)).real
    # One derivative of a series of 256 terms rounds by 128 eps of the surface's speed, 0.02 m/rad.
    np.testing.assert_allclose(made.touch.sliding, on_follower - on_cam, atol=1e-12)


def test_motion_is_that_of_touching_part(follower, turn, harmonic_event, slope):
    made = cam_profile(harmonic_event, follower, count=256, turn=turn)
    if isinstance(follower, SwingFlatFollower):
        reach = made.touch.point - follower.distance  # the face turns about the pivot, clockwise for side 1
        expected = -1j * follower.side * reach / np.abs(reach)
    elif isinstance(follower, SwingRollerFollower):
        speed = slope(made.touch.trace) / harmonic_event(made.angle, 1)
        expected = speed / np.abs(speed)
    else:
        expected = np.full(256, 1j)
    np.testing.assert_allclose(made.touch.motion, expected, atol=1e-9)
