"""Shared functions of equal cam profiles."""

import numpy as np

from flexcam.cams import LAWS, FlatFollower, LiftEvent
from flexcam.dynamics import CamFunctionCache
from flexcam.valvetrain.cam_functions import _shape, cached_profile, sliding_ratio
from flexcam.valvetrain.parts import Cam

ANGLES = np.linspace(0.0, 3.0, 7)


def make_cam(lift, at="lobe"):
    return Cam(at, LiftEvent(LAWS["4-5-6-7"], lift, 1.2, 1.2), FlatFollower(0.02))


def test_cams_have_separate_profiles():
    """A shape at the memory address of a freed one does not use its profile."""
    cams, cache = [make_cam(1e-3 + 1e-5 * i) for i in range(20)], CamFunctionCache(ANGLES)
    for cam in cams:
        assert np.array_equal(cached_profile(cam, cache).lift, cam.event(ANGLES))
        _shape.cache_clear()


def test_equal_cams_share_functions():
    assert sliding_ratio(make_cam(5e-3, "one")) is sliding_ratio(make_cam(5e-3, "other"))
    assert sliding_ratio(make_cam(5e-3)) is not sliding_ratio(make_cam(6e-3))
