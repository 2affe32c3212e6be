"""Lift tables: exact interpolation, and invariance to order, origin and unit of the table."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from flexcam.cams import LAWS, HarmonicLift, LiftEvent, PeriodicSpline, lift_table
from tests.thinning import mostly_slow

TURN = 2 * math.pi
DEGREE = math.radians(1.0)
LOBE = LiftEvent(LAWS["4-5-6-7"], 0.008, 65 * DEGREE, 65 * DEGREE, phase=0.7)
WAVE = HarmonicLift(0.0045, (-0.003, -0.0012), (0.0005, -0.0002))
FINE = np.linspace(0.0, TURN, 3601)
NOISE = 2e-6


def angles(spacing, start=0.0, uneven=0.0, seed=3):
    even = start + np.arange(round(360 / spacing)) * spacing * DEGREE
    return even + uneven * spacing * DEGREE * np.random.default_rng(seed).uniform(-1, 1, len(even))


def noisy_lift(theta, seed=0):
    return LOBE(theta) + NOISE * np.random.default_rng(seed).standard_normal(len(theta))


@pytest.fixture(scope="module")
def measured_table():
    theta = angles(1.0)
    return theta, noisy_lift(theta), *lift_table(theta, noisy_lift(theta))


@pytest.mark.parametrize(("spacing", "uneven"), [(0.5, 0.3), (1.0, 0.0), (1.0, 0.3), (2.0, 0.3)])
def test_zero_tolerance_interpolates_points(spacing, uneven):
    """The fourth derivative of the lobe jumps: between the points the error is of order 2 in the spacing."""
    theta = angles(spacing, uneven=uneven)
    event, report = lift_table(theta, LOBE(theta), tolerance=0.0)
    np.testing.assert_allclose(event(theta), LOBE(theta), rtol=0, atol=1e-12 * LOBE.height)
    assert report.largest_change <= 1e-12 * LOBE.height
    assert report.points == len(theta)
    truth = LOBE(FINE, 2)
    assert np.abs(event(FINE) - LOBE(FINE)).max() < 1e-6 * max(1.0, spacing) ** 2 * LOBE.height
    assert np.abs(event(FINE, 2) - truth).max() < 0.002 * max(1.0, spacing) ** 2 * truth.max()


@pytest.mark.parametrize("order", range(5))
@pytest.mark.parametrize("points", [24, 72, 73, 360])
def test_derivatives_of_interpolated_harmonic_lift(points, order):
    """Two harmonics through n points: the error of a spline of degree 5 is below (spacing in rad)^(6 - order)."""
    theta = np.arange(points) * TURN / points
    event, _ = lift_table(theta, WAVE(theta), tolerance=0.0)
    size = np.abs(WAVE(FINE, order)).max()
    assert np.abs(event(FINE, order) - WAVE(FINE, order)).max() < (TURN / points) ** (6 - order) * size


def test_spline_round_trip_on_its_knots():
    """The samples are at the knots: no interpolation error."""
    c = 0.004 + 0.003 * np.random.default_rng(2).random(60)
    spline = PeriodicSpline(c)
    theta = TURN / 60 * np.arange(60)
    event, _ = lift_table(theta, spline(theta), tolerance=0.0)
    np.testing.assert_allclose(event.event.coefficients, c, rtol=0, atol=1e-9)


def test_repeated_first_row_at_end_is_ignored():
    theta = angles(2.0)
    once, _ = lift_table(theta, LOBE(theta), tolerance=0.0)
    twice, report = lift_table([*theta, TURN], [*LOBE(theta), LOBE(np.zeros(1))[0]], tolerance=0.0)
    np.testing.assert_allclose(twice(FINE, 2), once(FINE, 2), rtol=0, atol=1e-12)
    assert report.points == 180


@pytest.mark.parametrize("first", [60])
def test_first_row_does_not_matter(first, measured_table):
    """The first row may be in the middle of the lobe (40 to 170 deg), with angles beyond one revolution."""
    theta, lift, event, report = measured_table
    turned = np.concatenate([theta[first:], theta[:first] + TURN])
    other, again = lift_table(turned, np.roll(lift, -first))
    np.testing.assert_allclose(other(FINE, 2), event(FINE, 2), rtol=0, atol=1e-9 * np.abs(event(FINE, 2)).max())
    assert again.rms_change == pytest.approx(report.rms_change, rel=1e-9)
    assert again.smoothing == report.smoothing


@pytest.mark.parametrize("turns", [-2])
def test_full_turns_do_not_matter(turns, measured_table):
    theta, lift, event, _ = measured_table
    other, _ = lift_table(theta + turns * TURN, lift)
    np.testing.assert_allclose(other(FINE, 2), event(FINE, 2), rtol=0, atol=1e-9 * np.abs(event(FINE, 2)).max())


@settings(max_examples=10, deadline=None)
@given(st.integers(-400, 400), st.floats(-0.4, 0.4))
def test_zero_of_angle_does_not_matter(rows, part):
    """Another zero of the angle shifts the knots, which changes the curve by its own small error only.

    The shift is up to 0.4 of a spacing: at half a spacing, interpolation does not determine the alternating part of
    the coefficients.
    """
    theta, zero = angles(2.0), (rows + part) * 2.0 * DEGREE
    here, _ = lift_table(theta, LOBE(theta), tolerance=0.0)
    there, _ = lift_table(theta + zero, LOBE(theta), tolerance=0.0)
    peak = np.abs(LOBE(FINE, 2)).max()
    np.testing.assert_allclose(there(FINE + zero), here(FINE), rtol=0, atol=2e-6 * LOBE.height)
    np.testing.assert_allclose(there(FINE + zero, 2), here(FINE, 2), rtol=0, atol=0.005 * peak)


@pytest.mark.parametrize(("scale", "tolerance"), [(1e-3, None), pytest.param(1e3, 1.5 * NOISE, marks=pytest.mark.slow)])
def test_fit_scales_with_unit_of_lift(scale, tolerance):
    theta = angles(1.0)
    one, first = lift_table(theta, noisy_lift(theta), tolerance=tolerance)
    other, second = lift_table(
        theta, scale * noisy_lift(theta), tolerance=None if tolerance is None else scale * tolerance
    )
    for order in (0, 2, 4):
        size = np.abs(one(FINE, order)).max()
        np.testing.assert_allclose(other(FINE, order) / scale, one(FINE, order), rtol=0, atol=1e-6 * size)
    assert second.rms_change == pytest.approx(scale * first.rms_change, rel=1e-6)
    assert second.largest_change == pytest.approx(scale * first.largest_change, rel=1e-6)
    assert second.smoothing == pytest.approx(first.smoothing, rel=1e-6)


@pytest.mark.parametrize("tolerance", mostly_slow([0.2e-6, 1e-6, 2e-6, 5e-6, 50e-6]))
@pytest.mark.parametrize("spacing", [1.0, 2.0])
def test_rms_change_equals_tolerance(spacing, tolerance):
    """The fit uses all of the tolerance, because less smoothing is rougher than necessary."""
    theta = angles(spacing)
    event, report = lift_table(theta, noisy_lift(theta), tolerance=tolerance)
    changed = np.sqrt(np.mean((event(theta) - noisy_lift(theta)) ** 2))
    assert report.rms_change == pytest.approx(changed, rel=1e-9)
    assert 0.999 * tolerance <= changed <= tolerance * (1 + 1e-9)


def test_larger_tolerance_is_smoother():
    theta = angles(1.0)
    found = [lift_table(theta, noisy_lift(theta), tolerance=t) for t in (0.5e-6, 2e-6, 8e-6)]
    assert [report.smoothing for _, report in found] == sorted(report.smoothing for _, report in found)
    roughness = [np.mean(event(FINE, 3) ** 2) for event, _ in found]
    assert roughness == sorted(roughness, reverse=True)


def test_default_tolerance_estimates_noise(measured_table):
    *_, report = measured_table
    assert report.rms_change == pytest.approx(NOISE, rel=0.15)  # 5 % is chance, 10 % is noise that the curve can follow


def test_report_names_worst_point():
    """One reading of a smooth table is 60 um too high."""
    theta = angles(1.0)
    lift = noisy_lift(theta)
    lift[137] += 60e-6
    event, report = lift_table(theta, lift, tolerance=6e-6)
    assert report.at == theta[137]
    assert report.largest_change == pytest.approx(abs(event(theta[137:138])[0] - lift[137]), rel=1e-12)
    assert report.largest_change > 30e-6


def test_report_of_acceleration_before_fit():
    """Parabolic motion: differences of uneven points are +-4 lift/rise^2 within each piece."""
    cam = LiftEvent(LAWS["parabolic"], 0.008, 1.1, 1.1, phase=0.3)
    theta = angles(1.0, uneven=0.3)
    _, report = lift_table(theta, cam(theta), tolerance=0.0)
    a = 4 * 0.008 / 1.1**2
    assert report.acceleration_before == pytest.approx((-a, a), rel=1e-6)
    assert report.acceleration_after[0] < -a < a < report.acceleration_after[1]  # a spline overshoots a step


def test_report_of_acceleration_after_fit(measured_table):
    _, _, event, report = measured_table
    found = event(np.linspace(0.0, TURN, 20_001), 2)
    assert report.acceleration_after == pytest.approx((found.min(), found.max()), rel=1e-4)


@pytest.mark.parametrize("spacing", [0.5, 1.0])
def test_angles_outside_table_are_base_circle(spacing):
    """The table covers 2 deg before the lobe to 2 deg after it."""
    theta = np.arange(LOBE.phase - 2 * DEGREE, LOBE.phase + 132 * DEGREE, spacing * DEGREE)
    event, report = lift_table(theta, LOBE(theta))
    rest = LOBE.phase + np.linspace(140 * DEGREE, 350 * DEGREE, 500)
    assert np.abs(event(rest)).max() < 1e-5 * LOBE.height
    assert np.abs(event(rest, 2)).max() < 2e-3 * np.abs(LOBE(FINE, 2)).max()
    assert report.points == len(theta)
    np.testing.assert_allclose(event(FINE), LOBE(FINE), rtol=0, atol=1e-5 * LOBE.height)


@pytest.mark.parametrize("tolerance", [None, 0.0, 1e-6])
def test_arguments_are_unchanged(tolerance, readonly):
    theta, lift = angles(5.0), LOBE(angles(5.0))
    lift_table(readonly(theta), readonly(lift), tolerance=tolerance)
    kept = theta.copy(), lift.copy()
    event, _ = lift_table(theta, lift, tolerance=tolerance)
    np.testing.assert_array_equal(theta, kept[0])
    np.testing.assert_array_equal(lift, kept[1])
    before = event(FINE)
    theta += 1.0
    lift[:] = 0.0
    np.testing.assert_array_equal(event(FINE), before)


def test_lists_of_integers_are_valid():
    theta = np.linspace(0, 6, 40).tolist()
    event, report = lift_table(theta, [0] * 15 + [1, 3, 6, 8, 9, 9, 8, 6, 3, 1] + [0] * 15, tolerance=0)
    assert report.points == 40
    assert event.height > 9.0
