"""Opening, closing, duration and overlap in crank angles, against the inverse of a law."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from flexcam.cams import (
    LAWS,
    THRESHOLDS,
    HarmonicLift,
    LiftEvent,
    PeriodicSpline,
    Ramp,
    ValveEvent,
    centreline,
    overlap,
    valve_event,
)
from flexcam.core.errors import InputError

CYCLE = 4 * math.pi
LIFT = 0.008
ANGLE = st.floats(0.3, 2.0)


def simple_harmonic(rise, fall, dwell=0.0, phase=0.0):
    return LiftEvent(LAWS["shm"], LIFT, rise, fall, dwell=dwell, phase=phase)


def inverse_simple_harmonic(part):
    """Return z at which simple harmonic motion has gained this fraction of its lift, (1 - cos pi z)/2."""
    return math.acos(1 - 2 * part) / math.pi


@settings(max_examples=20, deadline=None)
@given(ANGLE, ANGLE, st.floats(0.0, 1.0), st.floats(-10.0, 10.0), st.floats(0.02, 0.98))
def test_valve_event_matches_closed_form_of_simple_harmonic(rise, fall, dwell, phase, part):
    found = valve_event(simple_harmonic(rise, fall, dwell, phase), part * LIFT)
    z = inverse_simple_harmonic(part)
    assert found.duration == pytest.approx(2 * (rise * (1 - z) + dwell + fall * (1 - z)), abs=1e-9)
    opens = 2 * (phase + rise * z) % CYCLE
    assert math.remainder(found.opens - opens, CYCLE) == pytest.approx(0.0, abs=1e-9)
    assert 0.0 <= found.opens < CYCLE
    assert 0.0 <= found.centre < CYCLE


@pytest.mark.parametrize("ratio", [0.5, 1.0, 1.6])
@pytest.mark.parametrize("lash", [0.0, 0.25e-3])
def test_ratio_and_lash_change_duration(ratio, lash):
    """The valve lifts ratio times the cam minus the lash: 1 mm requires (1 mm + lash)/ratio at the cam."""
    event = simple_harmonic(1.1, 1.1)
    found = valve_event(event, 1e-3, ratio=ratio, lash=lash)
    z = inverse_simple_harmonic((1e-3 + lash) / ratio / LIFT)
    assert found.duration == pytest.approx(4 * 1.1 * (1 - z), abs=1e-9)
    assert found.lift == 1e-3


def test_centre_of_symmetric_event_is_nose():
    found = valve_event(simple_harmonic(1.0, 1.0, dwell=0.2, phase=0.5), THRESHOLDS["0.05 in"])
    assert found.centre == pytest.approx(2 * (0.5 + 1.0 + 0.1), abs=1e-9)
    beyond = valve_event(simple_harmonic(1.0, 1.0, phase=5.9), 1e-3)
    assert beyond.centre == pytest.approx(2 * (5.9 + 1.0) - CYCLE, abs=1e-9)


@settings(max_examples=20, deadline=None)
@given(ANGLE, ANGLE, st.sampled_from([0.0, 0.01, 0.7]), st.floats(-10.0, 10.0), st.sampled_from(["shm", "4-5-6-7"]))
def test_centreline_is_middle_of_dwell(rise, fall, dwell, phase, law):
    event = LiftEvent(LAWS[law], LIFT, rise, fall, dwell=dwell, phase=phase, ramp=Ramp(0.2e-3, 0.26))
    assert math.remainder(centreline(event) - phase - rise - 0.5 * dwell, 0.5 * CYCLE) == pytest.approx(0, abs=1e-12)


def test_centreline_of_harmonics():
    """The lift 0.004 - 0.003 cos(t - 5) has its maximum at 5 minus half a turn."""
    lift = HarmonicLift(0.004, (-0.003 * math.cos(5.0),), (-0.003 * math.sin(5.0),))
    assert centreline(lift) == pytest.approx(5.0 - math.pi, abs=1e-12)


def test_thresholds():
    assert dict(THRESHOLDS) == pytest.approx({"1 mm": 1e-3, "0.05 in": 1.27e-3}, rel=1e-15)


def test_event_across_end_of_cycle():
    found = valve_event(simple_harmonic(1.0, 1.0, phase=5.5), LIFT / 2)
    assert found.opens == pytest.approx(2 * 6.0, abs=1e-9)
    assert found.closes == pytest.approx(2 * 7.0, abs=1e-9)


@pytest.mark.parametrize("lift", [LIFT, 1.5 * LIFT])
def test_threshold_above_lift_returns_none(lift):
    assert valve_event(simple_harmonic(1.0, 1.0), lift) is None


def test_longest_opening_is_returned():
    """Two lobes per revolution, one raised and one lowered by a first harmonic: the wider opening is returned."""
    lift = HarmonicLift(0.004, (0.001, -0.004), (0.0, 0.0))
    found = valve_event(lift, 0.004)
    grid = np.linspace(0, 2 * math.pi, 100_001)
    above = grid[lift(grid) > 0.004]
    runs = np.split(above, np.flatnonzero(np.diff(above) > 1e-3) + 1)
    longest = max(runs, key=len)
    assert len(runs) == 2
    assert found.opens / 2 == pytest.approx(longest[0], abs=1e-4)
    assert found.closes / 2 == pytest.approx(longest[-1], abs=1e-4)


def test_lash_within_ramp():
    """A lash equal to the ramp height opens at the start of the main lift."""
    ramp = Ramp(0.2e-3, 0.26)
    event = LiftEvent(LAWS["3-4-5"], 0.008, 1.0, 1.0, phase=1.0, ramp=ramp)
    found = valve_event(event, 1e-9, lash=0.2e-3)
    assert found.opens == pytest.approx(2.0, abs=1e-4)
    assert found.closes == pytest.approx(2.0 * 3.0, abs=1e-4)


def test_spline_opens_at_threshold():
    angles = 2 * math.pi / 72 * np.arange(72)
    spline = PeriodicSpline(0.004 * (1 - np.cos(angles)))
    found = valve_event(spline, 0.003)
    crossings = np.array([found.opens, found.closes]) / 2
    np.testing.assert_allclose(spline(crossings), 0.003, rtol=0, atol=1e-15)
    assert spline(np.array([found.centre / 2]))[0] > 0.003


@pytest.mark.parametrize("given", [{"lift": 0.0}, {"lift": -1e-3}, {"ratio": 0.0}, {"lash": -1e-4}, {"lift": math.nan}])
def test_invalid_valve_event_arguments_raise_error(given):
    with pytest.raises(InputError):
        valve_event(simple_harmonic(1.0, 1.0), **({"lift": 1e-3} | given))


OPEN = st.floats(0.0, CYCLE - 1e-6)
SPAN = st.floats(0.1, CYCLE - 0.1)


def count_overlap(one, other, n=20_000):
    """Return the overlap by counting points of the cycle."""
    place = (np.arange(n) + 0.5) * CYCLE / n
    inside = [np.mod(place - event.opens, CYCLE) < event.duration for event in (one, other)]
    return float(np.mean(inside[0] & inside[1]) * CYCLE)


@settings(max_examples=20, deadline=None)
@given(OPEN, SPAN, OPEN, SPAN)
def test_overlap_matches_count(one, first, other, second):
    a, b = ValveEvent(1e-3, one, one + first), ValveEvent(1e-3, other, other + second)
    assert overlap(a, b) == pytest.approx(count_overlap(a, b), abs=4 * CYCLE / 20_000)
    assert overlap(a, b) == pytest.approx(overlap(b, a), abs=1e-12)


@pytest.mark.parametrize("turn", [0.0, 1.0, 5.0, 11.0, 12.0])
def test_overlap_across_end_of_cycle(turn):
    """Exhaust 4 to 8, intake 7 to 11, both shifted: the overlap of 1 is independent of the end of the cycle."""
    exhaust, intake = ((start + turn) % CYCLE for start in (4.0, 7.0))
    assert overlap(ValveEvent(1e-3, exhaust, exhaust + 4), ValveEvent(1e-3, intake, intake + 4)) == pytest.approx(1.0)


def test_overlap_of_cams():
    """Exhaust and intake lobes of 130 deg overlap by 60 deg of cam angle across the end of the revolution."""
    half = math.radians(65)
    exhaust, intake = (simple_harmonic(half, half, phase=math.radians(p)) for p in (270.0, 340.0))
    one, other = (valve_event(cam, 1e-3) for cam in (exhaust, intake))
    still = 2 * half * inverse_simple_harmonic(1e-3 / LIFT)  # crank angle from the foot of a lobe to 1 mm
    assert overlap(one, other) == pytest.approx(2 * math.radians(270 + 130 - 340) - 2 * still, abs=1e-9)


def test_overlap_of_separate_events_is_zero():
    assert overlap(ValveEvent(1e-3, 0.0, 3.0), ValveEvent(1e-3, 3.0, 6.0)) == 0.0
