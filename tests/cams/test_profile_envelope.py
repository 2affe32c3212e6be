"""A profile is the envelope of its follower: no point is inside, and it touches at every cam angle."""

import numpy as np

from flexcam.cams import cam_profile, find_profile_faults

COUNT = 2880
ANGLES = np.arange(0, COUNT, 31)
INSIDE = 1e-9
"""Tolerance in m; the error is rounding only, 1e-16, because the points are exact."""


def test_profile_is_envelope_of_follower(follower, turn, smooth_event, gap):
    made = cam_profile(smooth_event, follower, count=COUNT, turn=turn)
    assert not find_profile_faults(made, pressure_angle=1.2)  # an undercut profile would be no envelope
    own = made.points[:, 0] + 1j * made.points[:, 1]
    for k in ANGLES:
        fixed = own * np.exp(1j * turn * made.angle[k])
        distance = gap(follower, made.lift[k], fixed)
        assert distance.min() > -INSIDE
        assert abs(distance[k]) < 1e-15  # the follower touches at the stated point
        assert abs(np.angle(np.exp(1j * (made.angle[np.argmin(distance)] - made.angle[k])))) < 0.02  # and nowhere else


def test_touch_is_in_fixed_frame(follower, turn, smooth_event, gap, outward):
    touch = cam_profile(smooth_event, follower, turn=turn).touch
    lift = smooth_event(np.arange(720) * (2 * np.pi / 720))
    np.testing.assert_allclose(gap(follower, lift, touch.point), 0.0, atol=1e-15)
    np.testing.assert_allclose(touch.normal, outward(follower, lift, touch.point), atol=1e-13)
    # 1e-6 m outward is inside the follower, 1e-6 m inward is clear of it.
    assert np.all(gap(follower, lift, touch.point + 1e-6 * touch.normal) < 0.0)
    assert np.all(gap(follower, lift, touch.point - 1e-6 * touch.normal) > 0.0)
