"""Order spectrum of a history: trigonometric polynomials, known lifts, and a gap at the ends."""

import math

import numpy as np
import pytest

from flexcam.cams import LAWS, HarmonicLift, LiftEvent, harmonics, order_spectrum
from flexcam.core.errors import InputError

EVEN = np.linspace(0.0, 2.0 * math.pi, 101)
UNEVEN = np.concatenate([[0.0], np.sort(np.random.default_rng(7).uniform(0.0, 2.0 * math.pi, 99)), [2.0 * math.pi]])


def trigonometric_polynomial(angle, coefficients):
    return sum((c * np.exp(1j * n * angle)).real for n, c in enumerate(coefficients))


@pytest.mark.parametrize("angle", [EVEN, UNEVEN, EVEN + 40.0 * math.pi], ids=["even", "uneven", "later"])
def test_exact_for_trigonometric_polynomial(angle, readonly):
    """Arbitrary instants and the maximum degree; 1e-11 is the rounding of an uneven system of 25 unknowns."""
    rng = np.random.default_rng(8)
    wanted = rng.normal(size=13) + 1j * rng.normal(size=13)
    wanted[0] = wanted[0].real
    found = order_spectrum(readonly(angle), readonly(trigonometric_polynomial(angle, wanted)), 12)
    np.testing.assert_allclose(found.coefficients, wanted, atol=1e-11)
    assert found.gap < 1e-11


def test_even_instants_match_fft():
    """Also for values with higher orders than requested."""
    values = np.random.default_rng(9).normal(size=101)
    values[-1] = values[0]
    found = order_spectrum(EVEN, values, 20)
    transformed = 2.0 * np.fft.rfft(values[:-1])[:21] / 100
    transformed[0] *= 0.5
    np.testing.assert_allclose(found.coefficients, transformed, atol=1e-13)


def test_harmonic_lift_has_single_order():
    for k in (1, 3, 5):
        lift = HarmonicLift(0.003, tuple([0.0] * (k - 1) + [-0.003]), (0.0,) * k)
        found = order_spectrum(EVEN, lift(EVEN, 0), 8).amplitudes
        wanted = np.zeros(9)
        wanted[[0, k]] = 0.003
        np.testing.assert_allclose(found, wanted, atol=1e-16)


def test_spectrum_of_lift_matches_harmonics():
    """`harmonics` uses Gauss quadrature; orders from 776 on alias at 800 instants, below 1e-9 m each."""
    event = LiftEvent(LAWS["4-5-6-7"], lift=0.006, rise=1.3, fall=1.3, phase=1.0)
    angle = np.linspace(0.0, 2.0 * math.pi, 801)
    np.testing.assert_allclose(order_spectrum(angle, event(angle), 24).coefficients, harmonics(event, 24), atol=1e-9)


def test_gap_of_open_history():
    """A ramp over the revolution has orders h / (pi n), the leakage described in the docstring."""
    angle = np.linspace(0.0, 2.0 * math.pi, 2001)
    found = order_spectrum(angle, angle / (2.0 * math.pi), 5)
    assert found.gap == pytest.approx(1.0)
    np.testing.assert_allclose(found.amplitudes[1:], 1.0 / (math.pi * np.arange(1, 6)), rtol=1e-4)


@pytest.mark.parametrize(
    ("angle", "count"),
    [(EVEN[:60], 4), (EVEN, 0), (EVEN, 60), (EVEN[::-1], 4), (2.0 * EVEN, 4)],
    ids=["half", "none", "too many", "falling", "two revolutions"],
)
def test_invalid_angles_or_count_raise_error(angle, count):
    with pytest.raises(InputError):
        order_spectrum(angle, np.zeros(len(angle)), count)
