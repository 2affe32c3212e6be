"""Laws given by a B-spline, which hold any polynomial too: without inner knots they are one."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np

from flexcam.checks import refuse
from flexcam.linalg import FloatArray

if TYPE_CHECKING:
    from scipy.interpolate import BSpline

_LEAST_DEGREE = 5
"""Below it the fourth derivative is not continuous."""


@dataclass(frozen=True)
class BSplineLaw:
    """s = sum c_i B_i(z) on clamped knots.

    The first and last coefficients are s(0) = 0 and s(1) = 1; as many derivatives vanish at an end as further
    coefficients there are equal to them, exactly. Without inner knots the coefficients are those of Bernstein's
    polynomials. Source: C. de Boor, A Practical Guide to Splines (1978), ch. IX-X.

    Parameters
    ----------
    coefficients
        One more than degree and inner knots together; the first 0, the last 1.
    degree
        5 or more.
    knots
        Inner knots, ascending between 0 and 1; None for even spacing.

    Raises
    ------
    InputError
        If numbers do not fit together.

    Examples
    --------
    >>> law = BSplineLaw((0.0, 0.0, 0.0, 1.0, 1.0, 1.0), degree=5)
    >>> law(np.array([0.25])).round(9)
    array([0.10351562])
    """

    coefficients: tuple[float, ...]
    degree: int = 5
    knots: tuple[float, ...] | None = None

    def __post_init__(self) -> None:
        if self.degree < _LEAST_DEGREE:
            why = "the fourth derivative would jump"
            raise refuse("degree", self.degree, f"a whole number from {_LEAST_DEGREE}", why)
        least = self.degree + 1 + len(self.knots or ())
        fits = len(self.coefficients) == least if self.knots is not None else len(self.coefficients) >= least
        if not fits:
            allowed = f"{least}" if self.knots is not None else f"{least} or more"
            raise refuse("coefficients", f"{len(self.coefficients)} values", allowed, "degree, knots and they must fit")
        if self.coefficients[0] != 0.0 or self.coefficients[-1] != 1.0 or not np.isfinite(self.coefficients).all():
            raise refuse(
                "coefficients", list(self.coefficients), "finite numbers from 0 to 1 at the ends", "s(0) = 0, s(1) = 1"
            )
        if not all(a < b for a, b in pairwise((0.0, *(self.knots or ()), 1.0))):
            raise refuse("knots", list(self.knots or ()), "numbers that ascend between 0 and 1")

    @property
    def breaks(self) -> tuple[float, ...]:
        """Positions of inner jumps: none up to the fourth derivative."""
        return ()

    @property
    def inner_knots(self) -> FloatArray:
        """Inner knots, ascending."""
        if self.knots is not None:
            return np.array(self.knots)
        return np.linspace(0.0, 1.0, len(self.coefficients) - self.degree + 1)[1:-1]

    @cached_property
    def _derivatives(self) -> tuple[BSpline[np.float64], ...]:
        from scipy.interpolate import BSpline

        ends = np.ones(self.degree + 1)
        spline = BSpline(np.concatenate([0.0 * ends, self.inner_knots, ends]), np.array(self.coefficients), self.degree)
        return tuple(spline.derivative(order) if order else spline for order in range(_LEAST_DEGREE))

    def __call__(self, z: FloatArray, order: int = 0) -> FloatArray:
        """Return the derivative of the given order at z."""
        return np.asarray(self._derivatives[order](z), dtype=float)


def through_points(z: tuple[float, ...], s: tuple[float, ...]) -> BSplineLaw:
    """Return the law through given points, at rest with zero acceleration at both ends.

    A spline of degree 5 that interpolates; for measured lift, which is noisy, use a lift table.

    Parameters
    ----------
    z
        Positions, ascending from 0 to 1.
    s
        Lift there, from 0 to 1.

    Returns
    -------
    BSplineLaw
        The law.

    Raises
    ------
    InputError
        If the points do not run from (0, 0) to (1, 1), or are fewer than three.

    Examples
    --------
    >>> through_points((0.0, 0.5, 1.0), (0.0, 0.5, 1.0))(np.array([0.5])).round(12)
    array([0.5])
    """
    if len(z) != len(s) or len(z) < 3:
        raise refuse("z, s", f"{len(z)} and {len(s)} values", "as many of both, three or more")
    if not all(a < b for a, b in pairwise(z)) or (z[0], z[-1]) != (0.0, 1.0):
        raise refuse("z", list(z), "positions that ascend from 0 to 1")
    if (s[0], s[-1]) != (0.0, 1.0) or not np.isfinite(s).all():
        raise refuse("s", list(s), "finite numbers from 0 to 1 at the ends", "s(0) = 0, s(1) = 1")
    from scipy.interpolate import make_interp_spline

    still = [(1, 0.0), (2, 0.0)]
    # The stubs know the end conditions by name only.
    spline: BSpline[np.float64] = make_interp_spline(  # pyright: ignore[reportCallIssue, reportUnknownVariableType]
        np.array(z),
        np.array(s),
        k=5,
        bc_type=(still, still),  # pyright: ignore[reportArgumentType]
    )
    t: FloatArray = np.asarray(spline.t, dtype=float)  # pyright: ignore[reportUnknownMemberType, reportUnknownArgumentType]
    c: FloatArray = np.asarray(spline.c, dtype=float)  # pyright: ignore[reportUnknownMemberType, reportUnknownArgumentType]
    inner, middle = tuple(t[6:-6].tolist()), tuple(c[3:-3].tolist())
    return BSplineLaw((0.0, 0.0, 0.0, *middle, 1.0, 1.0, 1.0), 5, inner)
