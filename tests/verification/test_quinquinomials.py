"""Quinquinomial laws u = sum a_j z^j and their cams with a single dwell.

R. Roussev, B. Paleva-Kadiyska and V. Galabov, Quinquinomial power functions with one phase of the dwell in cam
mechanisms (2021), tables 1 to 3 and figure 1. The extremes are recomputed to five digits: the third decimals in print
(75.515, 138.079, -106.376, ...) come from a coarse grid.
"""

import math
from fractions import Fraction

import numpy as np
import pytest

from flexcam.cams import LAWS, LiftEvent, Polynomial, criteria, joints, quinquinomial

SOURCE = "Roussev, Paleva-Kadiyska and Galabov, Quinquinomial power functions"
TABLE = {
    1: ((2, 5, 8, 11, 14), 243, (770, -1232, 1155, -560, 110)),
    2: ((2, 8, 14, 20, 26), 243, (455, -455, 390, -182, 35)),
    3: ((2, 11, 20, 29, 38), 19683, (30305, -22040, 18183, -8360, 1595)),
    4: ((2, 14, 26, 38, 50), 31104, (43225, -24700, 19950, -9100, 1729)),
}
"""Exponents, common denominator and numerators, as printed."""

EXTREMES = {
    1: (1.9568, 6.3374, -6.3086, 33.030, -35.859),
    2: (1.8601, 3.7449, -8.3866, 75.520, -48.150),
    3: (1.8476, 3.0793, -10.7692, 138.087, -73.249),
    4: (1.8505, 2.7794, -13.2266, 220.250, -106.379),
}
QUANTITIES = ("max u'", "max u''", "min u''", "max u'''", "min u'''")
TABLE_ROWS = sorted(TABLE)


def exact_derivative(row, z, order):
    """Return a derivative at a rational place, in rational numbers, from the printed coefficients."""
    powers, below, above = TABLE[row]
    terms = [(a, p) for a, p in zip(above, powers, strict=True) if p >= order]
    return sum(Fraction(a, below) * math.perm(p, order) * z ** (p - order) for a, p in terms)


@pytest.mark.parametrize("row", TABLE_ROWS)
def test_coefficients_match_printed_fractions(row, record):
    powers, below, above = TABLE[row]
    law = quinquinomial(row)
    assert law.exponents == powers
    for power, a, computed in zip(powers, above, law.coefficients, strict=True):
        record(source=SOURCE, case=f"row {row}", quantity=f"coefficient of z^{power}", unit="1", reference=a / below,
               computed=computed, tolerance=4e-16, reason="one rounding of the printed fraction")  # fmt: skip


@pytest.mark.parametrize("row", TABLE_ROWS)
def test_extremes_match_published_values(row, record):
    found = criteria(quinquinomial(row))
    computed = (found.velocity[1].value, found.acceleration[1].value, found.acceleration[0].value,
                found.jerk[1].value, found.jerk[0].value)  # fmt: skip
    for quantity, reference, value in zip(QUANTITIES, EXTREMES[row], computed, strict=True):
        digits = 5.1e-4 if abs(reference) >= 20 else 5.1e-5
        record(source=SOURCE, case=f"row {row}", quantity=quantity, unit="1", reference=reference, computed=value,
               tolerance=digits, absolute=True, reason="half of the last digit given")  # fmt: skip


@pytest.mark.parametrize("row", TABLE_ROWS)
def test_conditions_at_ends(row, record):
    """The lift is 1 and derivatives up to the fourth are zero at z = 1; a plain power sum has an error of 6e-11."""
    law = quinquinomial(row)
    for order in range(5):
        record(source=SOURCE, case=f"row {row}", quantity=f"derivative {order} at z = 1", unit="1",
               reference=float(order == 0), computed=law(np.ones(1), order)[0], tolerance=1e-12, absolute=True,
               reason="exact")  # fmt: skip
    first = TABLE[row][2][0] / TABLE[row][1]
    np.testing.assert_allclose([law(np.zeros(1), order)[0] for order in range(5)], [0, 0, 2 * first, 0, 0], rtol=1e-15)


@pytest.mark.parametrize("order", range(5))
@pytest.mark.parametrize("row", TABLE_ROWS)
def test_values_match_rational_arithmetic(row, order):
    """The error is the rounding of powers up to 50, order by order, also for the sum in powers of 1 - z."""
    places = [Fraction(k, 64) for k in range(65)] + [Fraction(1) - Fraction(1, 2**k) for k in (7, 10, 20)]
    expected = np.array([float(exact_derivative(row, z, order)) for z in places])
    found = quinquinomial(row)(np.array([float(z) for z in places]), order)
    np.testing.assert_allclose(found, expected, rtol=0.0, atol=1e-13 * np.abs(expected).max())


@pytest.mark.parametrize("row", TABLE_ROWS)
def test_slope_matches_product_form(row):
    """The slope is c z (1 - z^n)^4 with n = 3 row, which gives the zero derivatives at the end."""
    z, n = np.linspace(0.0, 1.0, 1001), 3 * row
    slope = 2 * TABLE[row][2][0] / TABLE[row][1] * z * (1 - z**n) ** 4
    np.testing.assert_allclose(quinquinomial(row)(z, 1), slope, rtol=0, atol=1e-13)


def single_dwell_event(row, dwell, rise, fall):
    law = quinquinomial(row)
    if dwell == "high":
        return LiftEvent(law, 0.008, rise, fall, dwell=2 * math.pi - rise - fall, phase=0.4, single_dwell="high")
    return LiftEvent(law, 0.008, rise, fall, phase=0.4, single_dwell="low")


def event_and_joint(row, dwell, rise, fall):
    """Return the event and the angle at which rise and return join, other than over a dwell."""
    return single_dwell_event(row, dwell, rise, fall), 0.4 if dwell == "high" else 0.4 + rise


def derivative_jump(event, at, order, beside=1e-7):
    """Return the jump of a derivative, less the change of the curve between both sides."""
    left, right = at - beside, at + beside
    drift = beside * (event(np.array([left]), order + 1) + event(np.array([right]), order + 1))[0]
    return (event(np.array([right]), order) - event(np.array([left]), order))[0] - drift


@pytest.mark.parametrize("order", range(4))
@pytest.mark.parametrize("dwell", ["high", "low"])
@pytest.mark.parametrize("row", TABLE_ROWS)
def test_rise_joins_return_smoothly(row, dwell, order, record):
    """Lift, velocity, acceleration and jerk are continuous for equal angles, as in figure 1."""
    event, at = event_and_joint(row, dwell, 1.3, 1.3)
    size = np.abs(event(np.linspace(0, 2 * math.pi, 3601), order)).max()
    record(source=SOURCE, case=f"row {row}, dwell {dwell}, equal angles", quantity=f"step of derivative {order}",
           unit="1", reference=0.0, computed=round(derivative_jump(event, at, order) / size, 10),
           tolerance=1e-9, absolute=True,
           reason="of the largest value; read 1e-7 rad beside")  # fmt: skip


@pytest.mark.parametrize("dwell", ["high", "low"])
@pytest.mark.parametrize("row", TABLE_ROWS)
def test_joints_are_smooth_with_equal_angles(row, dwell):
    found = joints(single_dwell_event(row, dwell, 1.3, 1.3))
    assert len(found) == 3
    assert all(one.smooth for one in found)


@pytest.mark.parametrize("dwell", ["high", "low"])
@pytest.mark.parametrize("row", TABLE_ROWS)
def test_acceleration_jump_with_unequal_angles(row, dwell, record):
    """The jump is u''(0) h (1/rise^2 - 1/return^2): continuity needs equal angles, which the paper assumes."""
    rise, fall = 1.3, 1.0
    event, at = event_and_joint(row, dwell, rise, fall)
    peak = 2 * TABLE[row][2][0] / TABLE[row][1] * 0.008
    after, before = (rise, fall) if dwell == "high" else (fall, rise)
    sign = 1.0 if dwell == "high" else -1.0  # lifted off the base, or pressed down from above
    reference = sign * peak * (1 / after**2 - 1 / before**2)
    record(source=SOURCE, case=f"row {row}, dwell {dwell}, 1.3 and 1.0 rad", quantity="step of the acceleration",
           unit="m/rad^2", reference=reference, computed=derivative_jump(event, at, 2), tolerance=1e-9,
           reason="exact; rounding of both sides")  # fmt: skip
    assert abs(derivative_jump(event, at, 1)) < 1e-12
    stepping = [one for one in joints(event) if not one.smooth]
    assert len(stepping) == 1
    assert stepping[0].angle == pytest.approx(at, abs=1e-12)
    assert stepping[0].steps[2] == pytest.approx(reference, rel=1e-6)


@pytest.mark.parametrize("law", ["3-4-5", "4-5-6-7"])
def test_double_dwell_laws_have_zero_acceleration_at_joint(law):
    """The paper avoids such laws: the acceleration is zero where rise and return join."""
    event = LiftEvent(LAWS[law], 0.008, 1.3, 1.3)
    assert abs(event(np.array([1.3]), 2)[0]) < 1e-15
    single = single_dwell_event(1, "low", 1.3, 1.3)
    assert single(np.array([0.4 + 1.3]), 2)[0] == pytest.approx(-2 * 770 / 243 * 0.008 / 1.3**2, rel=1e-12)


def test_polynomial_matches_quinquinomial_law():
    z = np.linspace(0.0, 1.0, 101)
    np.testing.assert_array_equal(Polynomial((2, 5, 8, 11, 14))(z, 3), LAWS["quinquinomial"](z, 3))
