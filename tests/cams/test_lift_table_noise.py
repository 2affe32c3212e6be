"""What a lift table is trusted with: narrow lobes, outliers, noise on the base circle, points at random."""

from __future__ import annotations

import math

import numpy as np
import pytest

from flexcam.cams import LAWS, LiftEvent, lift_table
from flexcam.cams.lift_table import _find_outliers, _Fit, scatter
from flexcam.core.errors import InputError

TURN, DEGREE = 2 * math.pi, math.radians(1.0)
LOBE = LiftEvent(LAWS["4-5-6-7"], 0.008, 65 * DEGREE, 65 * DEGREE, phase=0.7)
NARROW = LiftEvent(LAWS["4-5-6-7"], 0.008, 2 * DEGREE, 2 * DEGREE, phase=0.7)
FINE = np.linspace(0.0, TURN, 3601)[:-1]


def noise(count, size, seed=0):
    return size * np.random.default_rng(seed).standard_normal(count)


@pytest.mark.parametrize("power", [-6.0, -2.0, 0.0, 3.0, 8.0])
@pytest.mark.parametrize("count", [360, 120])
def test_score_against_its_definition(count, power):
    """Where all points are measured, and where two thirds are points of the base circle that flexcam adds."""
    theta, weight = FINE[::10], 10.0**power
    fit = _Fit(theta, LOBE(theta) + noise(360, 2e-6), count, 200)
    used = np.trace(np.linalg.solve(fit.square + weight * fit.rough, fit.measured))
    assert fit.score(weight) == pytest.approx((fit.rms_change(weight) / (1.0 - 1.4 * used / count)) ** 2, rel=1e-6)


@pytest.mark.slow
@pytest.mark.parametrize("size", [0.0, 2e-6])
def test_a_narrow_lobe_is_kept(size):
    """A rise in 2 deg within 3600 points: 360 knots would flatten it by a part of its height."""
    event, report = lift_table(FINE, NARROW(FINE) + noise(3600, size))
    assert np.abs(event(FINE) - NARROW(FINE)).max() < 0.01 * NARROW.height
    assert report.scatter == pytest.approx(size, rel=0.1, abs=1e-9)
    assert report.largest_change < max(5e-6, 5 * size)
    assert not any("moved" in said for said in report.remarks)


@pytest.mark.slow
def test_a_lobe_that_needs_twice_the_knots_gets_them():
    """A rise in 3 deg: 360 knots would move points by 128 um; where the points allow no more, it is said."""
    theta, lobe = np.arange(1440) * DEGREE / 4, LiftEvent(LAWS["4-5-6-7"], 0.008, 3 * DEGREE, 3 * DEGREE, phase=0.7)
    event, report = lift_table(theta, lobe(theta) + noise(1440, 2e-6))
    assert len(event.event.coefficients) == 720
    assert report.largest_change < 16e-6
    (said, dips) = lift_table(theta[::2], lobe(theta[::2]) + noise(720, 2e-6))[1].remarks
    assert "too few points on the lobe" in said
    assert "below the base circle" in dips


@pytest.mark.slow
def test_a_lobe_too_narrow_is_said():
    """A rise in half a degree, two knots of the finest spline: what is lost is told."""
    event = LiftEvent(LAWS["4-5-6-7"], 0.008, 0.5 * DEGREE, 0.5 * DEGREE, phase=0.7)
    (said, *_) = lift_table(FINE, event(FINE))[1].remarks
    assert "too few points on the lobe" in said


@pytest.mark.slow
def test_an_outlier_is_said():
    theta = FINE[::10]
    lift = LOBE(theta) + noise(360, 2e-6)
    assert lift_table(theta, lift)[1].remarks == ()
    lift[150] += 200e-6
    (said,) = lift_table(theta, lift)[1].remarks
    assert "row 151, at 150 deg" in said
    assert "a lift of 1.307 mm between 1.285 and 0.9468 mm is an outlier" in said
    lift[150] -= 160e-6  # within 1 % of the lift: the spline moves it
    (said,) = lift_table(theta, lift)[1].remarks
    assert "smoothing moves 1 point" in said
    assert "outliers" in said


@pytest.mark.parametrize("law", LAWS)
@pytest.mark.parametrize("points", [72, 360])
def test_sharp_laws_have_no_outliers_and_wild_rows_are_found(law, points):
    theta = np.linspace(0.0, TURN, points + 1)[:-1]
    lift = LiftEvent(LAWS[law], 0.008, 40 * DEGREE, 60 * DEGREE, phase=0.7)(theta)
    assert not _find_outliers(theta, lift, scatter(theta, lift)).size
    lift[points // 5] *= 10.0
    assert _find_outliers(theta, lift, scatter(theta, lift)).tolist() == [points // 5]


def test_scatter_of_uneven_points():
    theta = np.sort(np.random.default_rng(1).uniform(0.0, TURN, 2000))
    assert scatter(theta, LOBE(theta) + noise(2000, 5e-6)) == pytest.approx(5e-6, rel=0.1)


def test_noise_on_the_base_circle_is_no_negative_lift():
    """50 um on 8 mm: one reading in ten thousand lies 0.2 mm below, which noise of that size may do."""
    theta = FINE[::5]
    event, report = lift_table(theta, LOBE(theta) + noise(720, 50e-6))
    assert report.scatter == pytest.approx(50e-6, rel=0.15)
    assert np.abs(event(theta) - LOBE(theta)).max() < 100e-6
    with pytest.raises(InputError, match="reading on the base circle"):
        lift_table(theta, LOBE(theta) + noise(720, 50e-6) - 0.6e-3)


def test_points_at_random():
    """The widest of 400 random steps is 5 deg and more: the lift hardly bends across it."""
    theta = np.sort(np.random.default_rng(7).uniform(0.0, TURN, 400))
    assert np.diff(theta).max() > 3.6 * DEGREE
    event, _ = lift_table(theta, LOBE(theta) + noise(400, 2e-6))
    assert np.abs(event(FINE) - LOBE(FINE)).max() < 20e-6


@pytest.mark.slow
def test_through_more_points_than_knots():
    """A smooth table is followed; a rough one refused with what can be kept."""
    _, report = lift_table(FINE, LOBE(FINE), tolerance=0.0)
    assert report.largest_change < 1e-6
    with pytest.raises(InputError, match="up to 1440 points"):
        lift_table(FINE, LOBE(FINE) + noise(3600, 20e-6), tolerance=0.0)


def test_ripple_below_the_base_circle_is_said():
    """A step of the lift makes a spline through its points swing to both sides."""
    theta = np.arange(180) * 2.0 * DEGREE
    lift = np.where((theta > 1.0) & (theta < 2.0), 0.008, 0.0)
    remarks = lift_table(theta, lift, tolerance=0.0)[1].remarks
    (said,) = [one for one in remarks if "um below the base circle at" in one]
    assert said.endswith("although no point of the table is below it: check the points there")


@pytest.mark.parametrize("seed", [26, 31, 32, 59])
def test_cross_validation_does_not_follow_the_noise(seed):
    """Without the extra weight of the degrees of freedom the acceleration of these tables is 2.8 to 3.2 % off."""
    theta, peak = np.arange(180) * 2.0 * DEGREE, np.abs(LOBE(FINE, 2)).max()
    event, _ = lift_table(theta, LOBE(theta) + noise(180, 2e-6, seed))
    assert np.abs(event(FINE, 2) - LOBE(FINE, 2)).max() < 0.025 * peak
