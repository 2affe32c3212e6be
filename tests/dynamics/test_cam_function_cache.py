"""Cache of cam functions, and conservative force laws."""

from dataclasses import replace

import numpy as np
import pytest

from flexcam.dynamics import CamFunctionCache, elastic_stop, hunt_crossley_contact, oil_column_law
from flexcam.dynamics.cam_motion import Derivative


class CountingSine:
    """Sine that counts the angles it evaluates."""

    def __init__(self):
        self.evaluations = 0

    def __call__(self, angle, order):
        self.evaluations += len(angle)
        return np.sin(angle + order * np.pi / 2.0)


def test_cam_function_is_evaluated_once():
    sine, angle = CountingSine(), np.linspace(0.0, 1.0, 7)
    known = CamFunctionCache(angle)
    slope = known(sine, 1)
    assert known(Derivative(sine), 0) is slope
    assert sine.evaluations == 7


def test_lookup_returns_cached_object():
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
def test_is_conservative_of_laws(law, lossless):
    assert law.is_conservative is lossless
