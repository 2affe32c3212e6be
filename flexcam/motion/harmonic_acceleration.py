"""Laws of a harmonic acceleration, given by the amplitudes of its sines."""

from __future__ import annotations

import math

import numpy as np

from flexcam.checks import refuse
from flexcam.motion.harmonic import Harmonic

_GRID = np.linspace(0.0, 1.0, 4001)
_ROUNDING = 1e-9


def harmonic_acceleration(b: tuple[float, ...] = (2.0 * math.pi,)) -> Harmonic:
    """Return the law with the acceleration sum b_n sin(2 pi n z), n from 1.

    Rest at both ends needs sum b_n/(2 pi n) = 1, and the follower must not turn back. Source: C. Li, Cam motion
    simulation and optimization (2014), eqs. 7-11. One amplitude of 2 pi is the cycloidal law.

    Parameters
    ----------
    b
        Amplitudes b_1, b_2, ..., of the normalized acceleration.

    Returns
    -------
    Harmonic
        The law.

    Raises
    ------
    InputError
        If the velocity does not vanish at the ends, or is negative in between.

    Examples
    --------
    >>> harmonic_acceleration().harmonics
    ((1, 1.0),)
    """
    law = Harmonic(tuple((n, amplitude / (2.0 * math.pi * n)) for n, amplitude in enumerate(b, start=1)))
    total = sum(c for _, c in law.harmonics)
    if not abs(total - 1.0) <= _ROUNDING:
        why = "the velocity must vanish at both ends"
        raise refuse("b", f"amplitudes with sum b_n/(2 pi n) = {total:.9g}", "a sum of 1", why, "scale them")
    slowest = float(law(_GRID, 1).min())
    if slowest < -_ROUNDING:
        why = f"the velocity falls to {slowest:.4g}: the follower would turn back"
        raise refuse("b", f"{list(b)}", "amplitudes with a velocity of zero or more", why)
    return law
