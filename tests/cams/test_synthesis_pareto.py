"""Pareto fronts: no law is better than another in both criteria, and the ends are the two optima."""

from __future__ import annotations

import itertools

import numpy as np
import pytest

from flexcam.cams import SplineFamily, minimax, pareto
from flexcam.core.errors import InputError

FAMILY = SplineFamily(degree=5, pieces=8)
SAME = 2e-6
"""Part by which the ends of a front are widened, so that each is a program with a solution."""

STEEP = 5e-3
"""What such a part of one criterion may cost in the other: a front ends steeply, as a root does."""


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
        assert not (a <= c * (1 - SAME) and b <= d * (1 - SAME))


def test_one_falls_while_the_other_rises(front):
    *_, values, _ = front
    assert len(values) == 5
    for (a, b), (c, d) in itertools.pairwise(values):
        assert c < a * (1 - SAME)
        assert d > b * (1 + SAME)


def test_ends(front):
    first, second, values, found = front
    assert values[0][1] == pytest.approx(minimax(FAMILY, {second: 1.0}).objective, rel=SAME)
    assert values[-1][0] == pytest.approx(minimax(FAMILY, {first: 1.0}).objective, rel=SAME)
    # Each end is the best in the other criterion among those equal in its own.
    for place, name, other in ((0, first, second), (-1, second, first)):
        own = getattr(found[place].criteria, other)
        least = minimax(FAMILY, {name: 1.0}, bounds={other: own * (1 + SAME)}).objective
        assert getattr(found[place].criteria, name) <= least * (1 + STEEP)


def test_every_law_is_the_best_under_its_second_criterion(front):
    first, second, _, found = front
    for one in found:
        assert -1e-7 <= one.gap <= 1e-6
        limit = getattr(one.criteria, second) * (1 + SAME)
        again = minimax(FAMILY, {first: 1.0}, bounds={second: limit}).objective
        assert again <= getattr(one.criteria, first) * (1 + 1e-7)
        assert again >= getattr(one.criteria, first) * (1 - STEEP)


def test_conditions_reach_every_law():
    found = pareto(FAMILY, "Ca", "Cj", count=3, conditions=[(0.3, 0, 0.21)])
    for one in found:
        assert one.law(np.array([0.3]))[0] == pytest.approx(0.21, abs=1e-9)


@pytest.mark.parametrize(
    ("first", "second", "count", "says"),
    [("Ca", "Ca", 5, "two different"), ("Ca", "Cj", 2, "three laws"), ("Ca", "Cx", 5, "Cx"), ("Cx", "Ca", 5, "Cx")],
)
def test_refused(first, second, count, says):
    with pytest.raises(InputError, match=says):
        pareto(FAMILY, first, second, count=count)
