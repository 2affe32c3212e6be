"""The beat of a mass on a spring that is driven beside its own frequency."""

from __future__ import annotations

import math


def beat(speed: float, mode: float) -> tuple[float, float]:
    """Return how long an undamped oscillator beats, and how far it then leaves what drives it.

    The load form moves the valve as ``x'' + w^2 x = w^2 (1 - cos W t)/2`` from rest, under simple harmonic motion of
    lift 1. With ``r = W/w`` it leaves the lift by ``r^2/(1 - r^2) (cos w t - cos W t)/2``: the difference of two
    cosines of nearly the same frequency is a beat, bounded wherever r is not 1.
    """
    share = (speed / mode) ** 2
    if share == 1.0:
        return math.inf, math.inf
    return speed / abs(mode - speed), share / abs(1.0 - share)
