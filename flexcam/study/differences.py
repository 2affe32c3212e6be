"""Derivatives by central differences of two steps, with an estimate of their error."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from flexcam.linalg import FloatArray

STEPS = (-1.0, -0.5, 0.5, 1.0)
"""Where a function is evaluated beside its point, in steps."""

_LARGE = 0.05
"""Part of a derivative from which its error is no longer a detail."""

_SAME_JUMP = 0.8
"""Ratio of a slope's jump at half the step to that at the whole one: 1/2 for smooth functions, 1 for a kink."""

_NOISE = 1e-9
"""Change of a function, as a part of it, that is only rounding."""


@dataclass(frozen=True)
class Derivative:
    """A derivative of a function of one variable.

    Parameters
    ----------
    value
        By Richardson's extrapolation of two central differences: the error of fourth order in the step.
    error
        By how much extrapolation changed it.
    smooth
        Whether the function looks smooth: else the derivative means little, whatever the error says.
    """

    value: float
    error: float
    smooth: bool


def central(middle: float, beside: FloatArray, step: float) -> Derivative:
    """Return the derivative of a function from values beside a point.

    Exact for polynomials of up to the fourth degree. L. F. Richardson, Phil. Trans. R. Soc. A 210 (1911) 307.
    """
    far_below, below, above, far_above = (float(one) for one in beside)
    whole, half = (far_above - far_below) / (2.0 * step), (above - below) / step
    value = (4.0 * half - whole) / 3.0
    error = abs(value - half)
    pairs = ((far_above, far_below, step), (above, below, 0.5 * step))
    jumps = [abs(up - 2.0 * middle + down) / h for up, down, h in pairs]
    size = max(abs(value), _NOISE * abs(middle) / step, float(np.finfo(float).tiny))
    kink = jumps[1] > _LARGE * size and jumps[1] > _SAME_JUMP * jumps[0]
    return Derivative(value, error, not (kink or error > _LARGE * size))


def logarithmic(derivative: float, parameter: float, value: float) -> float:
    """Return by how many percent a value changes if a parameter grows by one percent."""
    return parameter * derivative / value if value != 0.0 else math.nan
