"""Cam profiles: points, normals and curvature against Fourier series, circles and closed forms."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from flexcam.cams import (
    FlatFollower,
    HarmonicLift,
    RollerFollower,
    SwingFlatFollower,
    SwingRollerFollower,
    cam_profile,
    profile_at,
)
from flexcam.core.errors import InputError

COUNT = 256
"""Samples of a Fourier series: all coefficients fall below rounding before half of this number."""

SERIES = 1e-9
"""Relative error: two derivatives of a Fourier series of 256 terms round by 128^2 eps."""

# Circles that every follower of the fixture can follow.
CIRCLES = {
    "shift": st.floats(0.0005, 0.004), "at": st.floats(0.0, 2 * math.pi), "radius": st.floats(0.016, 0.022),
}  # fmt: skip


def as_complex(points):
    return points[:, 0] + 1j * points[:, 1]


def harmonic_lift(samples):
    """Return the lift through equally spaced samples of one revolution."""
    c = np.fft.rfft(samples) / len(samples)
    return HarmonicLift(float(c[0].real), tuple((2 * c[1:64].real).tolist()), tuple((-2 * c[1:64].imag).tolist()))


def test_curvature_and_normal_by_fourier_series(follower, turn, harmonic_event, slope, outward):
    made = cam_profile(harmonic_event, follower, count=COUNT, turn=turn)
    own = np.exp(-1j * turn * made.angle)
    normal = outward(follower, made.lift, made.touch.point) * own
    z = as_complex(made.points)
    first, second = slope(z), slope(slope(z))
    # The curve bends away from its outward normal where it is convex: z'' . n = -|z'|^2/radius.
    radius = -(np.abs(first) ** 2) / (second * np.conj(normal)).real
    np.testing.assert_allclose(as_complex(made.normals), normal, atol=1e-12)
    np.testing.assert_allclose((first * np.conj(normal)).real, 0.0, atol=SERIES * np.abs(first).max())
    np.testing.assert_allclose(made.radius, radius, rtol=SERIES)


@pytest.mark.parametrize("offset", [0.0, 0.003, -0.003])
def test_hollow_has_negative_radius(offset, turn, slope):
    """A lift of 12 mm twice per revolution under a roller of 3 mm: hollow at the bottom, convex at the top."""
    follower = RollerFollower(0.018, 0.003, offset)
    made = cam_profile(HarmonicLift(0.006, (0.0, -0.006), (0.0, 0.0)), follower, count=1024, turn=turn)
    z = as_complex(made.points)
    first, second = slope(z), slope(slope(z))
    curvature = (
        -turn * (np.conj(first) * second).imag / np.abs(first) ** 3
    )  # the profile is traversed against the rotation
    assert (curvature < 0).any()
    assert (curvature > 0).any()
    # Relative to the maximum curvature: the radius itself is meaningless where the curve is almost straight.
    np.testing.assert_allclose(1 / made.radius, curvature, atol=1e-7 * np.abs(curvature).max())


def test_profile_is_base_circle_in_dwell(follower, turn, smooth_event):
    angle = np.linspace(4.0, 6.5, 101)
    assert np.all(smooth_event(angle) == 0.0)
    made = profile_at(smooth_event, follower, angle, turn)
    np.testing.assert_allclose(np.linalg.norm(made.points, axis=1), follower.base_radius, rtol=1e-14)
    np.testing.assert_allclose(made.radius, follower.base_radius, rtol=1e-13)
    np.testing.assert_allclose(made.normals * follower.base_radius, made.points, atol=1e-16)


def test_upper_dwell_is_concentric_circle(follower, turn, smooth_event, gap):
    angle = np.linspace(1.81, 2.19, 51)
    made = profile_at(smooth_event, follower, angle, turn)
    distance = np.linalg.norm(made.points, axis=1)
    assert np.ptp(distance) < 1e-16
    assert gap(follower, 0.003, np.zeros(1))[0] == pytest.approx(distance[0], rel=1e-12)  # cam's centre to follower
    np.testing.assert_allclose(made.radius, distance, rtol=1e-12)


def test_contact_offset_of_flat_face_is_lift_derivative(turn, smooth_event):
    made = cam_profile(smooth_event, FlatFollower(0.018), turn=turn)
    np.testing.assert_allclose(made.offset, turn * smooth_event(made.angle, 1), atol=1e-17)
    np.testing.assert_allclose(made.touch.point.real, turn * smooth_event(made.angle, 1), atol=1e-17)
    # On the rise the contact is where the cam's surface moves up: to the right of a counterclockwise cam's axis.
    assert turn * made.offset[np.argmax(made.velocity)] > 0.0


@pytest.mark.parametrize("offset", [0.0, 0.006, -0.006])
def test_normal_offset_of_roller_follows_lift_derivative(offset, turn, smooth_event):
    """It crosses the line through the cam's axis, perpendicular to the motion, at s' for any offset."""
    made = cam_profile(smooth_event, RollerFollower(0.018, 0.008, offset), turn=turn)
    reach = math.sqrt(0.026**2 - offset**2) + smooth_event(made.angle)
    slant = np.arctan((offset - turn * smooth_event(made.angle, 1)) / reach)
    np.testing.assert_allclose(made.offset, turn * smooth_event(made.angle, 1) * np.cos(slant), atol=1e-16)


@given(
    mean=st.floats(0.0, 0.01), first=st.tuples(*[st.floats(-0.002, 0.002)] * 2),
    second=st.tuples(*[st.floats(-0.001, 0.001)] * 2), base=st.floats(0.005, 0.1),
)  # fmt: skip
@settings(max_examples=25, deadline=None)
def test_flat_face_radius_is_base_plus_lift_plus_acceleration(mean, first, second, base):
    event = HarmonicLift(mean, (first[0], second[0]), (first[1], second[1]))
    made = cam_profile(event, FlatFollower(base), count=48)
    # r0 + s + s'': the first harmonic drops out, the second enters with 1 - 4.
    only_second = HarmonicLift(0.0, (0.0, second[0]), (0.0, second[1]))
    np.testing.assert_allclose(made.radius, base + mean - 3 * only_second(made.angle), atol=1e-16, rtol=1e-13)


@pytest.mark.parametrize("shift", [0.001, 0.003, 0.006])
def test_eccentric_circle_has_constant_curvature(shift, turn):
    made = cam_profile(HarmonicLift(shift, (-shift,), (0.0,)), FlatFollower(0.018), turn=turn)
    np.testing.assert_allclose(made.radius, 0.018 + shift, rtol=1e-13)
    np.testing.assert_allclose(np.linalg.norm(made.points + np.array([0.0, shift]), axis=1), 0.018 + shift, rtol=1e-13)


@given(**CIRCLES)
@settings(max_examples=10, deadline=None)
def test_profile_from_lift_of_circle_is_circle(follower, turn, lift_on_circle, shift, at, radius):
    even = np.arange(COUNT) * (2 * math.pi / COUNT)
    middle = shift * np.exp(1j * at)
    event = harmonic_lift(lift_on_circle(follower, middle * np.exp(1j * turn * even), radius))
    made = profile_at(event, follower, np.linspace(0.0, 6.0, 61), turn)
    spoke = as_complex(made.points) - middle
    np.testing.assert_allclose(np.abs(spoke), radius, rtol=1e-11)
    np.testing.assert_allclose(as_complex(made.normals), spoke / radius, atol=1e-9)
    np.testing.assert_allclose(made.radius, radius, rtol=1e-7)  # two derivatives of a sum of rounded harmonics


def test_pitch_and_cutter_paths_have_constant_distance(follower, turn, smooth_event, centre):
    made = cam_profile(smooth_event, follower, turn=turn)
    path = made.cutter_path(0.005)
    np.testing.assert_allclose(np.linalg.norm(path - made.points, axis=1), 0.005, rtol=1e-12)
    # The path is outside and perpendicular to the profile: no other point of the profile is nearer.
    everywhere = np.abs(as_complex(path)[:, None] - as_complex(made.points))
    assert everywhere.min() > 0.005 - 1e-12
    if math.isinf(follower.roller_radius):
        np.testing.assert_array_equal(made.pitch, made.points)
    else:  # a cutter of the roller's size follows its path
        np.testing.assert_allclose(made.cutter_path(follower.roller_radius), made.pitch, atol=1e-16)
        own = centre(follower, made.lift) * np.exp(-1j * turn * made.angle)
        np.testing.assert_allclose(as_complex(made.pitch), own, atol=1e-16)


@pytest.mark.parametrize("radius", [0.0, -0.005, math.nan])
def test_invalid_cutter_radius_raises_error(radius, smooth_event):
    with pytest.raises(InputError, match="cutter"):
        cam_profile(smooth_event, FlatFollower(0.018), count=24).cutter_path(radius)


def test_too_few_points_raise_error(smooth_event):
    assert len(cam_profile(smooth_event, FlatFollower(0.018), count=12).points) == 12
    with pytest.raises(InputError, match="12"):
        cam_profile(smooth_event, FlatFollower(0.018), count=11)


INVALID_FOLLOWERS = {
    "base circle of no size": lambda: FlatFollower(0.0),
    "roller of no size": lambda: RollerFollower(0.018, 0.0),
    "roller that misses the cam": lambda: RollerFollower(0.018, 0.008, 0.026),
    "arm too short for the triangle": lambda: SwingRollerFollower(0.018, 0.008, 0.030, 0.060),
    "pitch circle too large for it": lambda: SwingRollerFollower(0.100, 0.020, 0.050, 0.060),
    "roller that reaches the cam's axis": lambda: SwingRollerFollower.from_angle(0.016, 0.1, 0.1, 0.1),
    "face beyond the base circle": lambda: SwingFlatFollower(0.018, 0.04, 0.045, face=-0.028),
    "arm of no length": lambda: SwingFlatFollower(0.018, 0.0, 0.045),
}


@pytest.mark.parametrize("make", INVALID_FOLLOWERS.values(), ids=INVALID_FOLLOWERS.keys())
def test_invalid_follower_raises_error(make):
    with pytest.raises(InputError, match=r"follower|base_radius"):
        make()


def test_with_base_changes_only_base_radius(follower):
    other = follower.with_base(0.019)
    assert other.base_radius == 0.019
    assert other.with_base(follower.base_radius) == follower


def test_rates_of_pressure_angle_sliding_and_push(follower, turn, smooth_event):
    """Compare with differences over 1 mrad, whose own error is 1e-4 of the maximum slope."""
    angle = np.linspace(0.3, 6.0, 50)
    made, before, after = (profile_at(smooth_event, follower, angle + side, turn) for side in (0.0, -5e-4, 5e-4))
    for measure, slope in (
        (lambda one: one.pressure_angle, made.touch.pressure_rate),
        (lambda one: one.touch.sliding, made.touch.sliding_rate),
        (lambda one: one.touch.reach, made.touch.reach_rate),
        (lambda one: one.push.real, made.push_rate.real),
        (lambda one: one.push.imag, made.push_rate.imag),
    ):
        found = (measure(after) - measure(before)) / 1e-3
        np.testing.assert_allclose(slope, found, rtol=0.0, atol=1e-4 * np.abs(found).max() + 1e-12)


def test_push_is_lift_change_of_displaced_cam(follower, turn, smooth_event):
    """The lift at which the follower touches the points of a displaced cam, by central differences."""
    begin, shift = follower.lift_direction, 1e-6
    for angle in np.linspace(0.3, 6.0, 9):
        near = profile_at(smooth_event, follower, angle + np.linspace(-5e-3, 5e-3, 2001), turn)
        points = as_complex(near.points) * np.exp(1j * turn * angle)
        push = complex(profile_at(smooth_event, follower, np.array([angle]), turn).push[0])
        for part, way in ((push.real, begin), (push.imag, 1j * begin)):
            high, low = (float(follower.lift_at(points + side * shift * way).max()) for side in (1.0, -1.0))
            # Points 5e-6 rad apart miss the maximum by about 1e-13 m, for a shift of 1e-6 m.
            assert (high - low) / (2.0 * shift) == pytest.approx(part, abs=2e-6)
