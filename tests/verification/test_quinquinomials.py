"""Quinquinomial laws u = sum a_j z^j and the cams with one dwell that they are for.

R. Roussev, B. Paleva-Kadiyska and V. Galabov, Quinquinomial power functions with one phase of the dwell in cam
mechanisms (2021), tables 1 to 3 and figure 1. The extremes are recomputed to five digits: the print's third decimals
(75.515, 138.079, -106.376, ...) were read off a coarse grid.
"""

from __future__ import annotations

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
ROWS = sorted(TABLE)


def exact(row, z, order):
    """Return a derivative at a rational place, in rational numbers, from the printed coefficients."""
    powers, below, above = TABLE[row]
    terms = [(a, p) for a, p in zip(above, powers, strict=True) if p >= order]
    return sum(Fraction(a, below) * math.perm(p, order) * z ** (p - order) for a, p in terms)


@pytest.mark.parametrize("row", ROWS)
def test_coefficients(row, record):
    powers, below, above = TABLE[row]
    law = quinquinomial(row)
    assert law.exponents == powers
    for power, a, computed in zip(powers, above, law.coefficients, strict=True):
        record(source=SOURCE, case=f"row {row}", quantity=f"coefficient of z^{power}", unit="1", reference=a / below,
               computed=computed, tolerance=4e-16, reason="one rounding of the printed fraction")  # fmt: skip


@pytest.mark.parametrize("row", ROWS)
def test_extremes(row, record):
    found = criteria(quinquinomial(row))
    computed = (found.velocity[1].value, found.acceleration[1].value, found.acceleration[0].value,
                found.jerk[1].value, found.jerk[0].value)  # fmt: skip
    for quantity, reference, value in zip(QUANTITIES, EXTREMES[row], computed, strict=True):
        digits = 5.1e-4 if abs(reference) >= 20 else 5.1e-5
        record(source=SOURCE, case=f"row {row}", quantity=quantity, unit="1", reference=reference, computed=value,
               tolerance=digits, absolute=True, reason="half of the last digit given")  # fmt: skip


@pytest.mark.parametrize("row", ROWS)
def test_end_conditions(row, record):
    """Lift 1 and no derivative up to the fourth at z = 1: powers summed plainly leave 6e-11 of the fourth there."""
    law = quinquinomial(row)
    for order in range(5):
        record(source=SOURCE, case=f"row {row}", quantity=f"derivative {order} at z = 1", unit="1",
               reference=float(order == 0), computed=law(np.ones(1), order)[0], tolerance=1e-12, absolute=True,
               reason="exact")  # fmt: skip
    first = TABLE[row][2][0] / TABLE[row][1]
    np.testing.assert_allclose([law(np.zeros(1), order)[0] for order in range(5)], [0, 0, 2 * first, 0, 0], rtol=1e-15)


@pytest.mark.parametrize("order", range(5))
@pytest.mark.parametrize("row", ROWS)
def test_values_against_rational_numbers(row, order):
    """Everywhere, also where the sum in powers of 1 - z takes over: rounding of powers up to 50, order by order."""
    places = [Fraction(k, 64) for k in range(65)] + [Fraction(1) - Fraction(1, 2**k) for k in (7, 10, 20)]
    expected = np.array([float(exact(row, z, order)) for z in places])
    found = quinquinomial(row)(np.array([float(z) for z in places]), order)
    np.testing.assert_allclose(found, expected, rtol=0.0, atol=1e-13 * np.abs(expected).max())


@pytest.mark.parametrize("row", ROWS)
def test_product_form(row):
    """The slope is c z (1 - z^n)^4 with n = 3 row, which is how the family comes to rest."""
    z, n = np.linspace(0.0, 1.0, 1001), 3 * row
    slope = 2 * TABLE[row][2][0] / TABLE[row][1] * z * (1 - z**n) ** 4
    np.testing.assert_allclose(quinquinomial(row)(z, 1), slope, rtol=0, atol=1e-13)


def one_dwell(row, dwell, rise, fall):
    law = quinquinomial(row)
    if dwell == "high":
        return LiftEvent(law, 0.008, rise, fall, dwell=2 * math.pi - rise - fall, phase=0.4, single_dwell="high")
    return LiftEvent(law, 0.008, rise, fall, phase=0.4, single_dwell="low")


def meeting(row, dwell, rise, fall):
    """Return the event and the angle at which rise and return meet, other than over a dwell."""
    return one_dwell(row, dwell, rise, fall), 0.4 if dwell == "high" else 0.4 + rise


def step(event, at, order, beside=1e-7):
    """Return the step of a derivative, apart from what the curve itself does between both sides."""
    left, right = at - beside, at + beside
    drift = beside * (event(np.array([left]), order + 1) + event(np.array([right]), order + 1))[0]
    return (event(np.array([right]), order) - event(np.array([left]), order))[0] - drift


@pytest.mark.parametrize("order", range(4))
@pytest.mark.parametrize("dwell", ["high", "low"])
@pytest.mark.parametrize("row", ROWS)
def test_rise_meets_return_without_a_step(row, dwell, order, record):
    """Figure 1, equal angles: lift, velocity, acceleration and jerk go on."""
    event, at = meeting(row, dwell, 1.3, 1.3)
    size = np.abs(event(np.linspace(0, 2 * math.pi, 3601), order)).max()
    record(source=SOURCE, case=f"row {row}, dwell {dwell}, equal angles", quantity=f"step of derivative {order}",
           unit="1", reference=0.0, computed=round(step(event, at, order) / size, 10), tolerance=1e-9, absolute=True,
           reason="of the largest value; read 1e-7 rad beside")  # fmt: skip


@pytest.mark.parametrize("dwell", ["high", "low"])
@pytest.mark.parametrize("row", ROWS)
def test_nothing_steps_anywhere_with_equal_angles(row, dwell):
    found = joints(one_dwell(row, dwell, 1.3, 1.3))
    assert len(found) == 3
    assert all(one.smooth for one in found)


@pytest.mark.parametrize("dwell", ["high", "low"])
@pytest.mark.parametrize("row", ROWS)
def test_unequal_angles_step_in_the_acceleration(row, dwell, record):
    """u''(0) h (1/rise^2 - 1/return^2): the coupling needs equal angles, which the paper takes for granted."""
    rise, fall = 1.3, 1.0
    event, at = meeting(row, dwell, rise, fall)
    peak = 2 * TABLE[row][2][0] / TABLE[row][1] * 0.008
    after, before = (rise, fall) if dwell == "high" else (fall, rise)
    sign = 1.0 if dwell == "high" else -1.0  # lifted off the base, or held down from above
    reference = sign * peak * (1 / after**2 - 1 / before**2)
    record(source=SOURCE, case=f"row {row}, dwell {dwell}, 1.3 and 1.0 rad", quantity="step of the acceleration",
           unit="m/rad^2", reference=reference, computed=step(event, at, 2), tolerance=1e-9,
           reason="exact; rounding of both sides")  # fmt: skip
    assert abs(step(event, at, 1)) < 1e-12
    stepping = [one for one in joints(event) if not one.smooth]
    assert len(stepping) == 1
    assert stepping[0].angle == pytest.approx(at, abs=1e-12)
    assert stepping[0].steps[2] == pytest.approx(reference, rel=1e-6)


@pytest.mark.parametrize("law", ["3-4-5", "4-5-6-7"])
def test_laws_for_two_dwells_drop_to_zero_in_between(law):
    """What the paper sets out to avoid: the acceleration passes zero where rise meets return."""
    event = LiftEvent(LAWS[law], 0.008, 1.3, 1.3)
    assert abs(event(np.array([1.3]), 2)[0]) < 1e-15
    single = one_dwell(1, "low", 1.3, 1.3)
    assert single(np.array([0.4 + 1.3]), 2)[0] == pytest.approx(-2 * 770 / 243 * 0.008 / 1.3**2, rel=1e-12)


def test_default_polynomial_is_the_same_law():
    z = np.linspace(0.0, 1.0, 101)
    np.testing.assert_array_equal(Polynomial((2, 5, 8, 11, 14))(z, 3), LAWS["quinquinomial"](z, 3))
