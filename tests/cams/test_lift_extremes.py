"""Extremes over a revolution: closed forms, joints with steps, laws with overshoot."""

import math

import numpy as np
import pytest

from flexcam.cams import LAWS, BSplineLaw, HarmonicLift, LiftEvent, criteria, curve_minimum, event_extremes
from tests.thinning import mostly_slow


@pytest.mark.parametrize("name", mostly_slow(LAWS))
@pytest.mark.parametrize("order", [1, 3])
def test_extremes_of_law(name, order):
    """Rise and return of a cam with joints at arbitrary angles, against the criteria of the law alone."""
    rise, fall = 1.234567, 0.987654
    found = event_extremes(LiftEvent(LAWS[name], 0.007, rise, fall, 0.3, phase=0.456), order)
    one = criteria(LAWS[name])
    low, high = (one.velocity, one.acceleration, one.jerk)[order - 1]
    ends = [0.0] + [value * 0.007 / rise**order for value in (low.value, high.value)]
    ends += [value * 0.007 / fall**order * (-1) ** order for value in (low.value, high.value)]
    got = [end.value for end in found]
    scale = max(map(abs, ends))
    assert got == pytest.approx([min(ends), max(ends)], rel=1e-10, abs=1e-10 * scale)


def test_left_limit_at_joint_counts():
    """The jerk of 3-4-5 at the end of its rise, 60 h/b^3, is a left limit: the jerk of the dwell is zero."""
    half = event_extremes(LiftEvent(LAWS["3-4-5"], 1.0, 1.0, 2.0), 3)
    assert [half[0].value, half[1].value] == pytest.approx([-30.0, 60.0], rel=1e-11)
    assert curve_minimum(lambda angle: np.where(angle < 2.0, 3.0 - angle, 5.0), (2.0,)).value == pytest.approx(
        1.0, rel=1e-12
    )


def test_extreme_between_grid_points():
    phase = 0.1234
    low, high = event_extremes(HarmonicLift(0.0, (math.cos(7 * phase),) * 0 + (0.0,) * 6 + (1.0,), (0.0,) * 7))
    assert [low.value, high.value] == pytest.approx([-1.0, 1.0], rel=1e-13)
    found = curve_minimum(lambda angle: -np.cos(angle - phase))
    assert (found.value, found.at) == (pytest.approx(-1.0, rel=1e-14), pytest.approx(phase, abs=1e-7))


def test_nan_values_are_ignored():
    found = curve_minimum(lambda angle: np.where(angle < 1.0, np.nan, angle))
    assert found.value == pytest.approx(1.0, abs=1e-7)


def test_height_of_law_with_overshoot():
    law = BSplineLaw((0.0, 0.0, 0.0, 1.6, 1.0, 1.0, 1.0), 5)
    event = LiftEvent(law, 0.01, 1.0, 1.0)
    top = law(np.linspace(0.0, 1.0, 100_001)).max()
    assert top > 1.01
    assert event.height == pytest.approx(0.01 * top, rel=1e-9)
    assert LiftEvent(LAWS["cycloidal"], 0.01, 1.0, 1.0).height == 0.01
