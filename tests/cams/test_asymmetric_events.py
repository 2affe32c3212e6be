"""Events with a return that differs from the rise, with one dwell or in any phase, and invalid events."""

import math
import re
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from flexcam.cams import LAWS, DelayedEvent, HarmonicLift, LiftEvent, Ramp, ReversedLaw, quinquinomial
from flexcam.cams.lift_event import Segment
from flexcam.core.errors import InputError

TURN = 2 * math.pi
RISE, DWELL, FALL, PHASE, LIFT = 1.0, 0.3, 1.6, 0.7, 0.008
NAMES = st.sampled_from(["cycloidal", "3-4-5", "fb2", "modified-trapezoid", "quinquinomial", "pavlovic-new"])
ANGLE = st.floats(0.3, 1.4)


def event(rise="3-4-5", fall="modified-sine", **changes):
    given = {"dwell": DWELL, "phase": PHASE, "fall_law": LAWS[fall]} | changes
    return LiftEvent(LAWS[rise], LIFT, RISE, FALL, **given)


@settings(max_examples=40, deadline=None)
@given(NAMES, NAMES, ANGLE, ANGLE, st.floats(0.0, 1.0), st.floats(-20.0, 20.0), st.integers(0, 4))
def test_rise_and_return_follow_their_laws(up, down, rise, fall, dwell, phase, order):
    """The return is the reversed law: h u(1 - z), derivatives with the sign of (-1)^order."""
    one = LiftEvent(LAWS[up], LIFT, rise, fall, dwell=dwell, phase=phase, fall_law=LAWS[down])
    z = np.linspace(0.013, 0.987, 41)
    for law, start, span in ((LAWS[up], phase, rise), (LAWS[down], phase + rise + dwell, fall)):
        sign, place = (1.0, z) if span == rise and start == phase else (-1.0, 1.0 - z)
        clear = np.all([np.abs(place - at) > 1e-6 for at in law.breaks], axis=0) if law.breaks else np.full(41, True)
        found, expected = one(start + z * span, order), sign**order * LIFT * law(place, order) / span**order
        # The angle rounds by 1e-15 of 20 rad; the next derivative is at most 50 times as large.
        np.testing.assert_allclose(found[clear], expected[clear], rtol=0, atol=1e-11 * np.abs(expected).max() + 1e-30)


def test_return_uses_rise_law_by_default():
    grid = np.linspace(0.0, TURN, 721)
    np.testing.assert_array_equal(event(fall_law=None)(grid, 2), event(fall_law=LAWS["3-4-5"])(grid, 2))


@settings(max_examples=40, deadline=None)
@given(st.floats(-50.0, 50.0), st.floats(-10.0, 10.0), st.integers(0, 3))
def test_phase_shifts_event(phase, angle, order):
    moved, still = event(phase=phase), event(phase=0.0)
    here, there = moved(np.array([angle + phase]), order)[0], still(np.array([angle]), order)[0]
    # Rounding of the angle, 1e-14, times the next derivative; points within the snap of a joint may differ.
    if min(abs((angle - at + math.pi) % TURN - math.pi) for at in still.joints) > 1e-8:
        assert here == pytest.approx(there, abs=1e-11 * LIFT * 60.0)


@pytest.mark.parametrize("phase", [0.0, 0.9, -2.0, 6.0, 40.0])
def test_delayed_event_equals_event_with_phase(phase):
    shifted, moved = DelayedEvent(event(phase=0.0), phase), event(phase=phase)
    grid = np.linspace(-1.0, 7.0, 801)
    for order in range(3):
        size = np.abs(moved(grid, order)).max()
        np.testing.assert_allclose(shifted(grid, order), moved(grid, order), rtol=0, atol=1e-12 * size)
    np.testing.assert_allclose(shifted.joints, moved.joints, rtol=0, atol=1e-12)
    assert shifted.height == moved.height


def test_delayed_harmonic_lift():
    lift = HarmonicLift(0.003, (-0.003,), (0.0,))
    shifted = DelayedEvent(lift, 0.5)
    assert shifted.joints == ()
    np.testing.assert_allclose(shifted(np.array([0.5, 0.5 + math.pi])), [0.0, 0.006], rtol=0, atol=1e-17)
    np.testing.assert_allclose(shifted(np.array([1.3]), 1), lift(np.array([0.8]), 1), rtol=0, atol=1e-17)


@pytest.mark.parametrize("phase", [0.0, -0.4, 6.1, 100.0])
def test_joints_are_sorted_within_one_revolution(phase):
    found = event(phase=phase, ramp=Ramp(1e-4, 0.2)).joints
    assert all(0.0 <= at < TURN for at in found)
    assert list(found) == sorted(found)
    # Both ramps with start or end and take-off, 4; ends of rise and return, 4; two inner ones of the modified sine.
    assert len(found) == 10


def test_segments_are_contiguous():
    parts = event(ramp=Ramp(1e-4, 0.2), closing_ramp=Ramp(2e-4, 0.3)).segments
    assert all(isinstance(one, Segment) for one in parts)
    assert [one.backwards for one in parts] == [False, False, False, True, True]
    assert [one.law is None for one in parts] == [False, False, True, False, False]
    for one, other in pairwise(parts):
        assert one.start + one.span == pytest.approx(other.start, abs=1e-15)
    assert sum(one.span for one in parts) == pytest.approx(0.2 + RISE + DWELL + FALL + 0.3)


def test_segment_values():
    """A rise from 2 mm by 3 mm within 0.5 rad, and its return."""
    up = Segment(1.0, 0.5, 0.002, 0.003, LAWS["3-4-5"])
    down = Segment(1.0, 0.5, 0.002, 0.003, LAWS["3-4-5"], backwards=True)
    at = np.array([1.0, 1.25, 1.5])
    np.testing.assert_allclose(up(at, 0), [0.002, 0.0035, 0.005], rtol=0, atol=1e-17)
    np.testing.assert_allclose(down(at, 0), [0.005, 0.0035, 0.002], rtol=0, atol=1e-17)
    np.testing.assert_allclose(up(at, 1), [0.0, 0.003 / 0.5 * 15 / 8, 0.0], rtol=0, atol=1e-15)
    np.testing.assert_allclose(down(at, 1), [0.0, -0.003 / 0.5 * 15 / 8, 0.0], rtol=0, atol=1e-15)
    np.testing.assert_allclose(Segment(0.0, 1.0, 0.004)(at, 0), 0.004)
    assert not Segment(0.0, 1.0, 0.004)(at, 2).any()


class TestSingleDwell:
    LAW = quinquinomial(1)

    def test_low_reverses_both_laws(self):
        one = LiftEvent(self.LAW, LIFT, RISE, FALL, single_dwell="low", fall_law=quinquinomial(2))
        z = np.linspace(0.01, 0.99, 50)
        np.testing.assert_allclose(one(z * RISE), LIFT * ReversedLaw(self.LAW)(z), rtol=0, atol=1e-16)
        np.testing.assert_allclose(
            one(RISE + z * FALL), LIFT * ReversedLaw(quinquinomial(2))(1 - z), rtol=0, atol=1e-16
        )

    def test_high_does_not_reverse_law(self):
        one = LiftEvent(self.LAW, LIFT, RISE, FALL, dwell=TURN - RISE - FALL, single_dwell="high")
        z = np.linspace(0.01, 0.99, 50)
        np.testing.assert_allclose(one(z * RISE), LIFT * self.LAW(z), rtol=0, atol=1e-16)
        assert one(np.array([0.0]))[0] == 0.0  # a single point is on the base circle
        assert one(np.array([1e-3, TURN - 1e-3])).min() > 0.0

    def test_low_dwell_has_zero_lift(self):
        one = LiftEvent(self.LAW, LIFT, RISE, FALL, single_dwell="low")
        for order in range(5):
            assert not one(np.linspace(RISE + FALL, TURN - 1e-6, 50), order).any()

    @pytest.mark.parametrize(
        ("given", "where", "reason"),
        [
            ({"single_dwell": "low", "dwell": 0.1}, "dwell", "has no upper dwell"),
            ({"single_dwell": "high", "dwell": 1.0}, "rise . dwell . return", "has no lower dwell"),
            ({"single_dwell": "high"}, "rise . dwell . return", "has no lower dwell"),
            ({"single_dwell": "high", "dwell": TURN - RISE - FALL - 0.2, "ramp": Ramp(1e-4, 0.1)}, "ramps",
             "no lower dwell to ramp from"),
        ],
    )  # fmt: skip
    def test_invalid_single_dwell_raises_error(self, given, where, reason):
        with pytest.raises(InputError, match=f"^{where}.*{reason}"):
            LiftEvent(self.LAW, LIFT, RISE, FALL, **given)


@pytest.mark.parametrize(
    "given",
    [
        {"dwell": TURN - RISE - FALL + 1e-6},
        {"dwell": TURN - RISE - FALL - 0.3, "ramp": Ramp(1e-4, 0.2)},  # the same ramp closes: 0.4 in all
        {"dwell": TURN - RISE - FALL - 0.3, "ramp": Ramp(1e-4, 0.1), "closing_ramp": Ramp(1e-4, 0.25)},
        {"dwell": TURN - RISE - FALL, "closing_ramp": Ramp(1e-4, 0.05)},
    ],
)
def test_event_longer_than_revolution_raises_error(given):
    with pytest.raises(
        InputError, match=r"deg in all, expected up to 360 deg of cam angle, ramps included. .* crank angle"
    ):
        event(**given)


def test_full_revolution_is_valid():
    """Rounding of the sum causes no error, and no gap remains at the end of the event."""
    for pieces in (7, 11, 13):
        rise, fall, dwell = (TURN * part / pieces for part in (3, 2, pieces - 5))
        one = LiftEvent(LAWS["cycloidal"], LIFT, rise, fall, dwell=dwell)
        assert one(np.linspace(0.1, TURN - 0.1, 9001)).min() > 0.0


@pytest.mark.parametrize(
    ("changes", "where"), [({"phase": math.nan}, "phase"), ({"phase": math.inf}, "phase"), ({"dwell": -0.1}, "dwell")]
)
def test_invalid_phase_or_dwell_raises_error(changes, where):
    with pytest.raises(InputError, match=f"^{where}:"):
        event(**changes)


def test_argument_is_unchanged_and_shape_preserved(readonly):
    one = event(ramp=Ramp(1e-4, 0.2))
    grid = readonly(np.linspace(-10.0, 10.0, 24).reshape(2, 3, 4))
    for order in range(5):
        assert one(grid, order).shape == (2, 3, 4)


@pytest.mark.parametrize("height", [2e-4, 8e-3])
def test_remedy_for_steep_ramp_works(height):
    """A longer ramp is proposed only if the event with it fits into a revolution."""
    steep = {"dwell": 0.1, "ramp": Ramp(height, 0.01)}
    with pytest.raises(InputError, match=r"ramps: .*continue such a slope") as refused:
        event(**steep)
    remedy = refused.value.faults[0].remedy
    proposed = re.search(r"make the ramp at least ([\d.]+) deg long", remedy)
    assert bool(proposed) == (height < 1e-3)
    if proposed:
        assert event(**{**steep, "ramp": Ramp(height, math.radians(float(proposed[1])))}).height > LIFT
