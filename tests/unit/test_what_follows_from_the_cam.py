"""What follows from the cam: evaluated once, put together where it is needed, told apart where it changes."""

from __future__ import annotations

import numpy as np
import pytest

from flexcam.integrate.schedule import Weights
from flexcam.system import ONE, Evaluated, Formula, Kind
from flexcam.system.local import Derivative
from flexcam.train.penalty import HertzLine, HuntCrossley, Inclined, Sliding, Stop


class Counted:
    """The sine, and how many angles it was asked for."""

    def __init__(self):
        self.asked = 0

    def __call__(self, angle, order):
        self.asked += len(angle)
        return np.sin(angle + order * np.pi / 2.0)


def test_a_function_is_computed_once():
    sine, angle = Counted(), np.linspace(0.0, 1.0, 7)
    known = Evaluated(angle)
    slope = known(sine, 1)
    assert known(Derivative(sine), 0) is slope
    assert sine.asked == 7


def test_what_is_known_is_found_among_more_angles():
    sine, angle = Counted(), np.linspace(0.0, 1.0, 7)
    known, at = Evaluated(angle[[0, 2, 3, 6]]), np.array([0, 2, 3, 6])
    known(sine, 0)
    found = Evaluated(angle, known, at)(sine, 0)
    np.testing.assert_array_equal(found, np.sin(angle))
    assert sine.asked == 4 + 3


def test_what_is_made_once_stays():
    known = Evaluated(np.zeros(1))
    assert known.once("key", lambda: [1]) is known.once("key", lambda: [2])


def test_weights_are_put_together():
    moving = np.array([2.0, 3.0, 4.0])
    weights = Weights(np.array([1.0, 0.0, -1.0]), [(1, moving)], 3)
    whole = np.array([[1.0, x, -1.0] for x in moving])
    np.testing.assert_array_equal(weights.whole, whole)
    np.testing.assert_array_equal(weights.columns(np.array([2, 1])), whole[:, [2, 1]])
    for rows in (slice(1, 2), np.array([2, 0])):
        np.testing.assert_array_equal(weights.at(rows).whole, whole[rows])
    added = np.ones((3, 3))
    weights.add(added)
    np.testing.assert_array_equal(added, whole + 1.0)
    for some in (whole, whole[:1]):
        np.testing.assert_array_equal(Weights.known(some).whole, some)


def line(radius):
    return HertzLine(0.014, 2.1e11, 0.3, lambda angle, order: radius * (1.0 + angle), 0.018, 0.1)


@pytest.mark.parametrize("radius", [1e-4, 0.001, 0.01])
@pytest.mark.parametrize("wrapped", [False, True], ids=["alone", "with friction"])
def test_only_the_changing_part_of_a_line_contact_changes_with_the_cam(radius, wrapped):
    law = Sliding(line(radius), 0.1, 0.01) if wrapped else line(radius)
    gap = np.linspace(-1e-5, 2e-3, 40)[:, None] * np.ones(1 + wrapped)
    state, angles = np.zeros((40, 0)), (np.zeros(40), np.ones(40))
    stored = [law.stored(gap, state, angle).energy for angle in angles]
    changing = [law.changing(gap, state, angle) for angle in angles]
    assert np.abs(changing).max() > 0.0
    assert not np.array_equal(stored[0], stored[1])
    # Differences of energies round by a few eps of them.
    np.testing.assert_allclose(stored[1] - stored[0], changing[1] - changing[0], atol=1e-14 * np.abs(stored).max())


def test_a_round_contact_has_no_changing_part():
    gap = np.full((3, 1), 1e-5)
    assert not line(0.02).changing(gap, np.zeros((3, 0)), np.zeros(3)).any()


@pytest.mark.parametrize(
    ("law", "count", "lossless"),
    [
        (Stop(1.0), 2, True),
        (Stop(1.0, 0.1), 1, False),
        (HuntCrossley(1.0, 0.0), 1, True),
        (HuntCrossley(1.0, 0.1), 1, False),
        (Sliding(HuntCrossley(1.0, 0.0), 0.1, 0.01), 2, False),
        (Inclined(line(0.1), ONE), 1, False),
    ],
)
def test_which_laws_lose_nothing(law, count, lossless):
    assert all(one.lossless for one in law.formulas(count)) is lossless


def test_leaking_oil_loses():
    assert not Formula(Kind.OIL, (1.0, 1.0, 1.0, 0.0)).lossless
