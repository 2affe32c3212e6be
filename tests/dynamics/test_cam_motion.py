"""What follows from the cam: evaluated once, put together where it is needed, told apart where it changes."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from flexcam.dynamics import CamFunctionCache, elastic_stop, hunt_crossley_contact, oil_column_law
from flexcam.dynamics.cam_motion import Derivative


class Counted:
    """The sine, and how many angles it was asked for."""

    def __init__(self):
        self.asked = 0

    def __call__(self, angle, order):
        self.asked += len(angle)
        return np.sin(angle + order * np.pi / 2.0)


def test_a_function_is_computed_once():
    sine, angle = Counted(), np.linspace(0.0, 1.0, 7)
    known = CamFunctionCache(angle)
    slope = known(sine, 1)
    assert known(Derivative(sine), 0) is slope
    assert sine.asked == 7


def test_what_is_made_once_stays():
    known = CamFunctionCache(np.zeros(1))
    assert known.lookup("key", lambda: [1]) is known.lookup("key", lambda: [2])


@pytest.mark.parametrize(
    ("law", "lossless"),
    [
        (elastic_stop(1.0), True),
        (elastic_stop(1.0, 0.1), False),
        (hunt_crossley_contact(1.0, 0.0), True),
        (hunt_crossley_contact(1.0, 0.1), False),
        (replace(hunt_crossley_contact(1.0, 0.0), friction=(0.1, 0.01)), False),
        (oil_column_law(1.0, 1.0, 1.0, 0.0), False),
    ],
)
def test_which_laws_are_lossless(law, lossless):
    assert law.is_conservative is lossless
