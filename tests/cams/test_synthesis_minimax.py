"""Minimax laws: optimality by independent methods, bounds and conditions, and infeasible problems."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from flexcam.cams import LAWS, HarmonicFamily, SplineFamily, criteria, minimax
from flexcam.core.errors import InputError

Z = np.linspace(0.0, 1.0, 4001)
ORDERS = {"Cv": 1, "Ca": 2, "Cj": 3}
FAMILIES = {
    "polynomials of degree 9": SplineFamily(degree=9, pieces=1),
    "splines": SplineFamily(degree=5, pieces=8),
    "splines without symmetry": SplineFamily(degree=5, pieces=8, symmetric=False),
    "splines of degree 6, at rest to the third derivative": SplineFamily(degree=6, pieces=9, rest=3),
    "splines with free acceleration at the ends": SplineFamily(degree=5, pieces=7, rest=1),
    "harmonics": HarmonicFamily((1, 2, 3, 5)),
}


@pytest.fixture(scope="module", params=FAMILIES.values(), ids=FAMILIES.keys())
def family(request):
    return request.param


@pytest.fixture(scope="module", params=ORDERS)
def optimum(request, family):
    return minimax(family, {request.param: 1.0})


def grid_value(law, name):
    """Return a criterion on a grid, which never exceeds the exact value."""
    if name == "rms":
        return math.sqrt(np.trapezoid(law(Z, 2) ** 2, Z))
    if name == "Cm":
        return np.abs(law(Z, 1) * law(Z, 2)).max()
    return np.abs(law(Z, ORDERS[name])).max()


@pytest.mark.parametrize("order", [0, 1, 2, 3])
def test_rows_of_family_match_law(family, order):
    x = np.random.default_rng(1).uniform(0.2, 0.8, family.size)
    rows, offset = family.rows(Z, order)
    scale = np.abs(rows).max() * family.size
    np.testing.assert_allclose(rows @ x + offset, family.law(x)(Z, order), atol=1e-13 * scale)


def test_end_conditions_and_monotonicity_of_optimum(family, optimum):
    """To 1e-12, as a cam between two dwells requires; harmonics sum to 1 within rounding of the linear program."""
    ends = np.array([0.0, 1.0])
    np.testing.assert_allclose(optimum.law(ends), ends, atol=1e-12)
    for order in range(1, 1 + getattr(family, "rest", 2)):
        assert np.abs(optimum.law(ends, order)).max() < 1e-12 * 20**order
    assert optimum.law(Z, 1).min() > -1e-7  # the program adds points to limit the velocity between points
    if getattr(family, "symmetric", True):
        np.testing.assert_allclose(optimum.law(Z) + optimum.law(1 - Z), 1.0, atol=1e-12)


def test_gap_proves_optimum(optimum):
    assert optimum.converged
    assert -1e-7 <= optimum.gap <= 1e-6 * max(1.0, optimum.objective)
    assert optimum.objective >= optimum.bound_all - 1e-12
    assert optimum.objective == pytest.approx(optimum.gap + optimum.bound, rel=1e-15)


@given(st.data())
@settings(max_examples=8, deadline=None)
def test_no_law_of_family_is_below_bound(optimum, family, data):
    """Arbitrary coefficients and steps from the optimum; a grid may slightly underestimate a criterion."""
    name = next(name for name in ORDERS if getattr(optimum.criteria, name) == optimum.objective)
    best = fit_coefficients(family, optimum.law)
    step = np.array(data.draw(st.lists(st.floats(-1.0, 1.0), min_size=family.size, max_size=family.size)))
    step -= step.mean() if isinstance(family, HarmonicFamily) else 0.0  # the coefficients sum to 1
    law = family.law(best + data.draw(st.sampled_from([0.001, 0.01, 0.1])) * step)
    if law(Z, 1).min() >= 0.0:
        assert grid_value(law, name) >= optimum.bound * (1 - 1e-4)


def fit_coefficients(family, law):
    """Return the coefficients of a law of the family."""
    rows, offset = family.rows(Z, 0)
    return np.linalg.lstsq(rows, law(Z) - offset, rcond=None)[0]


@pytest.mark.parametrize(
    ("degree", "name"),
    [(7, "Cv"), (7, "Ca"), (7, "Cj"), (7, "rms"), pytest.param(7, "Cm", marks=pytest.mark.slow), (8, "Ca")],
)
def test_optimum_of_one_coefficient_matches_search(name, degree):
    """Symmetric polynomials of degree 7 and 8 at rest without acceleration have one coefficient, found by search."""
    from scipy.optimize import minimize_scalar

    family = SplineFamily(degree=degree, pieces=1)
    assert family.size == 1

    def value(x):
        law = family.law(np.array([x]))
        return grid_value(law, name) + 1e3 * max(0.0, -law(Z, 1).min())  # the law must be monotonic

    searched = minimize_scalar(value, bounds=(-2.0, 2.0), method="bounded", options={"xatol": 1e-10})
    assert minimax(family, {name: 1.0}).objective == pytest.approx(searched.fun, rel=2e-6)  # the grid of 1/4000


@pytest.mark.parametrize(("order", "name"), [(2, "Ca"), (3, "Cj"), (5, "rms")])
def test_optimum_of_two_harmonics_matches_search(order, name):
    from scipy.optimize import minimize_scalar

    family = HarmonicFamily((1, order))

    def value(c):
        law = family.law(np.array([1 - c, c]))
        return grid_value(law, name) + 1e3 * max(0.0, -law(Z, 1).min())

    searched = minimize_scalar(value, bounds=(-0.2, 0.2), method="bounded", options={"xatol": 1e-10})
    assert minimax(family, {name: 1.0}).objective == pytest.approx(searched.fun, rel=2e-6)


@pytest.mark.parametrize("pieces", [3, 6])
def test_minimum_rms_matches_least_squares(pieces):
    """Without the constraint on the velocity, inactive for these laws, it is a linear least-squares problem."""
    family = SplineFamily(degree=5, pieces=pieces)
    points, weights = np.polynomial.legendre.leggauss(8)
    edges = np.linspace(0.0, 1.0, pieces + 1)
    z = (edges[:-1, None] + np.diff(edges)[:, None] * (points + 1) / 2).ravel()
    weight = np.sqrt((np.diff(edges)[:, None] * weights / 2).ravel())
    rows, offset = family.rows(z, 2)
    x = np.linalg.lstsq(weight[:, None] * rows, -weight * offset, rcond=None)[0]
    assert family.law(x)(Z, 1).min() >= 0.0
    optimum = minimax(family, {"rms": 1.0})
    exact = np.linalg.norm(weight * (rows @ x + offset))
    assert optimum.objective == pytest.approx(exact, rel=1e-7)
    assert -1e-9 <= optimum.gap <= 1e-6
    assert optimum.bound <= exact * (1 + 1e-9)


LOWER_BOUNDS = {"Cj": (32.0, (6, 12, 24)), "rms": (math.sqrt(12), (3, 6, 10)), "Cm": (9 / 4, (4, 8, 16))}


@pytest.mark.parametrize("name", ["Cj", "rms", pytest.param("Cm", marks=pytest.mark.slow)])
def test_more_pieces_approach_bound_over_all_laws(name):
    bound, pieces = LOWER_BOUNDS[name]
    values = [minimax(SplineFamily(degree=5, pieces=n), {name: 1.0}) for n in pieces]
    assert [one.bound_all for one in values] == [pytest.approx(bound, rel=1e-15)] * 3
    excess = [one.objective - bound for one in values]
    assert excess == sorted(excess, reverse=True)
    assert 0.0 < excess[2] < 0.6 * excess[0]


@pytest.mark.slow
def test_operating_moment_has_no_family_bound():
    optimum = minimax(SplineFamily(degree=5, pieces=6), {"Cm": 1.0})
    assert optimum.bound is None
    assert optimum.gap is None
    assert optimum.objective == pytest.approx(grid_value(optimum.law, "Cm"), rel=1e-5)


def test_symmetry_does_not_change_optimum():
    """The mean of a law and its mirror image is symmetric and no worse than the law."""
    values = [
        minimax(SplineFamily(degree=5, pieces=8, symmetric=which), {"Ca": 1.0}, bounds={"Cj": 52.5}).objective
        for which in (True, False)
    ]
    assert values[0] == pytest.approx(values[1], rel=1e-6)


def test_weighted_criteria():
    family = SplineFamily(degree=5, pieces=8)
    once, twice = (minimax(family, {"Ca": w}) for w in (1.0, 2.0))
    assert twice.objective == pytest.approx(2 * once.objective, rel=1e-7)
    fast = minimax(family, {"Cv": 1.0})
    both = minimax(family, {"Ca": 1.0, "Cv": 3.0})
    assert both.objective == pytest.approx(both.criteria.Ca + 3 * both.criteria.Cv, rel=1e-15)
    assert both.objective < min(one.criteria.Ca + 3 * one.criteria.Cv for one in (once, fast)) - 0.1
    assert both.objective > once.objective + 3 * fast.objective
    assert abs(both.gap) <= 1e-6
    assert both.bound_all == pytest.approx(4.0 + 3 * 1.0, rel=1e-15)


def test_bounds_hold_and_increase_objective():
    family = SplineFamily(degree=5, pieces=12)
    free = minimax(family, {"Ca": 1.0})
    last = free.objective
    for limit in (60.0, 40.0):
        optimum = minimax(family, {"Ca": 1.0}, bounds={"Cj": limit, "Cv": 1.95})
        assert limit * (1 - 1e-6) < optimum.criteria.Cj <= limit  # on the limit, and not above it
        assert optimum.criteria.Cv <= 1.95
        assert optimum.objective > last - 1e-7
        last = optimum.objective
    loose = minimax(family, {"Ca": 1.0}, bounds={"Cj": 1.1 * free.criteria.Cj, "Cv": 3.0})
    assert loose.objective == pytest.approx(free.objective, rel=1e-7)


CONDITIONS = {
    "velocity in the middle": [(0.5, 1, 1.7)],
    "acceleration and jerk": [(0.25, 2, 4.0), (0.5, 3, -30.0)],
    "three at once": [(0.2, 0, 0.08), (0.4, 1, 1.6), (0.7, 2, -3.0)],
}


@pytest.mark.parametrize(
    ("case", "symmetric"),
    [
        ("three at once", True),
        ("velocity in the middle", False),
        pytest.param("acceleration and jerk", False, marks=pytest.mark.slow),
        pytest.param("three at once", False, marks=pytest.mark.slow),
    ],
)
def test_optimum_satisfies_conditions(case, symmetric):
    family = SplineFamily(degree=5, pieces=12, symmetric=symmetric)
    optimum = minimax(family, {"Ca": 1.0}, conditions=CONDITIONS[case])
    for z, order, value in CONDITIONS[case]:
        assert optimum.law(np.array([z]), order)[0] == pytest.approx(value, abs=1e-9)
    assert -1e-7 <= optimum.gap <= 1e-6
    assert optimum.objective > minimax(family, {"Ca": 1.0}).objective
    assert optimum.law(Z, 1).min() >= -1e-7


def test_non_monotone_law_is_optional():
    backwards = [(0.2, 1, -0.1)]
    family = SplineFamily(degree=5, pieces=12)
    with pytest.raises(InputError):
        minimax(family, {"Ca": 1.0}, conditions=backwards)
    optimum = minimax(family, {"Ca": 1.0}, conditions=backwards, monotone=False)
    assert optimum.law(np.array([0.2]), 1)[0] == pytest.approx(-0.1, abs=1e-9)
    assert -1e-7 <= optimum.gap <= 1e-6
    # An inactive constraint on the sign of the velocity changes nothing.
    either = [minimax(family, {"Ca": 1.0}, monotone=which).objective for which in (True, False)]
    assert either[0] == pytest.approx(either[1], rel=1e-7)


INFEASIBLE = {
    "a jerk below 32": ({"Cj": 31.0}, []),
    "a velocity below the mean": ({"Cv": 0.99}, []),
    "an acceleration below 4": ({"Ca": 3.9}, []),
    "bounds that exclude each other": ({"Cj": 34.0, "Cv": 1.2}, []),
    "a symmetric law off the middle": ({}, [(0.5, 0, 0.6)]),
}


@pytest.mark.parametrize("case", INFEASIBLE)
def test_infeasible_bounds_raise_error(case):
    bounds, conditions = INFEASIBLE[case]
    with pytest.raises(InputError, match=r"Use (a wider bound|other conditions)"):
        minimax(SplineFamily(degree=5, pieces=16), {"Ca": 1.0}, bounds=bounds, conditions=conditions)


def test_error_suggests_non_monotone_law():
    with pytest.raises(InputError, match=r"Use a wider bound or other conditions, or allow laws that turn back"):
        minimax(SplineFamily(degree=5, pieces=8), {"Ca": 1.0}, bounds={"Cj": 500.0}, conditions=[(0.2, 1, -0.1)])


def test_error_suggests_asymmetric_law():
    with pytest.raises(InputError, match=r"--asymmetric"):
        minimax(SplineFamily(degree=5, pieces=8), {"Ca": 1.0}, conditions=[(0.5, 0, 0.6)])


INVALID_CRITERIA = {
    "unknown criterion": ({"Cx": 1.0}, {}, "minimize: got 'Cx', expected Cv, Ca, Cj, rms, Cm"),
    "unknown bound": ({"Ca": 1.0}, {"Cx": 1.0}, "bounds: got 'Cx', expected Cv, Ca, Cj"),
    "bound on what is not linear": ({"Ca": 1.0}, {"Cm": 5.0}, "bounds: got 'Cm', expected Cv, Ca, Cj"),
    "negative weight": ({"Ca": -1.0}, {}, "minimize.Ca.*above zero"),
    "weight of no number": ({"Ca": math.nan}, {}, "minimize.Ca.*finite"),
    "bound of zero": ({"Ca": 1.0}, {"Cj": 0.0}, "bounds.Cj.*above zero"),
    "nothing to minimize": ({}, {"Cj": 60.0}, "minimize: missing"),
}


@pytest.mark.parametrize("case", INVALID_CRITERIA)
def test_invalid_criteria_raise_error(case):
    weights, bounds, message = INVALID_CRITERIA[case]
    with pytest.raises(InputError, match=message):
        minimax(SplineFamily(degree=5, pieces=8), weights, bounds=bounds)


@pytest.mark.parametrize(
    "make",
    [
        lambda: SplineFamily(degree=4), lambda: SplineFamily(pieces=0), lambda: SplineFamily(rest=0),
        lambda: SplineFamily(degree=5, pieces=1, rest=2), lambda: HarmonicFamily((1,)),
        lambda: HarmonicFamily((1, 1, 3)), lambda: HarmonicFamily((0, 1)),
    ],
)  # fmt: skip
def test_invalid_family_raises_error(make):
    with pytest.raises(InputError):
        make()


def test_spline_family_contains_known_law():
    """The polynomials of degree 7 contain the 4-5-6-7 law, the only one at rest to the third derivative."""
    rows, offset = (family := SplineFamily(degree=7, pieces=1)).rows(Z, 0)
    x, miss, *_ = np.linalg.lstsq(rows, LAWS["4-5-6-7"](Z) - offset, rcond=None)
    assert miss[0] < 1e-24
    assert criteria(family.law(x)).Cj == pytest.approx(52.5, rel=1e-9)
    assert minimax(family, {"Cj": 1.0}).objective < 52.5
