"""Motion laws: end values, derivatives, characteristic numbers C_v, C_a, C_j.

R. L. Norton, Cam Design and Manufacturing Handbook, 2nd ed. (2009), ch. 3 and 4.
"""

import math

import numpy as np
import pytest

from flexcam.cams import LAWS, Polynomial, Scca
from flexcam.core.errors import InputError

PRINTED = 5e-5
"""Relative tolerance of a number printed with five digits."""

FB2 = 1.0 / (0.3**2 / math.pi + 4 * 0.3 * 0.7 / math.pi**2)
"""Peak acceleration of half a sine up to 0.3 and a quarter of a cosine after it: its velocity encloses an area of 1."""

PEAKS = {
    "parabolic": ((2.0, 4.0, None), 1e-12),
    "shm": ((math.pi / 2, math.pi**2 / 2, math.pi**3 / 2), 1e-12),
    "cos": ((math.pi / 2, math.pi**2 / 2, math.pi**3 / 2), 1e-12),
    "cycloidal": ((2.0, 2 * math.pi, 4 * math.pi**2), 1e-12),
    "modified-trapezoid": ((2.0, 4.8881, 61.426), PRINTED),
    "modified-sine": ((1.7596, 5.5280, 69.466), PRINTED),
    "2-3": ((1.5, 6.0, 12.0), 1e-12),
    "3-4-5": ((15 / 8, 10 / math.sqrt(3), 60.0), 1e-7),
    "4-5-6-7": ((35 / 16, 84 * math.sqrt(5) / 25, 52.5), 1e-7),
    "gutman-1-3": ((2.0, 5.1302, 59.218), PRINTED),
    "freudenstein-1-3": ((2.0, 5.3856, 50.758), PRINTED),
    "5-6-7-8-9": ((315 / 128, None, None), 1e-12),  # the derivative is 630 z^4 (1 - z)^4
    "pavlovic-trigonometric": ((91 / 48, 5.98019, 53 * math.pi**2 / 12), 1e-6),  # 15/16 + 1/6 of 4 pi^2 at z = 0
    "pavlovic-new": ((1.39843, math.pi**2, None), PRINTED),
    "quinquinomial": ((1.9568, 6.3374, 35.859), PRINTED),
    "quinquinomial-2": ((1.8601, 8.3866, 75.520), PRINTED),
    "quinquinomial-3": ((1.8476, 10.7692, 138.087), PRINTED),
    "quinquinomial-4": ((1.8505, 13.2266, 220.250), PRINTED),
    "harmonic-acceleration": ((2.0, 2 * math.pi, 4 * math.pi**2), 1e-12),
    "fb2": ((0.6 * FB2 / math.pi, FB2, FB2 * math.pi / 0.3), 1e-12),
}
"""C_v, C_a, C_j with a tolerance (closed forms: the peak is between grid points); None: infinite or not known."""

ASYMMETRIC = {"pavlovic-new": 0.498047, "fb2": None} | {f"quinquinomial{row}": None for row in ("", "-2", "-3", "-4")}
"""Laws without mirror symmetry, with s(1/2) where it is known."""

END_VELOCITY = {"pavlovic-trigonometric": 1 / 48}
"""Nonzero velocity at both ends."""

Z = np.linspace(0.0, 1.0, 2001)
FINE = np.linspace(0.0, 1.0, 200_001)


@pytest.fixture(params=sorted(LAWS))
def name(request):
    return request.param


def test_end_values(name):
    np.testing.assert_allclose(LAWS[name](np.array([0.0, 1.0])), [0.0, 1.0], rtol=0, atol=1e-14)
    np.testing.assert_allclose(LAWS[name](np.array([0.0, 1.0]), 1), END_VELOCITY.get(name, 0.0), rtol=0, atol=1e-12)


def test_peak_values(name):
    peaks, tolerance = PEAKS[name]
    for order, peak in enumerate(peaks, start=1):
        if peak is not None:
            assert np.abs(LAWS[name](FINE, order)).max() == pytest.approx(peak, rel=tolerance)


def test_law_of_a_number(name):
    assert LAWS[name](0.3) == LAWS[name](np.array([0.3]))[0]


def test_peak_table_covers_every_law():
    assert set(PEAKS) == set(LAWS)


SCCA_PARTS = {"shm": (0, 0, 1), "cycloidal": (0.5, 0, 0.5), "parabolic": (0, 1, 0)}


@pytest.mark.parametrize("name", SCCA_PARTS)
def test_scca_family_contains_three_laws(name):
    for order in range(5):
        scale = (2 * math.pi) ** order
        np.testing.assert_allclose(Scca(*SCCA_PARTS[name])(Z, order), LAWS[name](Z, order), rtol=0, atol=1e-13 * scale)


@pytest.mark.parametrize("exponents", [(2, 5, 8, 11, 14), (2, 14, 26, 38, 50), (3, 4, 5), (4, 5, 6, 7), (2, 9)])
def test_end_conditions_of_polynomials(exponents):
    law, end = Polynomial(exponents), np.array([1.0])
    assert law(end)[0] == 1.0
    for order in range(1, len(exponents)):
        assert abs(law(end, order)[0]) < 1e-12


@pytest.mark.parametrize("order", [0, 1, 2, 3, 4])
def test_both_sums_of_polynomial_agree(order):
    """At 1 - z = 0.05 the sum in z changes to that in 1 - z; each rounds by eps sum |a_j| j^order."""
    law = Polynomial((2, 14, 26, 38, 50))
    below, above = law(np.array([0.95 - 1e-15, 0.95 + 1e-15]), order)
    assert abs(above - below) < 1e-12 * 50.0**order


@pytest.mark.parametrize("parts", [(0.5, 0.6, 0.1), (-0.1, 0.6, 0.5)])
def test_invalid_scca_parts_raise_error(parts):
    with pytest.raises(InputError):
        Scca(*parts)


@pytest.mark.parametrize("exponents", [(3,), (1, 2), (3, 3), (5, 4)])
def test_invalid_exponents_raise_error(exponents):
    with pytest.raises(InputError):
        Polynomial(exponents)


@pytest.mark.parametrize("name", sorted(set(LAWS) - set(ASYMMETRIC)))
def test_symmetric_laws(name):
    law = LAWS[name]
    np.testing.assert_allclose(law(Z) + law(1 - Z), 1.0, rtol=0, atol=1e-13)
    assert law(np.array([0.5]))[0] == pytest.approx(0.5, abs=1e-14)


@pytest.mark.parametrize("name", sorted(ASYMMETRIC))
def test_asymmetric_laws(name):
    middle = LAWS[name](np.array([0.5]))[0]
    assert abs(middle - 0.5) > 1e-3
    if ASYMMETRIC[name] is not None:
        assert middle == pytest.approx(ASYMMETRIC[name], abs=5e-7)  # six decimals given


def test_value_at_jump_is_right_limit():
    law = LAWS["parabolic"]
    assert law.breaks == (0.5,)
    np.testing.assert_array_equal(law(np.array([np.nextafter(0.5, 0), 0.5]), 2), [4.0, -4.0])


def test_jerk_of_fb2_jumps_at_split():
    """From -A pi/p, the end of half a sine, to -B pi/(2 q), the start of a quarter of a cosine; B = A p/q."""
    law = LAWS["fb2"]
    assert law.breaks == (0.3,)
    p, q = 0.3, 0.7
    found = law(np.array([np.nextafter(p, 0), p]), 3)
    np.testing.assert_allclose(found, [-FB2 * math.pi / p, -FB2 * p / q * math.pi / (2 * q)], rtol=1e-12)


def test_argument_is_unchanged_and_shape_preserved(name, readonly):
    z = readonly(Z.reshape(3, 667))
    assert {LAWS[name](z, order).shape for order in range(5)} == {(3, 667)}
