"""Laws made of cosines of multiples of half a turn."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from flexcam.checks import refuse
from flexcam.linalg import FloatArray

_ROUNDING = 1e-9


@dataclass(frozen=True)
class CosineSum:
    """s = sum d_k cos(k pi z), k from 0; d = (1/2, -1/2) is the simple harmonic law.

    Its velocity vanishes at both ends whatever the coefficients; its acceleration does so only if they see to it.

    Parameters
    ----------
    coefficients
        d_k, from k = 0.

    Raises
    ------
    InputError
        If the law does not rise from 0 to 1.

    Examples
    --------
    >>> CosineSum((0.5, -0.5))(np.array([0.0, 0.5, 1.0])).round(12)
    array([0. , 0.5, 1. ])
    """

    coefficients: tuple[float, ...]

    def __post_init__(self) -> None:
        start = sum(self.coefficients)
        end = sum(d * (-1.0) ** k for k, d in enumerate(self.coefficients))
        if not (abs(start) <= _ROUNDING and abs(end - 1.0) <= _ROUNDING):
            given = f"coefficients with s(0) = {start:.9g} and s(1) = {end:.9g}"
            raise refuse(
                "coefficients", given, "a rise from 0 to 1", remedy="they sum to 0, with alternating signs to 1"
            )

    @property
    def breaks(self) -> tuple[float, ...]:
        """Positions of inner jumps."""
        return ()

    def __call__(self, z: FloatArray, order: int = 0) -> FloatArray:
        """Return the derivative of the given order at z."""
        value = np.zeros_like(z)
        for k, d in enumerate(self.coefficients):
            w = math.pi * k
            value = value + d * w**order * np.cos(w * z + order * math.pi / 2.0)
        return value


def _products(terms: Sequence[tuple[int, int, float]]) -> tuple[float, ...]:
    """Return sum c cos(i pi z) cos(j pi z) as a plain sum: cos a cos b = (cos(a + b) + cos(a - b))/2."""
    sums = np.zeros(1 + max(i + j for i, j, _ in terms))
    for i, j, c in terms:
        sums[i + j] += 0.5 * c
        sums[abs(i - j)] += 0.5 * c
    return tuple(sums.tolist())


PAVLOVIC_NEW = CosineSum(
    _products(
        [
            (0, 0, 0.462615966796875), (1, 0, -0.4375), (1, 1, 0.095703125), (2, 0, -0.059814453125),
            (2, 2, -0.02392578125), (3, 0, -0.0625), (1, 3, 0.02734375), (3, 3, 0.001953125),
            (4, 0, -0.00213623046875), (2, 4, -0.001708984375), (4, 4, -0.000030517578125),
        ]
    )
)  # fmt: skip
"""Equation (21) of V. D. Pavlovic and M. M. Lutovac, New class of camshaft transfer functions, as printed.

It is not symmetric, s(1/2) = 0.498047, and its acceleration steps by pi^2 at both ends.
"""
