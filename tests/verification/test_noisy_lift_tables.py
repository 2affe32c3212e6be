"""Smoothing of a measured lift: a known lobe with known noise, the acceleration before and after.

The lobe is a 4-5-6-7 polynomial of 8 mm in 65 deg up and down, so that the exact lift is known everywhere; the noise is
Gaussian, of 0.5 to 5 um as of a lift gauge. Second differences of points h apart have the noise sqrt(6) noise/h^2, the
error of an acceleration from an unsmoothed table at fine spacing.
"""

import math

import numpy as np
import pytest

from flexcam.cams import LAWS, LiftEvent, lift_table
from tests.thinning import mostly_slow

SOURCE = "Measured lift with known noise, 8 mm lobe of 130 deg"
DEGREE = math.radians(1.0)
LOBE = LiftEvent(LAWS["4-5-6-7"], 0.008, 65 * DEGREE, 65 * DEGREE, phase=0.7)
FINE = np.linspace(0.0, 2 * math.pi, 3601)
EXACT_ACCELERATION = LOBE(FINE, 2)
PEAK_ACCELERATION = EXACT_ACCELERATION.max()
ERROR_BOUNDS = {0.5: 0.025, 2.0: 0.04, 5.0: 0.06}
"""Maximum error of the acceleration over its peak, by noise in um: 1.25 times the worst of eight seeds."""


def table_angles(spacing, part="whole", uneven=0.0, seed=0):
    full_turn = np.arange(round(360 / spacing)) * spacing * DEGREE
    lobe = np.arange(LOBE.phase - 2 * DEGREE, LOBE.phase + 132 * DEGREE, spacing * DEGREE)
    even = full_turn if part == "whole" else lobe
    return even + uneven * spacing * DEGREE * np.random.default_rng(seed + 1).uniform(-1, 1, len(even))


CASES = [
    pytest.param(spacing, "whole", 0.0, noise, id=f"{spacing:g} deg, noise {noise:g} um")
    for spacing, noises in ((0.25, [2.0]), (0.5, [0.5, 5.0]), (1.0, ERROR_BOUNDS), (2.0, ERROR_BOUNDS))
    for noise in noises
] + [
    pytest.param(1.0, "whole", 0.4, 2.0, id="1 deg, uneven by 40 %, noise 2 um"),
    pytest.param(2.0, "whole", 0.3, 2.0, id="2 deg, uneven by 30 %, noise 2 um"),
    pytest.param(0.5, "lobe", 0.0, 2.0, id="0.5 deg, the lobe alone, noise 2 um"),
    pytest.param(1.0, "lobe", 0.0, 2.0, id="1 deg, the lobe alone, noise 2 um"),
    pytest.param(1.0, "lobe", 0.4, 2.0, id="1 deg, the lobe alone, uneven by 40 %, noise 2 um"),
]


@pytest.mark.parametrize(("spacing", "part", "uneven", "noise"), mostly_slow(CASES))
def test_acceleration_error_of_noisy_table(spacing, part, uneven, noise, record, request):
    theta = table_angles(spacing, part, uneven)
    wrong = noise * 1e-6 * np.random.default_rng(0).standard_normal(len(theta))
    event, report = lift_table(theta, LOBE(theta) + wrong)
    case, error = request.node.callspec.id, np.abs(event(FINE, 2) - EXACT_ACCELERATION).max() / PEAK_ACCELERATION
    record(source=SOURCE, case=case, quantity="largest error of the acceleration over its peak", unit="1",
           reference=0.0, computed=round(error, 5), tolerance=ERROR_BOUNDS[noise], absolute=True,
           reason="worst of eight seeds, and a quarter more")  # fmt: skip
    record(source=SOURCE, case=case, quantity="root mean square change of the points", unit="um", reference=noise,
           computed=round(1e6 * report.rms_change, 4), tolerance=0.3,
           reason="the noise is taken away but for what the curve itself, of some 50 numbers, can follow")  # fmt: skip
    # Before smoothing the error of the differences follows from the noise, and the report contains it.
    raw = max(report.acceleration_before[1], -report.acceleration_before[0])
    after = max(report.acceleration_after[1], -report.acceleration_after[0])
    assert after == pytest.approx(PEAK_ACCELERATION, rel=ERROR_BOUNDS[noise])
    assert raw > 0.9 * PEAK_ACCELERATION
    if math.sqrt(6) * noise * 1e-6 / (spacing * DEGREE) ** 2 > PEAK_ACCELERATION:
        assert raw > 2.0 * PEAK_ACCELERATION


@pytest.mark.parametrize("spacing", [0.25, 0.5, 1.0])
def test_noise_of_second_differences(spacing, record):
    """On the base circle the exact acceleration is zero, which gives the noise in closed form."""
    theta, noise = table_angles(spacing), 2e-6
    lift = LOBE(theta) + noise * np.random.default_rng(7).standard_normal(len(theta))
    flat = lift[theta > LOBE.phase + 131 * DEGREE]
    found = np.std(np.diff(flat, 2)) / (spacing * DEGREE) ** 2
    record(source=SOURCE, case=f"{spacing:g} deg, noise 2 um", unit="mm/rad^2",
           quantity="noise of second differences", reference=1e3 * math.sqrt(6) * noise / (spacing * DEGREE) ** 2,
           computed=1e3 * found, tolerance=0.2, reason="an estimate from 190 points or more varies by 7 %")  # fmt: skip


@pytest.mark.parametrize("spacing", mostly_slow([0.5, 0.25, 2.0, 1.0], 2))
def test_smooth_table_is_unchanged(spacing, record):
    """Without noise the default smoothing leaves the points unchanged."""
    theta = table_angles(spacing)
    event, report = lift_table(theta, LOBE(theta))
    record(source=SOURCE, case=f"{spacing:g} deg, no noise", quantity="root mean square change of the points",
           unit="um", reference=0.0, computed=round(1e6 * report.rms_change, 4), tolerance=0.02, absolute=True,
           reason="a hundredth of a gauge's noise")  # fmt: skip
    record(source=SOURCE, case=f"{spacing:g} deg, no noise", quantity="largest error of the acceleration over its peak",
           unit="1", reference=0.0,
           computed=round(np.abs(event(FINE, 2) - EXACT_ACCELERATION).max() / PEAK_ACCELERATION, 5), tolerance=0.01,
           absolute=True, reason="spline of that spacing where the jerk's slope steps")  # fmt: skip


@pytest.mark.slow
def test_second_order_convergence_with_spacing(fitted_order, record):
    """The spline passes through smooth points; the fourth derivative of the lobe jumps at its ends: second order."""
    spacings = np.array([4.0, 2.0, 1.0, 0.5])
    errors = []
    for spacing in spacings:
        theta = table_angles(spacing)
        event, _ = lift_table(theta, LOBE(theta), tolerance=0.0)
        errors.append(np.abs(event(FINE, 2) - EXACT_ACCELERATION).max() / PEAK_ACCELERATION)
    record(source=SOURCE, case="through smooth points", quantity="order of the acceleration in the spacing", unit="1",
           reference=2.0, computed=round(fitted_order(spacings, errors), 4), tolerance=0.3, absolute=True,
           reason="fourth derivative jumps at the ends of the lobe, between points")  # fmt: skip
