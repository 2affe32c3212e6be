"""Lift of a follower from the points of a profile."""

import math

import numpy as np
import pytest

from flexcam.cams import (
    LAWS,
    FlatFollower,
    HarmonicLift,
    LiftEvent,
    RollerFollower,
    SwingFlatFollower,
    SwingRollerFollower,
    cam_profile,
)
from flexcam.cams import lift_from_profile as read
from flexcam.core.errors import InputError
from tests.thinning import mostly_slow

ANGLES = np.linspace(0.0, 2 * math.pi, 331)
AROUND = np.linspace(0.0, 2 * math.pi, 90, endpoint=False)
CIRCLE = 0.02 * np.column_stack([np.cos(AROUND), np.sin(AROUND)])

RESOLUTIONS = [
    ("3-4-5", 720, 1e-9), ("4-5-6-7", 360, 1e-9), ("5-6-7-8-9", 720, 1e-13),
]  # fmt: skip
"""Law, points, and error of the spline of degree 5, m: smoother laws and more points reduce it."""


@pytest.mark.parametrize(("law", "count", "left"), mostly_slow(RESOLUTIONS))
def test_lift_round_trip_through_profile(law, count, left, follower, turn):
    event = LiftEvent(LAWS[law], lift=0.003, rise=1.5, fall=1.7, dwell=0.4, phase=0.3)
    points = cam_profile(event, follower, count=count, turn=turn).points
    np.testing.assert_allclose(read(points, follower, ANGLES, turn=turn), event(ANGLES), atol=left, rtol=0)


@pytest.mark.parametrize("count", mostly_slow([90, 180]))
def test_smooth_lift_needs_few_points(count, follower, turn, harmonic_event):
    points = cam_profile(harmonic_event, follower, count=count, turn=turn).points
    np.testing.assert_allclose(read(points, follower, ANGLES, turn=turn), harmonic_event(ANGLES), atol=1e-9, rtol=0)


def test_opposite_rotation_gives_different_lift(follower, turn, smooth_event):
    points = cam_profile(smooth_event, follower, turn=turn).points
    assert np.abs(read(points, follower, ANGLES, turn=-turn) - smooth_event(ANGLES)).max() > 1e-3


def test_order_and_start_of_points_do_not_matter(follower, turn, smooth_event):
    points = cam_profile(smooth_event, follower, count=360, turn=turn).points
    for same in (points[::-1], np.roll(points, 101, axis=0)):
        np.testing.assert_allclose(read(same, follower, ANGLES, turn=turn), smooth_event(ANGLES), atol=1e-9, rtol=0)


def test_larger_base_circle_gives_constant_lift(follower, turn):
    """A circle 2 mm larger than the base circle gives a constant lift, which its radius determines."""
    lift = read(CIRCLE / 0.02 * (follower.base_radius + 0.002), follower, ANGLES, turn=turn)
    assert np.ptp(lift) < 1e-9
    larger = follower.with_base(follower.base_radius + 0.002)
    assert read(CIRCLE / 0.02 * larger.base_radius, larger, [0.0], turn=turn)[0] == pytest.approx(0.0, abs=1e-9)
    if isinstance(follower, FlatFollower):
        assert lift[0] == pytest.approx(0.002, abs=1e-9)
    elif isinstance(follower, RollerFollower):
        steps = [math.sqrt((r + 0.008) ** 2 - follower.offset**2) for r in (0.018, 0.020)]
        assert lift[0] == pytest.approx(steps[1] - steps[0], abs=1e-9)
    else:
        assert lift[0] == pytest.approx(follower.arm * (larger.start_angle - follower.start_angle), abs=1e-9)


def lift_over_points(points, follower, turn):
    """Return the lift over the points; the error of 100 000 is (spacing/2)^2/2 (1/r_cam + 1/r_roller) < 1e-9 m."""
    z, lift = points[:, 0] + 1j * points[:, 1], []
    for angle in ANGLES[::7]:
        x, y = (z * np.exp(1j * turn * angle)).view(float).reshape(-1, 2).T
        if isinstance(follower, FlatFollower):
            lift.append(y.max() - follower.base_radius)
            continue
        near = np.abs(x - follower.offset) <= follower.roller_radius
        top = y[near] + np.sqrt(follower.roller_radius**2 - (x[near] - follower.offset) ** 2)
        start = math.sqrt((follower.base_radius + follower.roller_radius) ** 2 - follower.offset**2)
        lift.append(top.max() - start)
    return np.array(lift)


DEEP = HarmonicLift(0.006, (0.0, -0.006), (0.0, 0.0))
"""A lift of 12 mm twice per revolution: under a roller of 4 mm the cam is hollow."""

OTHER_FOLLOWERS = {
    "a roller on a flat follower's cam": (HarmonicLift(0.003, (-0.0015, 0.0004), (0.001, -0.0003)), FlatFollower(0.018),
                                          RollerFollower(0.018, 0.006, 0.002)),
    "a flat face over a hollow": (DEEP, RollerFollower(0.018, 0.004), FlatFollower(0.018)),
    "a roller too large for a hollow": (DEEP, RollerFollower(0.018, 0.004), RollerFollower(0.018, 0.05, -0.002)),
}  # fmt: skip


@pytest.mark.parametrize("case", OTHER_FOLLOWERS)
def test_lift_of_different_follower(case, turn):
    event, made_for, other = OTHER_FOLLOWERS[case]
    coarse, fine = (cam_profile(event, made_for, count=n, turn=turn).points for n in (720, 100_000))
    lift = read(coarse, other, ANGLES[::7], turn=turn)
    np.testing.assert_allclose(lift, lift_over_points(fine, other, turn), atol=1e-9, rtol=0)
    assert np.abs(lift - event(ANGLES[::7])).max() > 1e-4  # differs from the lift of the design follower


def test_shape_of_lift_follows_angles(readonly):
    flat, circle = FlatFollower(0.018), readonly(CIRCLE)
    assert read(circle, flat, 0.3).shape == ()
    assert read(circle, flat, readonly(np.zeros((2, 3)))).shape == (2, 3)
    np.testing.assert_allclose(read(circle, flat, [[0.0], [7.0]]), 0.002, atol=1e-9)


REPEATED = np.insert(CIRCLE, 7, CIRCLE[7], axis=0)
INVALID_PROFILES = {
    "too few points": (CIRCLE[::9], FlatFollower(0.018), "10 points.*12 or more"),
    "not a number": (np.where(np.arange(180).reshape(90, 2) == 11, math.nan, CIRCLE), FlatFollower(0.018), r"5, 1\]"),
    "not finite": (np.where(np.arange(180).reshape(90, 2) == 4, math.inf, CIRCLE), FlatFollower(0.018), r"2, 0\]"),
    "a point twice": (REPEATED, FlatFollower(0.018), "equal neighbouring points"),
    "closed by a repeated point": (np.vstack([CIRCLE, CIRCLE[:1]]), FlatFollower(0.018), "equal neighbouring points"),
    "in three dimensions": (np.hstack([CIRCLE, CIRCLE[:, :1]]), FlatFollower(0.018), "shape"),
    "a roller far beside": (0.01 * CIRCLE, RollerFollower(0.018, 0.005, 0.02), "the follower misses.*unit"),
    "an arm that misses": (0.01 * CIRCLE, SwingRollerFollower(0.030, 0.002, 0.020, 0.05), "the follower misses"),
    "a face that misses": (0.01 * CIRCLE, SwingFlatFollower(0.050, 0.05, 0.006, face=0.0545), "the follower misses"),
}


@pytest.mark.parametrize("case", INVALID_PROFILES)
def test_invalid_profile_raises_error(case):
    points, follower, message = INVALID_PROFILES[case]
    with pytest.raises(InputError, match=message):
        read(points, follower, ANGLES)
