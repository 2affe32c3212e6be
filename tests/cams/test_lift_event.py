"""Lift events: periodicity, phase, dwells, and one-sided values at jumps."""

import math

import numpy as np
import pytest

from flexcam.cams import LAWS, LiftEvent
from flexcam.core.errors import InputError

TURN = 2 * math.pi
RISE, DWELL, FALL, PHASE, LIFT = 1.1, 0.4, 1.7, 0.6, 0.008
ANGLES = np.linspace(0.0, TURN, 721)
FINE = np.linspace(0.0, TURN, 7201)


def event(law="cycloidal", **changes):
    return LiftEvent(
        LAWS[law], **({"lift": LIFT, "rise": RISE, "dwell": DWELL, "fall": FALL, "phase": PHASE} | changes)
    )


@pytest.mark.parametrize("law", sorted(LAWS))
def test_event_is_periodic(law):
    """The angle of turn 5000 rounds by 4e-12 rad, half a bit in the product and half in the sum.

    The resulting change is the next derivative times this rounding, which is large for exponents of 50: its maximum
    is taken as the steepest chord between joints plus one half. The rest is rounding of the law itself, 1e-12 of the
    curve. No angle of the grid is that close to a jump, except the joints, which are snapped to.
    """
    one = event(law)
    smooth = np.searchsorted(one.joints, FINE[:-1]) == np.searchsorted(one.joints, FINE[1:], side="right")
    for order in range(5):
        here = one(ANGLES, order)
        slope = np.abs(np.diff(one(FINE, order))[smooth]).max() / FINE[1]
        for turns in (-3, 1, 5000):
            slip = np.spacing((abs(turns) + 1) * TURN)
            difference = np.abs(one(ANGLES + turns * TURN, order) - here).max()
            assert difference <= 1.5 * slip * slope + 1e-12 * np.abs(here).max()


def test_lift_in_rise_dwell_and_return():
    at = PHASE + np.array(
        [0.0, RISE / 2, RISE, RISE + DWELL, RISE + DWELL + FALL / 2, RISE + DWELL + FALL, RISE + DWELL + FALL + 0.5]
    )
    np.testing.assert_allclose(event()(at), LIFT * np.array([0, 0.5, 1, 1, 0.5, 0, 0]), rtol=0, atol=1e-16)


@pytest.mark.parametrize("order", [1, 2, 3, 4])
def test_derivatives_are_zero_in_dwells(order):
    held = PHASE + RISE + np.linspace(1e-6, DWELL - 1e-6, 7)
    low = PHASE - np.linspace(1e-6, TURN - RISE - DWELL - FALL - 1e-6, 7)
    assert not event("shm")(np.concatenate([held, low]), order).any()


@pytest.mark.parametrize("slip", [-1e-12, 0.0, 1e-12])
def test_value_at_jump_is_right_limit_despite_rounding(slip):
    """Parabolic rise-dwell-return: acceleration +a, -a | 0 | -b, +b | 0; the value at a joint is the right limit."""
    a, b = 4 * LIFT / RISE**2, 4 * LIFT / FALL**2
    joints = PHASE + np.array([0.0, RISE / 2, RISE, RISE + DWELL, RISE + DWELL + FALL / 2, RISE + DWELL + FALL])
    for turns in (0, 1, 7):
        values = event("parabolic")(joints + turns * TURN + slip, 2)
        np.testing.assert_allclose(values, [a, -a, 0.0, -b, b, 0.0], rtol=1e-12, atol=1e-15)


@pytest.mark.parametrize("steps", [7, 360, 3600, 7919])
def test_value_at_jump_is_independent_of_step(steps):
    """Half a turn up and half down: k * step is at the joints up to rounding, over ten revolutions."""
    full = LiftEvent(LAWS["parabolic"], 1.0, math.pi, math.pi)
    first = full(np.arange(steps) * (TURN / steps), 2)
    for turn in range(1, 10):
        np.testing.assert_array_equal(full(np.arange(turn * steps, (turn + 1) * steps) * (TURN / steps), 2), first)


@pytest.mark.parametrize(
    "changes", [{"rise": 0.0}, {"lift": -1.0}, {"dwell": 4.0}, {"fall": 180.0}, {"rise": math.nan}]
)
def test_invalid_event_raises_error(changes):
    with pytest.raises(InputError):
        event(**changes)
