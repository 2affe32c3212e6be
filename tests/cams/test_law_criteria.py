"""Criteria of laws: shared extremes, plateaus, jumps and violations."""

import math
import re

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from flexcam.cams import LAWS, CompoundCycloid, Harmonic, Polynomial, ReversedLaw, Scca, criteria, quinquinomial
from flexcam.cams.law_criteria import stationary_points


def test_shared_extremes_list_every_position():
    """Pure 3rd harmonic on a line: s' = 1 - cos 6 pi z is 2 three times and 0 four times."""
    found = criteria(Harmonic(((3, 1.0),)))
    top, bottom = found.velocity[1], found.velocity[0]
    np.testing.assert_allclose([top.at, *top.also], [1 / 6, 1 / 2, 5 / 6], rtol=0, atol=1e-9)
    np.testing.assert_allclose(
        [bottom.at, *bottom.also], [0, 1 / 3, 2 / 3, 1], rtol=0, atol=1e-7
    )  # flat: value to 1e-16
    assert top.value == pytest.approx(2.0, rel=1e-15)


def test_plateau_is_listed_once():
    found = criteria(LAWS["modified-trapezoid"]).acceleration
    for extreme, start in zip(found, (5 / 8, 1 / 8), strict=True):
        assert extreme.also == ()
        assert extreme.at == pytest.approx(start, abs=1e-3)


def test_single_extreme_has_one_position():
    found = criteria(LAWS["cycloidal"])
    assert found.velocity[1].also == ()
    assert found.acceleration[1].at == pytest.approx(0.25, abs=1e-9)
    assert found.acceleration[0].at == pytest.approx(0.75, abs=1e-9)


@settings(max_examples=15, deadline=None)
@given(st.floats(0.1, 0.9))
def test_extremes_of_compound_cycloid(split):
    """Peaks A at p/2 and -A p/(1 - p) at the nose, velocity 2 A p/pi at p, jerk A pi/p at the start."""
    found = criteria(CompoundCycloid(split))
    peak = 1.0 / (split**2 / math.pi + 4 * split * (1 - split) / math.pi**2)
    up, down = found.acceleration[1], found.acceleration[0]
    assert (up.value, up.at) == (pytest.approx(peak, rel=1e-12), pytest.approx(split / 2, abs=1e-8))
    assert (down.value, down.at) == (pytest.approx(-peak * split / (1 - split), rel=1e-12), pytest.approx(1.0))
    assert found.Cv == pytest.approx(2 * peak * split / math.pi, rel=1e-12)
    assert found.jerk[1].value == pytest.approx(peak * math.pi / split, rel=1e-9)
    assert found.jumps == (3,)


@pytest.mark.parametrize(
    "law",
    [
        quinquinomial(2),
        CompoundCycloid(0.3),
        LAWS["pavlovic-new"],
        Polynomial((2, 9)),
        pytest.param(Scca(0.2, 0.5, 0.3), marks=pytest.mark.slow),
    ],
)
def test_reversed_law_has_same_criteria_with_opposite_signs(law):
    one, other = criteria(law), criteria(ReversedLaw(law))
    for attribute in ("Cv", "Ca", "Cm"):
        assert getattr(one, attribute) == pytest.approx(getattr(other, attribute), rel=1e-11)
    np.testing.assert_allclose(one.rms, other.rms, rtol=1e-11)
    np.testing.assert_allclose(one.harmonics, other.harmonics, rtol=0, atol=1e-11)
    assert one.acceleration[1].value == pytest.approx(-other.acceleration[0].value, rel=1e-11)
    assert one.middle == pytest.approx(1.0 - other.middle, abs=1e-14)
    assert one.symmetric == other.symmetric


def test_cm_is_absolute_value():
    """The larger moment of the new law is negative."""
    found = criteria(LAWS["pavlovic-new"])
    assert found.Cm == -found.moment[0].value > found.moment[1].value


@pytest.mark.parametrize("order", [1, 2, 3])
@pytest.mark.parametrize("name", ["3-4-5", "fb2", "modified-sine", "pavlovic-new", "quinquinomial-4"])
def test_stationary_points_include_maximum(name, order):
    law, z = LAWS[name], np.linspace(0.0, 1.0, 20_001)
    at = stationary_points(law, order)
    assert (np.diff(at) >= 0.0).all()
    grid = np.abs(law(z, order)).max()
    assert grid * (1 - 1e-12) <= np.abs(law(at, order)).max() <= grid * (1 + 1e-3)


VIOLATIONS = {
    "cycloidal": ["jerk"],
    "4-5-6-7": [],
    "5-6-7-8-9": [],
    "shm": ["acceleration"],
    "2-3": ["acceleration", "jerk"],
    "parabolic": ["acceleration", "inside"],
    "modified-sine": ["jerk"],
    "pavlovic-trigonometric": ["velocity", "jerk"],
    "pavlovic-new": ["acceleration", "symmetric"],
    "quinquinomial": ["acceleration", "symmetric"],
    "fb2": ["acceleration", "jerk", "inside", "symmetric"],
}


@pytest.mark.parametrize("name", VIOLATIONS)
def test_violations_of_laws(name):
    found = criteria(LAWS[name])
    words = {
        "velocity": "the velocity jumps at a dwell", "acceleration": "the acceleration jumps at a dwell",
        "jerk": "the jerk jumps at a dwell", "inside": "jumps inside the rise", "symmetric": "not symmetric",
    }  # fmt: skip
    assert [re.split("[:,]", violation)[0] for violation in found.violations] == [
        words[key] for key in VIOLATIONS[name]
    ]


class ShortLaw:
    """Law that does not reach a lift of 1, as a law of another package may."""

    breaks = ()

    def __call__(self, z, order=0):
        return 0.1 * (order == 0) + 0.8 * LAWS["cycloidal"](z, order)


def test_wrong_end_values_are_violations():
    broken = criteria(ShortLaw()).violations
    assert broken[0] == "s(0) = 0.1, not 0"
    assert broken[1] == "s(1) = 0.9, not 1"


def test_quinquinomial_steps_on_one_side_only():
    (first, _) = criteria(LAWS["quinquinomial"]).violations
    assert first.endswith("by +6.33745 at z = 0")


def test_jumps_by_order():
    assert criteria(LAWS["parabolic"]).jumps == (2,)
    assert criteria(LAWS["fb2"]).jumps == (3,)
    assert criteria(ReversedLaw(LAWS["fb2"])).jumps == (3,)
    assert criteria(LAWS["modified-trapezoid"]).jumps == ()
    assert criteria(Scca(0.5, 0.5, 0.0)).jumps == (2,)
