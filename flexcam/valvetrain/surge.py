"""Number of parts of a spring with mass to resolve surge.

A spring of stiffness k and mass m is a bar with wave travel time T = sqrt(m/k); fixed at both ends its natural
frequencies are multiples of f1 = 1/(2 T) (A. M. Wahl, Mechanical Springs, 1963). An end that moves at velocity v sends
a wave of force sqrt(k m) v through it. The harmonic n of a lift at the speed W, of amplitude a_n, sends sqrt(k m) n W
a_n, so that all beyond the harmonic N send at most ``k T W sum(n a_n, n > N)``. N is the last that matters where this
is a hundredth of ``k h``, the spring force of the whole lift h; a rocker's ratio changes both alike.

Linear parts with consistent mass, p of them in half a wave, have a natural frequency too high by ``(pi/p)^2/24`` of it
(T. J. R. Hughes, The Finite Element Method, 1987): 2.6 % with the four taken here at the last harmonic
that matters, 0.6 % at half of its frequency. Half a wave fits into the spring f/f1 times at a frequency f.
"""

from __future__ import annotations

import math
from collections.abc import Iterable

import numpy as np

from flexcam.cams import Event, harmonics
from flexcam.valvetrain.parts import Spring

_PER_HALF_WAVE = 4
"""Parts per half wave, and minimum number of parts, as a valve that hits its seat excites surge at any speed."""

_MOST = 16
"""Default maximum number of parts; for longer waves the case must specify the number."""

_FORCE_FRACTION = 0.01
"""Fraction of the spring force by the lift below which waves of higher harmonics are neglected."""

_HARMONICS = 256


def surge_frequency(spring: Spring) -> float:
    """Return the first natural frequency of a spring with mass fixed at both ends, Hz."""
    return 0.5 * math.sqrt(spring.stiffness / spring.mass)


def count_spring_parts(spring: Spring, lifts: Iterable[Event], speed: float) -> int:
    """Return the default number of parts of a spring for given lifts at a camshaft speed."""
    if not (spring.mass > 0.0 and spring.stiffness > 0.0):
        return 1
    surge = 2.0 * math.pi * surge_frequency(spring) / speed
    waves = max((_last_harmonic(lift, surge) / surge for lift in lifts), default=0.0)
    return min(math.ceil(_PER_HALF_WAVE * max(waves, 1.0)), _MOST)


def _last_harmonic(lift: Event, surge: float) -> int:
    """Return the last relevant harmonic of a lift for a spring with surge at a camshaft order."""
    orders = np.arange(_HARMONICS + 1)
    sent = math.pi / surge * orders * np.abs(harmonics(lift, _HARMONICS))  # W T = pi W / (2 pi f1)
    beyond = np.cumsum(sent[::-1])[::-1]
    return int(np.count_nonzero(beyond > _FORCE_FRACTION * lift.height)) - 1
