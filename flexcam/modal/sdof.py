"""One mass on a spring and a damper under a harmonic force.

How many harmonics of a cam stay below a resonance says `flexcam.synthesis.harmonics_below`.

Source: C. Li, Cam motion simulation and optimization (2014), eqs. 1-4; W. T. Thomson, Theory of Vibration with
Applications, ch. 3.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from flexcam.checks import positive
from flexcam.linalg import FloatArray

ComplexArray = NDArray[np.complex128]


def frequency_response(mass: float, damping: float, stiffness: float, omega: FloatArray) -> ComplexArray:
    """Return H of ``m y'' + c y' + k y = F0 exp(i w t)``, y = H F0 exp(i w t): ``1/(k - m w^2 + i c w)``, eq. 3."""
    natural = math.sqrt(positive("stiffness", stiffness, "N/m") / positive("mass", mass, "kg"))
    ratio = positive("damping", damping, "N s/m", zero=True) / (2.0 * math.sqrt(stiffness * mass))
    return normalized_response(np.asarray(omega) / natural, ratio) / stiffness


def normalized_response(frequency_ratio: FloatArray, damping_ratio: float) -> ComplexArray:
    """Return y/B of ``y'' + 2 xi w0 y' + w0^2 y = B w0^2 exp(i w t)``, eq. 4: ``1/(1 - r^2 + 2 i xi r)``, r = w/w0."""
    xi = positive("damping_ratio", damping_ratio, "", zero=True)
    r = np.asarray(frequency_ratio, dtype=float)
    below = 1.0 - r**2 + 2j * xi * r
    return np.divide(1.0, below, out=np.full(below.shape, complex(math.inf, 0.0)), where=below != 0.0)
