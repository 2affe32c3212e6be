"""Polynomials with user-defined conditions: satisfied exactly, or an error states the reason."""

from fractions import Fraction

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from flexcam.cams import LAWS, Polynomial
from flexcam.case.curves import parse_law
from flexcam.core.errors import InputError

END = (1.0, 0, 1.0)
CONDITION = st.tuples(st.sampled_from([0.0, 0.25, 0.5, 0.7, 1.0]), st.integers(0, 4), st.floats(-5.0, 5.0))
EXPONENTS = st.lists(st.integers(1, 12), min_size=3, max_size=6, unique=True).map(sorted).map(tuple)


@settings(max_examples=25, deadline=None)
@given(EXPONENTS, st.data())
def test_polynomial_satisfies_conditions(exponents, data):
    places = CONDITION.filter(lambda c: (c[0], c[1]) != (1.0, 0))
    others = data.draw(st.lists(places, min_size=len(exponents) - 1, max_size=len(exponents) - 1))
    assume(all(order <= exponents[-1] for _, order, _ in others))
    try:
        law = Polynomial(exponents, (END, *others))
    except InputError as refusal:
        assume("independent" not in str(refusal))
        raise
    for z, order, value in (END, *others):
        # Rounding of the terms of the sum.
        terms = [abs(a) * max(1, p) ** order for a, p in zip(law.coefficients, exponents, strict=True)]
        assert law(np.array([z]), order)[0] == pytest.approx(value, abs=1e-13 * sum(terms))


@pytest.mark.parametrize(
    ("name", "exponents", "conditions"),
    [
        ("2-3", (2, 3), (END, (1.0, 1, 0.0))),
        ("3-4-5", (3, 4, 5), (END, (1.0, 1, 0.0), (1.0, 2, 0.0))),
        ("3-4-5", (1, 2, 3, 4, 5), ((0.0, 1, 0.0), (0.0, 2, 0.0), END, (1.0, 1, 0.0), (1.0, 2, 0.0))),
        ("4-5-6-7", (4, 5, 6, 7), (END, (1.0, 1, 0.0), (1.0, 2, 0.0), (1.0, 3, 0.0))),
        ("quinquinomial", (2, 5, 8, 11, 14), (END, *((1.0, order, 0.0) for order in (1, 2, 3, 4)))),
        ("3-4-5", (3, 4, 5), (END, (0.5, 0, 0.5), (0.5, 1, 15 / 8))),
    ],
)
def test_known_laws_from_their_conditions(name, exponents, conditions):
    z = np.linspace(0.0, 1.0, 201)
    for order in range(5):
        expected = LAWS[name](z, order)
        np.testing.assert_allclose(
            Polynomial(exponents, conditions)(z, order), expected, rtol=0, atol=1e-13 * (1 + np.abs(expected).max())
        )


def test_coefficients_are_exact_fractions():
    """With a z + b z^2 + c z^3, s(1) = 1, s'(1) = 0 and s'(0) = 1/2: (1/2, 2, -3/2)."""
    law = Polynomial((1, 2, 3), (END, (1.0, 1, 0.0), (0.0, 1, 0.5)))
    assert law.coefficients == (0.5, 2.0, -1.5)


def test_order_of_conditions_does_not_matter():
    conditions = (END, (0.3, 0, 0.2), (1.0, 1, 0.0), (0.3, 1, 0.7))
    assert Polynomial((2, 3, 4, 7), conditions).coefficients == Polynomial((2, 3, 4, 7), conditions[::-1]).coefficients


@pytest.mark.parametrize("exponents", [(3, 4, 5), (2, 9, 17), (5, 6, 7, 8, 9), (2, 14, 26, 38, 50)])
def test_default_conditions_are_rest_at_end(exponents):
    rest = tuple((1.0, order, 0.0) for order in range(1, len(exponents)))
    assert Polynomial(exponents).coefficients == Polynomial(exponents, (END, *rest)).coefficients


@pytest.mark.parametrize("exponents", [(3, 4, 5), (2, 3, 9)])
def test_coefficients_match_product_formula(exponents):
    """a_j = prod p_i/(p_i - p_j) over the other exponents."""
    expected = []
    for own in exponents:
        a = Fraction(1)
        for p in exponents:
            a *= Fraction(p, p - own) if p != own else 1
        expected.append(float(a))
    assert Polynomial(exponents).coefficients == tuple(expected)


INVALID_CONDITIONS = {
    "the same twice": ((3, 4, 5), (END, END, (1.0, 1, 0.0)), "independent"),
    "contradiction": ((3, 4, 5), (END, (0.5, 0, 0.4), (0.5, 0, 0.6)), "independent"),
    "met by every exponent": ((3, 4, 5), (END, (1.0, 1, 0.0), (0.0, 1, 0.0)), "independent"),
    "too few": ((3, 4, 5), (END, (1.0, 1, 0.0)), "one per exponent"),
    "too many": ((3, 4), (END, (1.0, 1, 0.0), (1.0, 2, 0.0)), "one per exponent"),
    "does not end at 1": ((3, 4, 5), ((0.5, 0, 0.4), (1.0, 1, 0.0), (1.0, 2, 0.0)), r"s\(1\) = 1"),
    "beyond the rise": ((3, 4), (END, (1.2, 0, 1.0)), "z from 0 to 1"),
    "order too high": ((3, 4), (END, (0.5, 5, 1.0)), "order of the derivative"),
    "not a number": ((3, 4), (END, (0.5, 0, float("nan"))), "finite"),
    "place not a number": ((3, 4), (END, (float("nan"), 0, 0.5)), "z from 0 to 1"),
    "power 0": ((0, 3), (END, (1.0, 1, 0.0)), "ascending whole numbers from 1"),
    "power too high": ((2, 61), (END, (1.0, 1, 0.0)), "from 1 to 60"),
}


@pytest.mark.parametrize("case", INVALID_CONDITIONS)
def test_invalid_conditions_raise_error(case):
    exponents, conditions, reason = INVALID_CONDITIONS[case]
    with pytest.raises(InputError, match=reason):
        Polynomial(exponents, conditions)


def test_first_power_without_conditions_raises_error():
    with pytest.raises(InputError, match="s and s' must vanish at z = 0"):
        Polynomial((1, 2, 3))


@pytest.mark.parametrize(
    ("exponents", "reason"),
    [
        ((3,), "does not come to rest"),
        ((0, 4), "s and s' must vanish"),
        ((3, 4, 61), "too many digits"),
        ((3, 4, 4), "4 is listed twice"),
        ((5, 4, 3), "do not ascend"),
    ],
)
def test_invalid_exponents_raise_error(exponents, reason):
    with pytest.raises(InputError, match=reason):
        Polynomial(exponents)


def test_fractional_exponent_raises_error():
    with pytest.raises(InputError, match="A whole number is needed there"):
        parse_law({"id": "polynomial", "exponents": [2.5, 4, 5]})


def test_unknown_parameter_raises_error():
    with pytest.raises(InputError, match=r"There is no such key\. Did you mean 'exponents'"):
        parse_law({"id": "polynomial", "exponents": [3, 4, 5], "exponent": 3})
