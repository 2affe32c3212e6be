"""Polynomial and B-spline laws."""

from __future__ import annotations

import math
from dataclasses import dataclass
from fractions import Fraction
from functools import cached_property
from itertools import pairwise
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.polynomial.polynomial import polyder, polyval

from flexcam.cams.motion_law import SmoothLaw
from flexcam.core import FloatArray
from flexcam.core.errors import refuse

if TYPE_CHECKING:
    from scipy.interpolate import BSpline

_LARGEST = 60  # exponent above which too many digits are lost between the ends
_NEAR_END = 0.05  # distance from z = 1 within which powers of 1 - z are evaluated, so that the end conditions are exact
_MIN_DEGREE = 5  # of a spline: below it the fourth derivative is not continuous


@dataclass(frozen=True)
class Polynomial(SmoothLaw):
    """s = sum a_j z^j with given exponents, by default with s(1) = 1 and as many zero derivatives at 1 as possible.

    The coefficients then are ``a_j = prod p_i/(p_i - p_j)`` over the other exponents; with the lowest exponent p the
    first p - 1 derivatives vanish at z = 0. They are exact fractions, even for explicit conditions. Reference: R. L.
    Norton, Cam Design and Manufacturing Handbook, 2nd ed. (2009), ch. 4, for 3-4-5 and 4-5-6-7.

    Examples
    --------
    >>> Polynomial((3, 4, 5)).coefficients
    (10.0, -15.0, 6.0)
    """

    exponents: tuple[int, ...]  #: distinct whole numbers from 2, ascending; from 1 where conditions are given
    #: one per exponent: position, order of derivative and value; none for the default
    conditions: tuple[tuple[float, int, float], ...] = ()

    def __post_init__(self) -> None:
        p, minimum = self.exponents, 1 if self.conditions else 2
        if why := _exponent_fault(p, minimum):
            allowed = f"two or more ascending whole numbers from {minimum} to {_LARGEST}"
            raise refuse("exponents", list(p), allowed, why)
        if not self.conditions:
            return
        given, needed = f"{len(self.conditions)} conditions", len(self.exponents)
        if len(self.conditions) != needed:
            raise refuse("conditions", given, f"{needed}, one per exponent")
        for z, order, value in self.conditions:
            if not (0.0 <= z <= 1.0 and 0 <= order <= self.exponents[-1] and math.isfinite(value)):
                allowed = "[z from 0 to 1, order of the derivative, finite value]"
                raise refuse("conditions", [z, order, value], allowed)
        if sum(self._exact) != 1:
            raise refuse("conditions", given, "conditions with s(1) = 1", "a law ends at lift 1", "add [1, 0, 1]")

    @cached_property
    def _exact(self) -> tuple[Fraction, ...]:
        p = self.exponents
        if self.conditions:
            rows = [
                [math.perm(q, order) * Fraction(z) ** max(q - order, 0) for q in p] for z, order, _ in self.conditions
            ]
            return _solve_exact(rows, [Fraction(value) for _, _, value in self.conditions])
        return tuple(math.prod((Fraction(q, q - r) for q in p if q != r), start=Fraction(1)) for r in p)

    @property
    def coefficients(self) -> tuple[float, ...]:
        """Coefficients of the powers of z, in the order of the exponents."""
        return tuple(float(a) for a in self._exact)

    def __call__(self, z: FloatArray, order: int = 0) -> FloatArray:
        """Return the derivative of the given order at z."""
        powers, powers_of_rest = self._derivatives[order]
        near_end, from_start = np.asarray(1.0 - z < _NEAR_END), np.asarray(polyval(z, powers), dtype=float)
        if not near_end.any():
            return from_start
        return np.where(near_end, (-1.0) ** order * polyval(1.0 - z, powers_of_rest), from_start)

    @cached_property
    def _derivatives(self) -> list[tuple[FloatArray, ...]]:
        """Coefficients of every derivative, in powers of z and of 1 - z; vanishing ones are exactly zero."""
        highest, terms = self.exponents[-1], list(zip(self._exact, self.exponents, strict=True))
        from_start = np.zeros(highest + 1)
        from_start[list(self.exponents)] = self.coefficients
        from_end = [float((-1) ** m * sum(a * math.comb(p, m) for a, p in terms)) for m in range(highest + 1)]
        return [tuple(np.asarray(polyder(c, n), dtype=float) for c in (from_start, from_end)) for n in range(5)]


def _exponent_fault(p: tuple[int, ...], minimum: int) -> str:
    """Return why exponents do not define a law; empty if they do."""
    if len(p) < 2:
        return "one power alone does not come to rest"
    if min(p) < minimum:
        return "s must begin at 0" if minimum == 1 else "s and s' must vanish at z = 0"
    if max(p) > _LARGEST:
        return f"beyond {_LARGEST} too many digits are lost between the ends"
    if twice := [b for a, b in pairwise(sorted(p)) if a == b]:
        return f"{twice[0]} is listed twice"
    return "" if list(p) == sorted(p) else "they do not ascend"


def _solve_exact(rows: list[list[Fraction]], right: list[Fraction]) -> tuple[Fraction, ...]:
    """Return the exact solution of a small linear system (elimination with the first pivot that is not zero)."""
    work: Any = np.column_stack([np.array(rows, dtype=object), np.array(right, dtype=object)])
    for i in range(len(work)):
        pivots = i + np.flatnonzero(work[i:, i])
        if not len(pivots):
            given = f"{len(work)} conditions of which one follows from the others or contradicts them"
            raise refuse("conditions", given, "independent conditions", remedy="change a position or an order")
        work[[i, pivots[0]]] = work[[pivots[0], i]]
        work[i] /= work[i, i]
        others = np.arange(len(work)) != i
        work[others] -= np.outer(work[others, i], work[i])
    return tuple(work[:, -1])


def quinquinomial(row: int = 1) -> Polynomial:
    """Return a law with the published exponents 2, 2 + n, 2 + 2n, 2 + 3n, 2 + 4n and n = 3 row.

    s' = c z (1 - z^n)^4: all derivatives vanish at z = 1, full acceleration at z = 0, for a cam with one dwell. Source:
    R. Roussev, B. Paleva-Kadiyska and V. Galabov, Quinquinomial power functions (2021), tables 1 and 2.

    Examples
    --------
    >>> quinquinomial(2).exponents
    (2, 8, 14, 20, 26)
    """
    if not 1 <= row <= 4:
        remedy = "for others use a polynomial with its exponents"
        raise refuse("row", row, "1 to 4", "the paper prints these rows", remedy)
    return Polynomial(tuple(2 + 3 * row * i for i in range(5)))


@dataclass(frozen=True)
class BSplineLaw(SmoothLaw):
    """s = sum c_i B_i(z) on clamped knots.

    The first and last coefficients are s(0) = 0 and s(1) = 1; as many derivatives vanish at an end as further
    coefficients there are equal to them, exactly. Without inner knots the coefficients are those of Bernstein's
    polynomials. Source: C. de Boor, A Practical Guide to Splines (1978), ch. IX-X.

    Examples
    --------
    >>> law = BSplineLaw((0.0, 0.0, 0.0, 1.0, 1.0, 1.0), degree=5)
    >>> law(np.array([0.25])).round(9)
    array([0.10351562])
    """

    coefficients: tuple[float, ...]  #: one more than degree and inner knots together; the first 0, the last 1
    degree: int = 5  #: 5 or more
    knots: tuple[float, ...] | None = None  #: inner knots, ascending between 0 and 1; None for even spacing

    def __post_init__(self) -> None:
        if self.degree < _MIN_DEGREE:
            why = "the fourth derivative would jump"
            raise refuse("degree", self.degree, f"a whole number, at least {_MIN_DEGREE}", why)
        count, minimum = len(self.coefficients), self.degree + 1 + len(self.knots or ())
        if count < minimum or (self.knots is not None and count > minimum):
            allowed, why = f"{minimum}{' or more' * (self.knots is None)}", "degree and knots define their number"
            raise refuse("coefficients", f"{count} values", allowed, why)
        _check_ends("coefficients", self.coefficients)
        if not all(a < b for a, b in pairwise((0.0, *(self.knots or ()), 1.0))):
            raise refuse("knots", list(self.knots or ()), "numbers that ascend between 0 and 1")

    @property
    def inner_knots(self) -> FloatArray:
        """Inner knots, ascending."""
        if self.knots is not None:
            return np.array(self.knots)
        return np.linspace(0.0, 1.0, len(self.coefficients) - self.degree + 1)[1:-1]

    @cached_property
    def _derivatives(self) -> tuple[BSpline[np.float64], ...]:
        return spline_derivatives(self.inner_knots, np.array(self.coefficients), self.degree)

    def __call__(self, z: FloatArray, order: int = 0) -> FloatArray:
        """Return the derivative of the given order at z."""
        return np.asarray(self._derivatives[order](z), dtype=float)


def spline_derivatives(inner_knots: FloatArray, coefficients: FloatArray, degree: int) -> tuple[Any, ...]:
    """Return a spline on clamped knots and its derivatives up to the fourth."""
    from scipy.interpolate import BSpline

    ends = np.ones(degree + 1)
    spline = BSpline(np.concatenate([0.0 * ends, inner_knots, ends]), coefficients, degree)
    return tuple(spline.derivative(order) if order else spline for order in range(_MIN_DEGREE))


def _check_ends(name: str, values: tuple[float, ...]) -> None:
    if (values[0], values[-1]) != (0.0, 1.0) or not np.isfinite(values).all():
        raise refuse(name, list(values), "finite numbers, the first 0 and the last 1", "s(0) = 0, s(1) = 1")


def through_points(z: tuple[float, ...], s: tuple[float, ...]) -> BSplineLaw:
    """Return the law through given points, at rest with zero acceleration at both ends.

    A spline of degree 5 that interpolates; for measured lift, which is noisy, use a lift table.

    Examples
    --------
    >>> through_points((0.0, 0.5, 1.0), (0.0, 0.5, 1.0))(np.array([0.5])).round(12)
    array([0.5])
    """
    if len(z) != len(s) or len(z) < 3:
        raise refuse("z, s", f"{len(z)} and {len(s)} values", "as many of both, three or more")
    if not all(a < b for a, b in pairwise(z)) or (z[0], z[-1]) != (0.0, 1.0):
        raise refuse("z", list(z), "positions that ascend from 0 to 1")
    _check_ends("s", s)
    from scipy.interpolate import make_interp_spline

    interpolate: Any = make_interp_spline  # the type stubs accept the end conditions by name only
    at_rest = [(1, 0.0), (2, 0.0)]
    spline = interpolate(np.array(z), np.array(s), k=5, bc_type=(at_rest, at_rest))
    inner, middle = tuple(spline.t[6:-6].tolist()), tuple(spline.c[3:-3].tolist())
    return BSplineLaw((0.0, 0.0, 0.0, *middle, 1.0, 1.0, 1.0), 5, inner)
