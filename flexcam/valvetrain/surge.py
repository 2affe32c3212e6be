"""Into how many parts a spring with mass has to be divided, so that the cam's waves in it are seen.

A spring of stiffness k and mass m is a bar that a wave passes in T = sqrt(m/k); held at both ends it surges at the
multiples of f1 = 1/(2 T) (A. M. Wahl, Mechanical Springs, 1963). An end that moves at velocity v sends a wave of force
sqrt(k m) v through it. The harmonic n of a lift at the speed W, of amplitude a_n, sends sqrt(k m) n W a_n, so that all
beyond the harmonic N send at most ``k T W sum(n a_n, n > N)``. N is the last that matters where this is a hundredth of
``k h``, what the whole lift h does to the spring; a rocker's ratio changes both alike.

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
"""Parts; a spring has no fewer, for a valve that comes down on its seat makes it surge at any speed."""

_MOST = 16
"""Parts by default: of springs that a wave takes longer to pass, a case says how many."""

_MATTERS = 0.01
"""Part of the force of a lift on a spring below which the waves of its highest harmonics are left out."""

_HARMONICS = 256


def surge_frequency(spring: Spring) -> float:
    """Return the first natural frequency of a spring with mass that is held at both ends, Hz."""
    return 0.5 * math.sqrt(spring.stiffness / spring.mass)


def parts_for_waves(spring: Spring, lifts: Iterable[Event], speed: float) -> int:
    """Return into how many parts a spring is divided where nobody says it, for given lifts at a camshaft speed."""
    if not (spring.mass > 0.0 and spring.stiffness > 0.0):
        return 1
    surge = 2.0 * math.pi * surge_frequency(spring) / speed
    waves = max((_last_that_matters(lift, surge) / surge for lift in lifts), default=0.0)
    return min(math.ceil(_PER_HALF_WAVE * max(waves, 1.0)), _MOST)


def _last_that_matters(lift: Event, surge: float) -> int:
    """Return the last harmonic of a lift whose waves matter in a spring that surges at an order of the camshaft."""
    orders = np.arange(_HARMONICS + 1)
    sent = math.pi / surge * orders * np.abs(harmonics(lift, _HARMONICS))  # W T = pi W / (2 pi f1)
    beyond = np.cumsum(sent[::-1])[::-1]
    return int(np.count_nonzero(beyond > _MATTERS * lift.height)) - 1
