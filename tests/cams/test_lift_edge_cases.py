"""Edge cases of laws, lifts and lift tables that an earlier version got wrong; docstrings state its error."""

import math

import numpy as np
import pytest

from flexcam.cams import (
    LAWS,
    BSplineLaw,
    CosineSum,
    Harmonic,
    LiftEvent,
    Ramp,
    Scca,
    criteria,
    harmonic_acceleration,
    joints,
    lift_table,
    quinquinomial,
    through_points,
)
from flexcam.core.errors import InputError
from tests.thinning import mostly_slow

TURN, DEGREE = 2 * math.pi, math.radians(1.0)
LOBE = LiftEvent(LAWS["4-5-6-7"], 0.008, 65 * DEGREE, 65 * DEGREE, phase=0.7)
FINE = np.linspace(0.0, TURN, 3601)
PEAK = LOBE(FINE, 2).max()


def full_turn(spacing):
    return np.arange(round(360 / spacing)) * spacing * DEGREE


def lobe_range(spacing):
    return np.arange(LOBE.phase - 2 * DEGREE, LOBE.phase + 132 * DEGREE, spacing * DEGREE)


def noise(count, size=2e-6, seed=0):
    return size * np.random.default_rng(seed).standard_normal(count)


@pytest.mark.slow
# 1 -- lift_table: the tolerance
@pytest.mark.parametrize("spacing", [0.25, 0.5])
def test_tolerance_holds_with_more_points_than_knots(spacing):
    """The earlier version fitted 720 or 1440 noisy points with 360 knots: rms 1.4 to 8.5 times the tolerance."""
    theta = full_turn(spacing)
    _, report = lift_table(theta, LOBE(theta) + noise(len(theta)), tolerance=1e-6)
    assert report.rms_change <= 1e-6 * 1.001


@pytest.mark.parametrize("spacing", [0.5, 1.0, 2.0])
def test_tolerance_holds_with_added_base_circle(spacing):
    """The earlier version counted the added points in the mean square: rms 1.2 to 2.1 times the tolerance."""
    theta = lobe_range(spacing)
    _, report = lift_table(theta, LOBE(theta) + noise(len(theta)), tolerance=2e-6)
    assert report.rms_change <= 2e-6 * 1.001


# 2 -- lift_table: ill-conditioned or underdetermined fits
@pytest.mark.parametrize("spacing", [pytest.param(0.25, marks=pytest.mark.slow), 2.0, 3.0])
def test_interpolation_of_lobe_range(spacing):
    """Acceleration wrong by 100 %, 10 %, 18 % of its peak; the full-turn table of the same points is right to 1 %."""
    theta = lobe_range(spacing)
    event, _ = lift_table(theta, LOBE(theta), tolerance=0.0)
    assert np.abs(event(FINE, 2) - LOBE(FINE, 2)).max() < 0.02 * PEAK


@pytest.mark.parametrize("seed", mostly_slow(range(8)))
def test_smoothing_of_coarse_lobe_range(seed):
    """2 deg, 5 um: the error of the worst of eight seeds is 70 %, that of plain differences at most 46 %."""
    theta = lobe_range(2.0)
    event, _ = lift_table(theta, LOBE(theta) + noise(len(theta), 5e-6, seed))
    assert np.abs(event(FINE, 2) - LOBE(FINE, 2)).max() < 0.1 * PEAK


@pytest.mark.parametrize("part", [0.4999, 0.49999, 0.499999])
@pytest.mark.parametrize("spacing", [1.0, 2.0])
def test_start_angle_of_even_table_does_not_matter(spacing, part):
    """As many knots as points, half a spacing from them, is singular: 4 % and 45 % off, with noise 3500-fold."""
    theta = full_turn(spacing)
    zero = part * spacing * DEGREE
    event, _ = lift_table(theta + zero, LOBE(theta), tolerance=0.0)
    assert np.abs(event(FINE + zero, 2) - LOBE(FINE, 2)).max() < 0.005 * PEAK


# 3 -- lift_table: the ends of the table
def test_gap_at_ends_of_table_raises_error():
    """15 deg missing at the nose, where the table starts: accepted, with 13 times the true acceleration."""
    theta = LOBE.phase + 65 * DEGREE + np.arange(8, 353) * DEGREE
    with pytest.raises(InputError, match=r"no point between|does not close|base circle"):
        lift_table(theta, LOBE(theta))


def test_open_lift_before_360_deg_raises_error():
    """The lift is 0 mm at 0 deg and 5 mm at 350 deg."""
    with pytest.raises(InputError):
        lift_table(np.arange(351) * DEGREE, np.linspace(0.0, 0.005, 351))


# 4 -- lift_table: messages
@pytest.mark.parametrize("column", [0, 1])
def test_nan_error_names_row_and_remedy(column):
    table = [full_turn(2.0), LOBE(full_turn(2.0))]
    table[column][6] = math.nan
    with pytest.raises(InputError) as refusal:
        lift_table(*table)
    assert "row 7" in refusal.value.faults[0].where
    assert refusal.value.faults[0].remedy


@pytest.mark.parametrize("lift", [LOBE(full_turn(2.0))[:-1], np.zeros(180)], ids=["one value short", "no lift"])
def test_lift_errors_have_remedy(lift):
    with pytest.raises(InputError) as refusal:
        lift_table(full_turn(2.0), lift)
    assert refusal.value.faults[0].remedy


# 5 -- joints
@pytest.mark.parametrize("rise", [3.9, 4.1, 5.0])
def test_inner_steps_of_long_rise(rise):
    """Beyond 4 rad the 4e-9 rad next to the joint is within the snap of 1e-9 of the rise: the step is lost."""
    found = joints(LiftEvent(LAWS["parabolic"], 1.0, rise, 1.0))
    assert found[1].steps[2] == pytest.approx(-8.0 / rise**2, rel=1e-6)


# 6 -- events
def test_closing_ramp_without_lower_dwell_raises_error():
    with pytest.raises(InputError, match="no lower dwell"):
        LiftEvent(quinquinomial(1), 0.008, math.pi, math.pi - 0.2, closing_ramp=Ramp(2e-4, 0.2), single_dwell="high")


def test_unknown_single_dwell_raises_error():
    with pytest.raises(InputError, match="single_dwell"):
        LiftEvent(quinquinomial(1), 0.008, 1.0, 1.0, single_dwell="upper")


def test_closing_ramp_error_allows_no_negative_slope():
    with pytest.raises(InputError) as refusal:
        LiftEvent(LAWS["3-4-5"], 0.008, 1.0, 1.0, closing_ramp=Ramp(9e-3, 0.5))
    assert "-" not in refusal.value.faults[0].allowed


# 7 -- laws
@pytest.mark.parametrize(
    "make",
    [
        lambda: BSplineLaw((0.0, 0.0, 0.0, 0.5, 1.0, 1.0, 1.0), 5, (math.nan,)),
        lambda: through_points((0.0, math.nan, 1.0), (0.0, 0.5, 1.0)),  # a bare ValueError of scipy's
        lambda: harmonic_acceleration((math.nan,)),
        lambda: Harmonic(((1, math.nan),)),
        lambda: Harmonic(((0, 1.0),)),  # ZeroDivisionError when evaluated
        lambda: Harmonic(((1.5, 1.0),)),  # s(1) is not 1
        lambda: Scca(math.nan, 0.5, 0.5),
        lambda: CosineSum((1.0,)),  # s = 1 for all z
        lambda: CosineSum((math.nan, 0.5)),
    ],
    ids=[
        "nan knot",
        "nan place",
        "nan amplitude",
        "nan coefficient",
        "order 0",
        "order 1.5",
        "nan part",
        "no law",
        "nan",
    ],
)
def test_invalid_law_parameters_raise_error(make):
    with pytest.raises(InputError):
        make()


def test_scca_value_at_last_joint_is_right_limit():
    """The reversed 1 - b/2 = 0.85 is 0.15000000000000002 and not b/2: the value was the left limit, 0."""
    law = Scca(0.3, 0.2, 0.5)
    here, right = law(np.array([law.breaks[-1], law.breaks[-1] + 1e-9]), 4)
    assert here == pytest.approx(right, rel=1e-6)


# 8 -- criteria, heights, events
def test_signs_of_joint_steps_and_criteria_agree():
    """joints: right minus left, +4.93 where the rise ends; criteria.broken: 'by -4.9348 at z = 1'."""
    step = joints(LiftEvent(LAWS["shm"], 1.0, 1.0, 1.0, 1.0))[1].steps[2]
    assert f"by {step:+.6g} at z = 1" in criteria(LAWS["shm"]).violations[0]
