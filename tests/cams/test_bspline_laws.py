"""B-spline laws: polynomials as splines, interpolation of points, and invalid arguments."""

import math
from itertools import accumulate

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from flexcam.cams import LAWS, BSplineLaw, through_points
from flexcam.core.errors import InputError

Z = np.linspace(0.0, 1.0, 401)
ZEROS = (0.0, 0.0, 0.0)
ONES = (1.0, 1.0, 1.0)


@pytest.mark.parametrize("order", range(5))
@pytest.mark.parametrize(
    ("name", "coefficients"),
    [("3-4-5", (0, 0, 0, 1, 1, 1)), ("4-5-6-7", (0,) * 4 + (1,) * 4), ("5-6-7-8-9", (0,) * 5 + (1,) * 5)],
)
def test_rest_to_rest_polynomials_have_step_coefficients(name, coefficients, order):
    law = BSplineLaw(tuple(map(float, coefficients)), degree=len(coefficients) - 1)
    expected = LAWS[name](Z, order)
    np.testing.assert_allclose(law(Z, order), expected, rtol=0, atol=1e-12 * (1 + np.abs(expected).max()))


def bernstein_coefficients(powers):
    """Return the Bernstein coefficients of sum a_j z^j: c_i = sum_j a_j binomial(i, j)/binomial(n, j)."""
    n = len(powers) - 1
    return [sum(a * math.comb(i, j) / math.comb(n, j) for j, a in enumerate(powers)) for i in range(n + 1)]


@pytest.mark.parametrize("name", ["2-3", "3-4-5", "4-5-6-7", "quinquinomial"])
def test_polynomial_is_spline_without_inner_knots(name):
    law = LAWS[name]
    degree = max(law.exponents[-1], 5)
    powers = np.zeros(degree + 1)
    powers[list(law.exponents)] = law.coefficients
    found = BSplineLaw((*bernstein_coefficients(powers)[:-1], 1.0), degree)
    for order in range(5):
        expected = law(Z, order)
        np.testing.assert_allclose(found(Z, order), expected, rtol=0, atol=1e-11 * (1 + np.abs(expected).max()))


@pytest.mark.parametrize("still", [2, 3, 4, 5])
def test_equal_end_coefficients_give_zero_derivatives(still):
    """With m equal coefficients the first m - 1 derivatives vanish exactly, and the next one does not."""
    law = BSplineLaw((0.0,) * still + (0.4, 0.6) + (1.0,) * still)
    ends = np.array([0.0, 1.0])
    for order in range(1, min(still, 5)):
        np.testing.assert_array_equal(law(ends, order), 0.0)
    if still < 5:
        assert np.abs(law(ends, still)).min() > 1.0


@settings(max_examples=25, deadline=None)
@given(st.lists(st.floats(0.05, 1.0), min_size=2, max_size=5), st.lists(st.floats(0.0, 1.0), min_size=2, max_size=2))
def test_fourth_derivative_is_continuous_at_inner_knots(gaps, middle):
    knots = tuple(float(t) / sum(gaps) for t in accumulate(gaps[:-1]))
    law = BSplineLaw((*ZEROS, *(middle + [0.5] * len(knots))[: len(knots)], *ONES), 5, knots)
    assert law.breaks == ()
    at = np.array(knots)
    left, right = law(at - 1e-12, 4), law(at + 1e-12, 4)
    assert np.abs(left - right).max() <= 1e-6 * (1 + np.abs(law(Z, 4)).max())


def test_default_knots_are_equally_spaced():
    law = BSplineLaw((*ZEROS, 0.2, 0.5, *ONES))
    np.testing.assert_allclose(law.inner_knots, [1 / 3, 2 / 3])
    same = BSplineLaw((*ZEROS, 0.2, 0.5, *ONES), 5, (1 / 3, 2 / 3))
    np.testing.assert_allclose(law(Z, 4), same(Z, 4), rtol=1e-12)


@settings(max_examples=25, deadline=None)
@given(st.lists(st.tuples(st.floats(0.1, 1.0), st.floats(-0.5, 1.5)), min_size=1, max_size=8))
def test_spline_interpolates_points(points):
    z = np.cumsum([gap for gap, _ in points])
    z = (0.0, *(z / (z[-1] + 0.3)).tolist(), 1.0)
    s = (0.0, *(lift for _, lift in points), 1.0)
    law = through_points(z, s)
    np.testing.assert_allclose(law(np.array(z)), s, rtol=0, atol=1e-10)
    ends = np.array([0.0, 1.0])
    np.testing.assert_allclose(law(ends), [0.0, 1.0], rtol=0, atol=2e-16)  # the basis sums to 1 within one bit
    np.testing.assert_array_equal(law(ends, 1), 0.0)
    np.testing.assert_array_equal(law(ends, 2), 0.0)


def test_interpolation_of_law_converges_at_order_6(fitted_order):
    """Through n points of 4-5-6-7: a spline of degree 5 converges at order 6."""
    counts = np.array([9, 17, 33, 65])
    errors = []
    for n in counts:
        z = np.linspace(0.0, 1.0, n)
        law = through_points(tuple(z.tolist()), (0.0, *LAWS["4-5-6-7"](z[1:-1]).tolist(), 1.0))
        errors.append(np.abs(law(Z) - LAWS["4-5-6-7"](Z)).max())
    assert fitted_order(1.0 / (counts - 1), errors) == pytest.approx(6.0, abs=0.4)


@pytest.mark.parametrize(
    ("changes", "where"),
    [
        ({"degree": 4}, "degree"),
        ({"coefficients": (*ZEROS, 1.0, 1.0)}, "coefficients"),
        ({"coefficients": (0.1, 0.0, 0.0, *ONES)}, "coefficients"),
        ({"coefficients": (*ZEROS, 1.0, 1.0, 0.9)}, "coefficients"),
        ({"coefficients": (*ZEROS, math.nan, *ONES)}, "coefficients"),
        ({"knots": (0.5,)}, "coefficients"),
        ({"coefficients": (*ZEROS, 0.5, *ONES), "knots": (1.0,)}, "knots"),
        ({"coefficients": (*ZEROS, 0.5, 0.5, *ONES), "knots": (0.6, 0.4)}, "knots"),
    ],
)
def test_invalid_spline_raises_error(changes, where):
    with pytest.raises(InputError, match=f"^{where}:"):
        BSplineLaw(**({"coefficients": (*ZEROS, *ONES)} | changes))


@pytest.mark.parametrize(
    ("z", "s", "where"),
    [
        ((0.0, 1.0), (0.0, 1.0), "z, s"),
        ((0.0, 0.5, 1.0), (0.0, 1.0), "z, s"),
        ((0.0, 0.5, 0.5, 1.0), (0.0, 0.2, 0.3, 1.0), "z"),
        ((0.1, 0.5, 1.0), (0.0, 0.2, 1.0), "z"),
        ((0.0, 0.5, 0.9), (0.0, 0.2, 1.0), "z"),
        ((0.0, 0.5, 1.0), (0.1, 0.2, 1.0), "s"),
        ((0.0, 0.5, 1.0), (0.0, 0.2, 0.9), "s"),
        ((0.0, 0.5, 1.0), (0.0, math.nan, 1.0), "s"),
    ],
)
def test_invalid_points_raise_error(z, s, where):
    with pytest.raises(InputError, match=f"^{where}:"):
        through_points(z, s)
