"""Residual vibration of an undamped oscillator after a rise: y'' + w^2 y = w^2 s."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike

from flexcam.checks import refuse
from flexcam.linalg import FloatArray
from flexcam.motion.law import ClosedResidual, Law
from flexcam.motion.quadrature import quadrature

_LARGEST = 1e3
_PANELS_PER_PERIOD = 8
"""Panels of sixteen points per oscillation: exact to rounding."""


def residual_spectrum(law: Law, ratio: ArrayLike) -> FloatArray:
    """Return the amplitude of the vibration that a rise leaves behind, over the lift.

    Closed form where the law has one. Otherwise the oscillator's exact answer, the Fourier integral of s'' over the
    rise with what steps of s' at its ends add, by Gauss quadrature between the law's joints. Source: M. P. Koster,
    Vibrations of Cam Mechanisms (1974), ch. 3.
    """
    periods = np.asarray(ratio, dtype=float)
    if not ((periods > 0.0).all() and (periods <= _LARGEST).all()):
        raise refuse("ratio", str(ratio), f"rise times over the period, above zero, up to {_LARGEST:g}")
    return law.residual(periods) if isinstance(law, ClosedResidual) else _convolved(law, periods)


def _convolved(law: Law, ratio: FloatArray) -> FloatArray:
    w = 2.0 * math.pi * ratio
    panels = 64 + int(_PANELS_PER_PERIOD * ratio.max(initial=0.0))
    total = law(np.zeros(1), 1)[0] - law(np.ones(1), 1)[0] * np.exp(1j * w)
    for z, weight in quadrature(law.breaks, panels):
        values = weight * law(z, 2)
        total = total + np.exp(1j * w[..., None] * z) @ values
    return np.abs(total) / w
