"""Noisy lift tables: narrow lobes, outliers, noise on the base circle, random points."""

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
def test_score_matches_definition(count, power):
    """All points are measured, or two thirds are base-circle points that flexcam adds."""
    theta, weight = FINE[::10], 10.0**power
    fit = _Fit(theta, LOBE(theta) + noise(360, 2e-6), count, 200)
    used = np.trace(np.linalg.solve(fit.square + weight * fit.rough, fit.measured))
    assert fit.score(weight) == pytest.approx((fit.rms_change(weight) / (1.0 - 1.4 * used / count)) ** 2, rel=1e-6)


@pytest.mark.slow
@pytest.mark.parametrize("size", [0.0, 2e-6])
def test_narrow_lobe_is_preserved(size):
    """A rise in 2 deg within 3600 points: 360 knots would flatten the lobe noticeably."""
    event, report = lift_table(FINE, NARROW(FINE) + noise(3600, size))
    assert np.abs(event(FINE) - NARROW(FINE)).max() < 0.01 * NARROW.height
    assert report.scatter == pytest.approx(size, rel=0.1, abs=1e-9)
    assert report.largest_change < max(5e-6, 5 * size)
    assert not any("moved" in remark for remark in report.remarks)


@pytest.mark.slow
def test_knots_are_doubled_for_narrow_lobe():
    """A rise in 3 deg: 360 knots would move points by 128 um; a coarser table causes a remark."""
    theta, lobe = np.arange(1440) * DEGREE / 4, LiftEvent(LAWS["4-5-6-7"], 0.008, 3 * DEGREE, 3 * DEGREE, phase=0.7)
    event, report = lift_table(theta, lobe(theta) + noise(1440, 2e-6))
    assert len(event.event.coefficients) == 720
    assert report.largest_change < 16e-6
    (remark, dips) = lift_table(theta[::2], lobe(theta[::2]) + noise(720, 2e-6))[1].remarks
    assert "too few points on the lobe" in remark
    assert "below the base circle" in dips


@pytest.mark.slow
def test_too_narrow_lobe_causes_remark():
    """A rise in half a degree, two knots of the finest spline: a remark states the loss."""
    event = LiftEvent(LAWS["4-5-6-7"], 0.008, 0.5 * DEGREE, 0.5 * DEGREE, phase=0.7)
    (remark, *_) = lift_table(FINE, event(FINE))[1].remarks
    assert "too few points on the lobe" in remark


@pytest.mark.slow
def test_outlier_causes_remark():
    theta = FINE[::10]
    lift = LOBE(theta) + noise(360, 2e-6)
    assert lift_table(theta, lift)[1].remarks == ()
    lift[150] += 200e-6
    (remark,) = lift_table(theta, lift)[1].remarks
    assert "row 151, at 150 deg" in remark
    assert "a lift of 1.307 mm between 1.285 and 0.9468 mm is an outlier" in remark
    lift[150] -= 160e-6  # within 1 % of the lift: the spline moves it
    (remark,) = lift_table(theta, lift)[1].remarks
    assert "smoothing moves 1 point" in remark
    assert "outliers" in remark


@pytest.mark.parametrize("law", LAWS)
@pytest.mark.parametrize("points", [72, 360])
def test_outliers_of_sharp_laws(law, points):
    theta = np.linspace(0.0, TURN, points + 1)[:-1]
    lift = LiftEvent(LAWS[law], 0.008, 40 * DEGREE, 60 * DEGREE, phase=0.7)(theta)
    assert not _find_outliers(theta, lift, scatter(theta, lift)).size
    lift[points // 5] *= 10.0
    assert _find_outliers(theta, lift, scatter(theta, lift)).tolist() == [points // 5]


def test_scatter_of_uneven_points():
    theta = np.sort(np.random.default_rng(1).uniform(0.0, TURN, 2000))
    assert scatter(theta, LOBE(theta) + noise(2000, 5e-6)) == pytest.approx(5e-6, rel=0.1)


def test_noise_on_base_circle_is_not_negative_lift():
    """50 um on 8 mm: one reading in ten thousand is 0.2 mm below zero, as expected for such noise."""
    theta = FINE[::5]
    event, report = lift_table(theta, LOBE(theta) + noise(720, 50e-6))
    assert report.scatter == pytest.approx(50e-6, rel=0.15)
    assert np.abs(event(theta) - LOBE(theta)).max() < 100e-6
    with pytest.raises(InputError, match="reading on the base circle"):
        lift_table(theta, LOBE(theta) + noise(720, 50e-6) - 0.6e-3)


def test_random_points():
    """The maximum of 400 random steps is 5 deg or more: the lift is nearly straight across it."""
    theta = np.sort(np.random.default_rng(7).uniform(0.0, TURN, 400))
    assert np.diff(theta).max() > 3.6 * DEGREE
    event, _ = lift_table(theta, LOBE(theta) + noise(400, 2e-6))
    assert np.abs(event(FINE) - LOBE(FINE)).max() < 20e-6


@pytest.mark.slow
def test_interpolation_with_more_points_than_knots():
    """A smooth table is interpolated; the error of a rough one states the number of points allowed."""
    _, report = lift_table(FINE, LOBE(FINE), tolerance=0.0)
    assert report.largest_change < 1e-6
    with pytest.raises(InputError, match="up to 1440 points"):
        lift_table(FINE, LOBE(FINE) + noise(3600, 20e-6), tolerance=0.0)


def test_ripple_below_base_circle_causes_remark():
    """An interpolating spline overshoots on both sides of a step of the lift."""
    theta = np.arange(180) * 2.0 * DEGREE
    lift = np.where((theta > 1.0) & (theta < 2.0), 0.008, 0.0)
    remarks = lift_table(theta, lift, tolerance=0.0)[1].remarks
    (remark,) = [one for one in remarks if "um below the base circle at" in one]
    assert remark.endswith("although no point of the table is below it: check the points there, or add some")


@pytest.mark.parametrize("seed", [26, 31, 32, 59])
def test_cross_validation_does_not_overfit_noise(seed):
    """Without the extra weight of the degrees of freedom the acceleration error of these tables is 2.8 to 3.2 %."""
    theta, peak = np.arange(180) * 2.0 * DEGREE, np.abs(LOBE(FINE, 2)).max()
    event, _ = lift_table(theta, LOBE(theta) + noise(180, 2e-6, seed))
    assert np.abs(event(FINE, 2) - LOBE(FINE, 2)).max() < 0.025 * peak


def test_zeros_on_base_circle_do_not_hide_noise():
    """A table whose base circle was set to zero has noise on the lobe alone."""
    theta = np.arange(720) * 0.5 * DEGREE
    lift = np.where(LOBE(theta) > 0.0, LOBE(theta) + noise(720, 2e-6), 0.0)
    assert np.mean(lift == 0.0) > 0.5
    report = lift_table(theta, lift)[1]
    assert report.scatter == pytest.approx(2e-6, rel=0.3)
    assert not any("smoothing moves" in remark for remark in report.remarks)
