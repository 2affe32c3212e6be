"""Kinds of law with any parameters: end values, derivatives, and one-sided limits at jumps."""

import math
from itertools import product

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from flexcam.cams import (
    KINDS,
    LAWS,
    BSplineLaw,
    CompoundCycloid,
    CosineSum,
    Harmonic,
    Polynomial,
    ReversedLaw,
    Scca,
    harmonic_acceleration,
    quinquinomial,
    through_points,
)
from flexcam.cams.motion_law import RampTransition
from flexcam.core.errors import InputError

PART = st.floats(0.02, 0.98)
WEIGHT = st.floats(0.0, 1.0)
SIGNED = st.floats(-1.0, 1.0)
ENDS = np.array([0.0, 1.0])


def scca(one, two, kind):
    b, d = (one, (1.0 - one) * two) if kind == "all" else (one, 0.0) if kind == "no cosine" else (0.0, one)
    return Scca(b, 1.0 - b - d, d)


def normalize_weights(weights):
    assume(sum(weights) > 0.1)
    return tuple(w / sum(weights) for w in weights)


def cosine_sum(free):
    """Fix d_0 and d_1 by s(0) = sum d_k = 0 and s(1) = sum (-1)^k d_k = 1."""
    even, odd = sum(free[::2]), sum(free[1::2])
    return CosineSum((0.5 - even, -0.5 - odd, *free))


def spline(inner, degree):
    return BSplineLaw((0.0,) * 3 + tuple(inner) + (1.0,) * 3, degree)


def points_law(steps, lifts):
    z = np.cumsum(steps) / sum(steps)
    return through_points((0.0, *z[:-1].tolist(), 1.0), (0.0, *lifts[: len(z) - 1], 1.0))


EXPONENTS = st.lists(st.integers(2, 20), min_size=2, max_size=6, unique=True).map(sorted).map(tuple)
STRATEGIES = {
    "scca": st.builds(scca, PART, PART, st.sampled_from(["all", "no cosine", "no sine"])),
    "polynomial": EXPONENTS.map(Polynomial),
    "quinquinomial": st.integers(1, 4).map(quinquinomial),
    "harmonic": st.lists(SIGNED, min_size=1, max_size=4).filter(lambda c: abs(sum(c)) > 0.1).map(
        lambda c: Harmonic(tuple((n, x / sum(c)) for n, x in enumerate(c, start=1)))
    ),
    "harmonic-acceleration": st.lists(WEIGHT, min_size=1, max_size=4).map(
        lambda w: harmonic_acceleration(tuple(2 * math.pi * n * c for n, c in enumerate(normalize_weights(w), start=1)))
    ),
    "cosine": st.lists(st.floats(-0.1, 0.1), max_size=4).map(cosine_sum),
    "fb2": PART.map(CompoundCycloid),
    "bspline": st.builds(spline, st.lists(WEIGHT, min_size=3, max_size=6), st.integers(5, 8)),
    "table": st.builds(
        points_law, st.lists(st.floats(0.2, 1.0), min_size=2, max_size=6), st.lists(WEIGHT, min_size=5, max_size=5)
    ),
}  # fmt: skip
"""Laws of every kind; all have zero velocity at both ends except polynomials of conditions, tested elsewhere."""

ALL_KINDS = [pytest.param(one, id=name) for name, one in STRATEGIES.items()]
FEW_EXAMPLES = settings(max_examples=25, deadline=None)


def test_strategies_cover_every_kind():
    assert set(STRATEGIES) == set(KINDS)


@pytest.mark.parametrize("laws", ALL_KINDS)
def test_end_values(laws):
    @FEW_EXAMPLES
    @given(laws)
    def check(law):
        # Coefficients of some hundred cancel to the ends.
        np.testing.assert_allclose(law(ENDS), [0.0, 1.0], rtol=0, atol=1e-12)
        np.testing.assert_allclose(law(ENDS, 1), 0.0, rtol=0, atol=1e-10)

    check()


@pytest.mark.parametrize("laws", ALL_KINDS)
def test_derivatives_are_consistent(laws, derivative_error):
    @FEW_EXAMPLES
    @given(laws)
    def check(law):
        inner = tuple(law.inner_knots) if isinstance(law, BSplineLaw) else law.breaks
        # Sums of powers and of splines on uneven knots cancel three digits of 1e-14.
        for order in (1, 2, 3, 4):
            assert derivative_error(law, order, [0.0, *inner, 1.0]) < 1e-10

    check()


@pytest.mark.parametrize("wrapped", [lambda law: law, ReversedLaw, lambda law: RampTransition(law, 0.7)],
                         ids=["plain", "turned", "from a ramp"])  # fmt: skip
@pytest.mark.parametrize("name", sorted(LAWS))
def test_derivatives_of_named_laws(name, wrapped, derivative_error):
    law = wrapped(LAWS[name])
    # The sums of powers cancel two digits of 1e-14.
    for order in (1, 2, 3, 4):
        assert derivative_error(law, order, [0.0, *law.breaks, 1.0]) < 1e-11


EXAMPLES = (
    CosineSum((0.45, -0.4, 0.05, -0.1)),
    Harmonic(((1, 0.8), (2, 0.2))),
    CompoundCycloid(0.4),
    Scca(0.2, 0.3, 0.5),
    BSplineLaw((0.0, 0.0, 0.0, 0.3, 0.8, 1.0, 1.0, 1.0), 7),
    Polynomial((3, 5, 8)),
)


@pytest.mark.parametrize("law", EXAMPLES, ids=lambda law: type(law).__name__)
def test_derivatives_against_central_differences(law):
    """An independent check: the error is (h^2/6) s^(order + 2), plus rounding over h."""
    h, z = 1e-5, np.linspace(0.001, 0.999, 500)
    at = np.array([place for place in z if all(abs(place - jump) > 2 * h for jump in law.breaks)])
    for order in (1, 2, 3, 4):
        difference = (law(at + h, order - 1) - law(at - h, order - 1)) / (2 * h)
        assert np.abs(law(at, order) - difference).max() < 1e-6 * (1.0 + np.abs(law(at, order)).max())


SIDES = {
    "scca": Scca(0.25, 0.25, 0.5),
    "trapezoid of accelerations": Scca(0.5, 0.5, 0.0),
    "parabolic": LAWS["parabolic"],
    "fb2": CompoundCycloid(0.35),
    "turned fb2": ReversedLaw(CompoundCycloid(0.35)),
    "turned parabolic": ReversedLaw(LAWS["parabolic"]),
    "fb2 from a ramp": RampTransition(CompoundCycloid(0.35), 0.4),
}


@pytest.mark.parametrize("name", SIDES)
def test_value_at_jump_is_right_limit(name):
    """At a break the value is the right limit; one bit before the break it is the left limit."""
    law, beside = SIDES[name], 1e-9
    assert law.breaks
    for order, at in product(range(5), law.breaks):
        size = 1.0 + np.abs(law(np.linspace(0.0, 1.0, 101), order)).max()
        here, left, right = law(np.array([at, np.nextafter(at, 0.0), at + beside]), order)
        before = law(np.array([at - beside]), order)[0]
        # Change of the curve over 1e-9: the next derivative is below a hundred times this one.
        assert abs(here - right) < 1e-6 * size
        assert abs(left - before) < 1e-6 * size


@pytest.mark.parametrize("name", ["fb2", "turned fb2", "fb2 from a ramp"])
def test_jerk_limits_differ_at_break(name):
    law = SIDES[name]
    sides = np.array([law(np.array([np.nextafter(at, 0.0), at]), 3) for at in law.breaks])
    assert (np.abs(np.diff(sides, axis=1)) > 1.0).all()


@FEW_EXAMPLES
@given(PART)
def test_compound_cycloid_acceleration_is_continuous_at_split(split):
    law = CompoundCycloid(split)
    for order, tolerance in ((0, 1e-14), (1, 1e-13), (2, 1e-12)):
        left, right = law(np.array([np.nextafter(split, 0.0), split]), order)
        assert left == pytest.approx(right, abs=tolerance / split)


def test_compound_cycloid_maximum_deceleration_is_at_nose():
    law = CompoundCycloid(0.25)
    z = np.linspace(0.0, 1.0, 2001)
    assert law(z, 2).argmin() == 2000
    assert law(ENDS, 3)[1] == pytest.approx(0.0, abs=1e-12)  # continuous with the mirrored return


def test_harmonic_acceleration_has_given_amplitudes():
    b = (2 * math.pi * 0.9, 4 * math.pi * 0.1)
    z = np.linspace(0.0, 1.0, 201)
    expected = b[0] * np.sin(2 * math.pi * z) + b[1] * np.sin(4 * math.pi * z)
    np.testing.assert_allclose(harmonic_acceleration(b)(z, 2), expected, rtol=0, atol=1e-13)


@pytest.mark.parametrize(
    ("b", "reason"),
    [
        ((6.0,), "velocity must vanish at both ends"),
        ((2 * math.pi * 2.0, -4 * math.pi), "the follower would turn back"),
        ((), "velocity must vanish at both ends"),
    ],
)
def test_invalid_harmonic_acceleration_raises_error(b, reason):
    with pytest.raises(InputError, match=reason):
        harmonic_acceleration(b)


@pytest.mark.parametrize("split", [0.0, 1.0, -0.2, math.nan])
def test_invalid_split_raises_error(split):
    with pytest.raises(InputError, match="split"):
        CompoundCycloid(split)


@pytest.mark.parametrize("row", [0, -1, 6])
def test_invalid_row_raises_error(row):
    with pytest.raises(InputError):
        quinquinomial(row)
