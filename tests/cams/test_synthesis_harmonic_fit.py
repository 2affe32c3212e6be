"""Lifts of a few harmonics: minimum deviation, within the tolerance in the dwells."""

import math
import re

import numpy as np
import pytest

from flexcam.cams import LAWS, HarmonicLift, LiftEvent, Ramp, harmonic_fit, harmonics_below
from flexcam.core.errors import InputError
from flexcam.core.units import parse

WANTED = LiftEvent(LAWS["3-4-5"], lift=0.006, rise=1.5, fall=1.3, dwell=1.0, phase=0.4)
GRID = np.linspace(0.0, 2 * math.pi, 7201)[:-1]
STEP = 2 * math.pi / 720
"""Step of the 720 angles that the fit uses up to 30 harmonics."""

TIGHT = [(8, 1.5e-5), (10, 1e-5), (16, 2e-6)]
"""Counts and tolerances (m) that unconstrained least squares violates."""


def grid_deviation(event):
    return event(GRID) - WANTED(GRID)


def interpolation_error(event, where):
    """Return the maximum excess of a deviation between grid angles: step^2/8 of its second derivative."""
    return STEP**2 / 8 * np.abs(event(GRID[where], 2) - WANTED(GRID[where], 2)).max()


def in_dwell(angle):
    return (np.abs(WANTED(angle, 1)) + np.abs(WANTED(angle, 2))) < 1e-12


def least_squares_lift(count):
    """Return the least-squares lift without constraints, by the Fourier series on the fit's own grid."""
    samples = np.fft.rfft(WANTED(np.arange(720) * STEP)) / 720
    return HarmonicLift(
        float(samples[0].real), tuple((2 * samples[1 : count + 1].real).tolist()),
        tuple((-2 * samples[1 : count + 1].imag).tolist()),
    )  # fmt: skip


@pytest.mark.parametrize(("count", "tolerance"), TIGHT)
def test_tolerance_holds_between_fit_angles(count, tolerance):
    """A dwell starts and ends between two angles, which adds one step of the slope."""
    fit = harmonic_fit(WANTED, count, tolerance=tolerance)
    held = in_dwell(GRID)
    excess = interpolation_error(fit.event, held) + STEP * np.abs(fit.event(GRID[held], 1)).max()
    assert np.abs(grid_deviation(fit.event))[held].max() <= tolerance + excess
    assert np.abs(grid_deviation(fit.event))[held].max() <= 1.05 * tolerance  # the total excess is small
    assert fit.strict_deviation <= tolerance * (1 + 1e-7)
    assert np.abs(grid_deviation(least_squares_lift(count)))[held].max() > 1.2 * tolerance  # the constraint was needed


@pytest.mark.parametrize(("count", "tolerance"), TIGHT)
def test_reported_deviations_match_lift(count, tolerance):
    fit = harmonic_fit(WANTED, count, tolerance=tolerance)
    miss = np.abs(grid_deviation(fit.event))
    assert len(fit.event.cosine) == count
    assert miss.max() == pytest.approx(fit.deviation, rel=2e-3)
    assert miss[in_dwell(GRID)].max() == pytest.approx(fit.strict_deviation, rel=5e-2)
    assert np.sqrt((miss[~in_dwell(GRID)] ** 2).mean()) == pytest.approx(fit.rms_deviation, rel=5e-3)
    assert fit.rms_deviation < fit.deviation


@pytest.mark.parametrize("count", [6, 16, 29])
def test_wide_tolerance_gives_fourier_series(count):
    fit = harmonic_fit(WANTED, count, tolerance=1e-3).event
    np.testing.assert_allclose(fit(GRID), least_squares_lift(count)(GRID), atol=1e-15)


def test_more_harmonics_reduce_deviation():
    fits = [harmonic_fit(WANTED, count, tolerance=2e-5) for count in (8, 10, 14, 20, 30)]
    rms = [fit.rms_deviation for fit in fits]
    assert rms == sorted(rms, reverse=True)
    assert rms[-1] < rms[0] / 20
    for fit in fits:
        assert fit.strict_deviation <= 2e-5 * (1 + 1e-7)


def test_lift_of_few_harmonics_is_fitted_exactly():
    wanted = HarmonicLift(0.003, (-0.002, 0.0005, -0.0001), (0.001, -0.0002, 0.0003))
    fit = harmonic_fit(wanted, 5, tolerance=1e-6)
    np.testing.assert_allclose(fit.event.cosine, (*wanted.cosine, 0.0, 0.0), atol=1e-16)
    np.testing.assert_allclose(fit.event.sine, (*wanted.sine, 0.0, 0.0), atol=1e-16)
    assert fit.deviation < 1e-15
    assert fit.strict_deviation == 0.0  # there is no dwell with a tolerance


@pytest.mark.parametrize("section", [(35.0, 70.0), (345.0, 395.0)], ids=["inside", "across the turn"])
def test_user_defined_strict_section(section):
    """Both ends are angles of the fit."""
    start, end = map(math.radians, section)
    fit = harmonic_fit(WANTED, 6, strict=[(start - 1e-9, end + 1e-9)], tolerance=1e-6)
    inside = np.mod(GRID - start + 1e-9, 2 * math.pi) <= end - start + 2e-9
    miss = np.abs(grid_deviation(fit.event))
    assert miss[inside].max() <= 1e-6 + interpolation_error(fit.event, inside) < 1.1e-6
    assert np.abs(grid_deviation(least_squares_lift(6)))[inside].max() > 5e-6
    assert miss[~inside].max() > 5e-6


def test_two_strict_sections():
    sections = [(math.radians(35.0) - 1e-9, math.radians(50.0)), (math.radians(200.0) - 1e-9, math.radians(215.0))]
    fit = harmonic_fit(WANTED, 6, strict=sections, tolerance=1e-6)
    for start, end in sections:
        assert (
            np.abs(grid_deviation(fit.event))[(start <= GRID) & (end >= GRID)].max() <= 1.02e-6
        )  # between angles, as above
    assert fit.deviation > 5e-6


def test_bound_on_deviation_outside_dwells():
    free = harmonic_fit(WANTED, 8, tolerance=2e-5)
    bound = 0.9 * free.deviation
    fit = harmonic_fit(WANTED, 8, tolerance=2e-5, bound=bound)
    assert fit.deviation <= bound * (1 + 1e-7)
    # The objective is the sum of squares over the revolution.
    assert np.square(grid_deviation(fit.event)).mean() > np.square(grid_deviation(free.event)).mean()


def test_too_few_harmonics_error_states_attainable_tolerance():
    """The error states the attainable tolerance, which is then valid; a smaller one is not."""
    strict = [(0.5, 1.8)]
    with pytest.raises(InputError, match="More harmonics") as refusal:
        harmonic_fit(WANTED, 2, strict=strict, tolerance=1e-6)
    fault = refusal.value.faults[0]
    assert fault.given == "1 um in the dwells, too small for 2 harmonics"
    least = attainable_limits(fault)["tolerance"]
    assert least > 1e-6
    fit = harmonic_fit(WANTED, 2, strict=strict, tolerance=least)
    assert fit.strict_deviation == pytest.approx(least, rel=1e-6)
    with pytest.raises(InputError):
        harmonic_fit(WANTED, 2, strict=strict, tolerance=0.98 * least)


def attainable_limits(fault):
    """Return the limits of an error message, m, by name."""
    found = re.findall(r"a (\w+) \(--\w+\) of at least (\S+) um", fault.allowed)
    return {name: parse(f"{value} um", "length") for name, value in found}


RAMP, RISE = Ramp(0.3e-3, math.radians(25.0)), math.radians(75.0)
RAMPED = LiftEvent(LAWS["4-5-6-7"], 0.006, RISE, RISE, 0.0, math.radians(105.0), None, RAMP, RAMP)


@pytest.mark.parametrize(
    ("event", "count", "tolerance", "bound", "names"),
    [
        (WANTED, 3, 1e-6, None, ["tolerance"]),
        (WANTED, 8, 2e-5, 1e-5, ["tolerance", "bound"]),  # either
        (WANTED, 6, 1e-7, 1e-3, ["tolerance"]),
        (WANTED, 1, 1e-6, 1e-5, ["tolerance", "bound"]),  # both
        (RAMPED, 6, 5e-6, 10e-6, ["bound"]),
        (RAMPED, 3, 29.1e-6, None, ["tolerance"]),  # the minimum is 29.147 um
    ],
)
def test_attainable_limits_in_error_are_valid(event, count, tolerance, bound, names):
    given = {"tolerance": tolerance, "bound": bound}
    with pytest.raises(InputError) as refusal:
        harmonic_fit(event, count, **given)
    fault = refusal.value.faults[0]
    found = attainable_limits(fault)
    assert list(found) == names
    assert bound is not None or "bound" not in str(fault)
    for limits in [found] if " and " in fault.allowed else [{name: found[name]} for name in found]:
        harmonic_fit(event, count, **{**given, **limits})


@pytest.mark.parametrize(
    ("count", "tolerance", "bound", "message"),
    [(0, 1e-4, None, "count"), (8, 0.0, None, "tolerance"), (8, 1e-4, -1.0, "bound"), (8, math.nan, None, "tolerance")],
)
def test_invalid_fit_arguments_raise_error(count, tolerance, bound, message):
    with pytest.raises(InputError, match=message):
        harmonic_fit(WANTED, count, tolerance=tolerance, bound=bound)


@pytest.mark.parametrize(
    ("frequency", "speed", "count"), [(1000.0, 200.0, 4), (1001.0, 200.0, 5), (999.0, 200.0, 4), (200.0, 200.0, 0),
                                      (100.0, 200.0, 0), (7.5, 1.0, 7)],
)  # fmt: skip
def test_harmonics_below_frequency(frequency, speed, count):
    """The count is strictly below: n w < w0 (C. Li, 2014)."""
    assert harmonics_below(frequency, speed) == count
    assert count * speed < frequency <= (count + 1) * speed


@pytest.mark.parametrize(("frequency", "speed"), [(0.0, 1.0), (1.0, 0.0), (-1.0, 1.0), (math.inf, 1.0)])
def test_invalid_frequencies_raise_error(frequency, speed):
    with pytest.raises(InputError):
        harmonics_below(frequency, speed)


def test_number_of_harmonics_below_one_is_refused():
    with pytest.raises(InputError, match=r"^count: got 0, expected a whole number from 1 to 200\.$"):
        harmonic_fit(WANTED, 0, tolerance=1e-3)
