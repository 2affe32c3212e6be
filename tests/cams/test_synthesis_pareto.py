"""Pareto fronts: no law dominates another, and the ends are the two single optima."""

import itertools

import numpy as np
import pytest

from flexcam.cams import SplineFamily, minimax, pareto
from flexcam.core.errors import InputError

FAMILY = SplineFamily(degree=5, pieces=8)
WIDENING = 2e-6
"""Relative widening of the ends of a front, so that each is a feasible program."""

SENSITIVITY = 5e-3
"""Relative change of one criterion by such a widening of the other: a front is steep at its ends, as a root."""


@pytest.fixture(
    scope="module",
    params=[
        ("Ca", "Cj"),
        pytest.param(("Cv", "Ca"), marks=pytest.mark.slow),
        pytest.param(("Cj", "Cv"), marks=pytest.mark.slow),
    ],
    ids="-".join,
)
def front(request):
    first, second = request.param
    found = pareto(FAMILY, first, second, count=5)
    return first, second, [(getattr(one.criteria, first), getattr(one.criteria, second)) for one in found], found


def test_no_law_dominates_another(front):
    *_, values, _ = front
    for (a, b), (c, d) in itertools.permutations(values, 2):
        assert not (a <= c * (1 - WIDENING) and b <= d * (1 - WIDENING))


def test_criteria_trade_off_along_front(front):
    *_, values, _ = front
    assert len(values) == 5
    for (a, b), (c, d) in itertools.pairwise(values):
        assert c < a * (1 - WIDENING)
        assert d > b * (1 + WIDENING)


def test_ends_of_front_are_single_optima(front):
    first, second, values, found = front
    assert values[0][1] == pytest.approx(minimax(FAMILY, {second: 1.0}).objective, rel=WIDENING)
    assert values[-1][0] == pytest.approx(minimax(FAMILY, {first: 1.0}).objective, rel=WIDENING)
    # Each end is the optimum of the other criterion among laws of equal own criterion.
    for place, name, other in ((0, first, second), (-1, second, first)):
        own = getattr(found[place].criteria, other)
        least = minimax(FAMILY, {name: 1.0}, bounds={other: own * (1 + WIDENING)}).objective
        assert getattr(found[place].criteria, name) <= least * (1 + SENSITIVITY)


def test_every_law_is_optimal_for_its_second_criterion(front):
    first, second, _, found = front
    for one in found:
        assert -1e-7 <= one.gap <= 1e-6
        limit = getattr(one.criteria, second) * (1 + WIDENING)
        again = minimax(FAMILY, {first: 1.0}, bounds={second: limit}).objective
        assert again <= getattr(one.criteria, first) * (1 + 1e-7)
        assert again >= getattr(one.criteria, first) * (1 - SENSITIVITY)


@pytest.mark.slow
def test_conditions_apply_to_every_law():
    found = pareto(FAMILY, "Ca", "Cj", count=3, conditions=[(0.3, 0, 0.21)])
    for one in found:
        assert one.law(np.array([0.3]))[0] == pytest.approx(0.21, abs=1e-9)


@pytest.mark.parametrize(
    ("first", "second", "count", "message"),
    [("Ca", "Ca", 5, "two different"), ("Ca", "Cj", 2, "three laws"), ("Ca", "Cx", 5, "Cx"), ("Cx", "Ca", 5, "Cx")],
)
def test_invalid_pareto_arguments_raise_error(first, second, count, message):
    with pytest.raises(InputError, match=message):
        pareto(FAMILY, first, second, count=count)
