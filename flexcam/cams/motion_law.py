"""Motion laws: a normalized rise from 0 to 1 over 0 to 1, with its derivatives."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise
from typing import Protocol, runtime_checkable

import numpy as np

from flexcam.core import FloatArray


class Law(Protocol):
    """Normalized motion law s(z), s(0) = 0 and s(1) = 1.

    A law is a frozen dataclass with its parameters as fields. At a jump of a derivative, the value is the right limit
    (at z = 1 the left limit).
    """

    @property
    def breaks(self) -> tuple[float, ...]:
        """Positions inside 0 to 1 where a derivative jumps."""
        ...

    def __call__(self, z: FloatArray, order: int = 0) -> FloatArray:
        """Return the derivative of the given order (0 to 4) at positions z from 0 to 1, shape as `z`."""
        ...


@runtime_checkable
class AnalyticResidual(Protocol):
    """Law with a closed form of its residual vibration."""

    def residual(self, ratio: FloatArray) -> FloatArray:
        """Return the amplitude over the lift, for rise times in periods of the oscillator, above zero."""
        ...


def horner(z: FloatArray, coefficients: FloatArray) -> FloatArray:
    """Evaluate a polynomial by Horner's scheme.

    Parameters
    ----------
    z
        Any shape.
    coefficients
        Of the powers from the zeroth, one at least.

    Returns
    -------
    ndarray
        Shape as `z`.

    Examples
    --------
    >>> horner(np.array([2.0]), np.array([1.0, 0.0, 3.0]))
    array([13.])
    """
    highest, *rest = coefficients[::-1].tolist()
    value = np.full_like(z, highest)
    for one in rest:
        value *= z
        value += one
    return value


_POINTS = 16


def quadrature(breaks: tuple[float, ...], panels: int = 64) -> list[tuple[FloatArray, FloatArray]]:
    """Return Gauss points and weights of panels that contain no joint inside."""
    points, weights = np.polynomial.legendre.leggauss(_POINTS)
    edges = np.unique(np.concatenate([np.linspace(0.0, 1.0, panels + 1), breaks]))
    return [(0.5 * (a + b) + 0.5 * (b - a) * points, 0.5 * (b - a) * weights) for a, b in pairwise(edges)]


@dataclass(frozen=True)
class ReversedLaw:
    """Reversed law s(z) = 1 - u(1 - z); a symmetric law equals its reverse.

    R. Roussev, B. Paleva-Kadiyska and V. Galabov, Quinquinomial power functions (2021), eq. 1, reverse their laws in
    this way for a cam with a lower dwell only.

    Parameters
    ----------
    law
        The law u.
    """

    law: Law

    @property
    def breaks(self) -> tuple[float, ...]:
        """Positions of inner jumps."""
        return tuple(sorted(1.0 - at for at in self.law.breaks))

    def __call__(self, z: FloatArray, order: int = 0) -> FloatArray:
        """Return the derivative of the given order at z; at a jump the right limit, which is the left limit of u."""
        mirrored = 1.0 - z
        for at in self.law.breaks:
            mirrored = np.where(z == 1.0 - at, np.nextafter(at, 0.0), mirrored)
        turned = (-1.0) ** (order + 1) * self.law(mirrored, order)
        return 1.0 + turned if order == 0 else turned
