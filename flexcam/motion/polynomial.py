"""Polynomial laws of given exponents."""

from __future__ import annotations

import math
from dataclasses import dataclass
from fractions import Fraction
from functools import cached_property
from itertools import pairwise

import numpy as np

from flexcam.checks import refuse
from flexcam.linalg import FloatArray

_NEAR_END = 0.05
"""Distance from z = 1 within which the law is summed in powers of 1 - z: its end conditions then hold exactly."""


@dataclass(frozen=True)
class Polynomial:
    """s = sum a_j z^j over given exponents, with s(1) = 1 and as many derivatives zero at z = 1 as there is room for.

    The coefficients are ``a_j = prod p_i/(p_i - p_j)`` over the other exponents, exact as fractions; with the lowest
    exponent p the first p - 1 derivatives vanish at z = 0. Source: R. L. Norton, Cam Design and Manufacturing
    Handbook, 2nd ed. (2009), ch. 4, for 3-4-5 and 4-5-6-7.

    Parameters
    ----------
    exponents
        Distinct whole numbers from 2, ascending.

    Raises
    ------
    InputError
        If there are fewer than two, or they are not ascending from 2.

    Examples
    --------
    >>> Polynomial((3, 4, 5)).coefficients
    (10.0, -15.0, 6.0)
    """

    exponents: tuple[int, ...]

    def __post_init__(self) -> None:
        p = self.exponents
        if len(p) < 2 or p[0] < 2 or any(b <= a for a, b in pairwise(p)):
            raise refuse("exponents", list(p), "two or more whole numbers, ascending from 2", "s' must vanish at z = 0")

    @cached_property
    def _exact(self) -> tuple[Fraction, ...]:
        p = self.exponents
        return tuple(math.prod((Fraction(q, q - own) for q in p if q != own), start=Fraction(1)) for own in p)

    @property
    def coefficients(self) -> tuple[float, ...]:
        """Coefficients of the powers of z, in the order of the exponents."""
        return tuple(float(a) for a in self._exact)

    @cached_property
    def _from_end(self) -> FloatArray:
        """Coefficients of the powers of w = 1 - z, from w^0; the ones that vanish do so exactly."""
        powers = range(self.exponents[-1] + 1)
        terms = zip(self._exact, self.exponents, strict=True)
        pairs = [(a, p) for a, p in terms]
        return np.array([float((-1) ** m * sum(a * math.comb(p, m) for a, p in pairs)) for m in powers])

    @property
    def breaks(self) -> tuple[float, ...]:
        """Positions of inner jumps."""
        return ()

    def __call__(self, z: FloatArray, order: int = 0) -> FloatArray:
        """Return the derivative of the given order at z."""
        dense = np.zeros(self.exponents[-1] + 1)
        dense[list(self.exponents)] = self.coefficients
        near = 1.0 - z < _NEAR_END
        from_start = np.polynomial.polynomial.polyval(np.where(near, 0.0, z), _derived(dense, order))
        from_end = np.polynomial.polynomial.polyval(np.where(near, 1.0 - z, 0.0), _derived(self._from_end, order))
        return np.where(near, (-1.0) ** order * from_end, from_start)


def _derived(coefficients: FloatArray, order: int) -> FloatArray:
    return np.asarray(np.polynomial.polynomial.polyder(coefficients, order), dtype=float) if order else coefficients
