"""Fit of a finite-harmonic lift by constrained least squares."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from flexcam.cams.lift_event import Event
from flexcam.cams.periodic_lift import HarmonicLift
from flexcam.core import FloatArray
from flexcam.core.errors import InputError, positive, refuse

_FEASIBLE = 1e-10
"""Residual of the dual problem below which the inequalities are contradictory."""


def constrained_least_squares(E: FloatArray, f: FloatArray, G: FloatArray, h: FloatArray) -> FloatArray | None:
    """Return the x that minimizes the norm of E x - f subject to G x >= h.

    The problem is reduced to a least-distance problem, and that to non-negative least squares: C. L. Lawson and R. J.
    Hanson, Solving Least Squares Problems (1974), ch. 23.
    """
    from scipy.optimize import nnls

    Q, R = np.linalg.qr(E)
    best = np.asarray(np.linalg.solve(R, Q.T @ f), dtype=float)
    if not len(G) or bool((G @ best >= h).all()):
        return best
    # y = R (x - best): minimum norm of y with (G R^-1) y >= h - G best.
    C = np.linalg.solve(R.T, G.T).T
    d = h - G @ best
    size = max(float(np.abs(d).max()), np.finfo(float).tiny)
    d = d / size
    A = np.vstack([C.T, d])
    right = np.append(np.zeros(len(R)), 1.0)
    u = nnls(A, right, maxiter=30 * A.shape[1])[0]
    r = np.asarray(A @ u - right, dtype=float)
    if float(np.linalg.norm(r)) < _FEASIBLE:
        return None
    return best + np.asarray(np.linalg.solve(R, -r[:-1] / r[-1] * size), dtype=float)


_REVOLUTION = 2.0 * math.pi
_MOST = 200
_POINTS_PER_HARMONIC, _LEAST_POINTS = 24, 720


@dataclass(frozen=True, eq=False)
class HarmonicFit:
    """Finite-harmonic lift and its deviation from the target lift.

    Parameters
    ----------
    event
        The lift.
    strict_deviation, deviation
        Maximum deviation from the target lift on the strict sections and overall, m.
    rms_deviation
        Over the working sections, m.
    """

    event: HarmonicLift
    strict_deviation: float
    deviation: float
    rms_deviation: float


def harmonic_fit(
    wanted: Event, count: int, *, strict: Sequence[tuple[float, float]] | None = None, tolerance: float,
    bound: float | None = None,
) -> HarmonicFit:  # fmt: skip
    """Return the lift with a given number of harmonics that has the least squared distance from a target lift.

    C. Li, Cam motion simulation and optimization (2014), eqs. 5-6, with its dwells as constraints instead of weights.
    """
    positive("tolerance", tolerance, "m")
    if not 1 <= count <= _MOST:
        raise refuse(
            "count",
            count,
            f"a whole number from 1 to {_MOST}",
            "",
            "a lower speed leaves room for more",
        )
    points = max(_LEAST_POINTS, _POINTS_PER_HARMONIC * count)
    ends = [end for section in strict or () for end in section] if strict is not None else list(wanted.joints)
    even = np.linspace(0.0, _REVOLUTION, points, endpoint=False)
    angle = np.unique(np.concatenate([even, np.mod(np.array(ends, dtype=float), _REVOLUTION)]))
    target = wanted(angle)
    held = _dwell_mask(wanted, angle) if strict is None else _within_sections(angle, strict)
    rows = _rows(angle, count)
    limit = np.where(held, tolerance, math.inf if bound is None else positive("bound", bound, "m"))
    bounded = np.isfinite(limit)
    G = np.vstack([rows[bounded], -rows[bounded]])
    h = np.concatenate([(target - limit)[bounded], (-target - limit)[bounded]])
    # Only the equally spaced angles measure the deviation; section ends between them are constraints.
    x = constrained_least_squares(_rows(even, count), wanted(even), G, h)
    if x is None:
        raise _order_error(rows, target, held, tolerance, bound)
    event = HarmonicLift(float(x[0]), tuple(x[1 : count + 1].tolist()), tuple(x[count + 1 :].tolist()))
    miss = np.abs(rows @ x - target)
    moving = miss[~held]
    return HarmonicFit(
        event, float(miss[held].max(initial=0.0)), float(miss.max()),
        float(np.sqrt(np.mean(moving**2))) if moving.size else 0.0,
    )  # fmt: skip


def harmonics_below(frequency: float, speed: float) -> int:
    """Return the number of harmonics of a cam below a natural frequency: n < w0/w."""
    return max(0, math.ceil(positive("frequency", frequency, "rad/s") / positive("speed", speed, "rad/s")) - 1)


def _rows(angle: FloatArray, count: int) -> FloatArray:
    turned = np.outer(angle, np.arange(1, count + 1))
    return np.hstack([np.ones((len(angle), 1)), np.cos(turned), np.sin(turned)])


def _dwell_mask(wanted: Event, angle: FloatArray) -> NDArray[np.bool_]:
    still = np.abs(wanted(angle, 1)) + np.abs(wanted(angle, 2))
    return still < 1e-9 * wanted.height


def _within_sections(angle: FloatArray, sections: Sequence[tuple[float, float]]) -> NDArray[np.bool_]:
    inside: NDArray[np.bool_] = np.zeros(len(angle), dtype=np.bool_)
    for start, end in sections:
        inside |= np.mod(angle - start, _REVOLUTION) <= (end - start)
    return inside


def _order_error(
    rows: FloatArray, target: FloatArray, held: NDArray[np.bool_], tolerance: float, bound: float | None
) -> InputError:
    """Return the error of a tolerance or bound that so few harmonics cannot meet, with the attainable value."""
    count, why = (rows.shape[1] - 1) // 2, "the constraints leave no such lift"
    reach = _minimize_deviation(rows[held], target[held], np.zeros((0, rows.shape[1])), np.zeros(0), tolerance)
    if reach is not None and reach > tolerance:
        given = f"{count} harmonics within {1e6 * tolerance:.4g} um on the strict sections"
        remedy = f"allow {1e6 * reach:.4g} um there, or more harmonics"
        return refuse("tolerance", given, "what they can hold", why, remedy)
    wide = _minimize_deviation(rows[~held], target[~held], rows[held], target[held], tolerance)
    given = f"{count} harmonics within {1e6 * (bound or 0.0):.4g} um beside the strict sections"
    room = "a wider one" if wide is None else f"{1e6 * wide:.4g} um there"
    return refuse("bound", given, "what they can hold", why, f"allow {room}, a wider tolerance, or more harmonics")


def _minimize_deviation(
    rows: FloatArray, target: FloatArray, kept: FloatArray, goal: FloatArray, tolerance: float
) -> float | None:
    """Return the solution with the smallest maximum deviation, others within a tolerance: a linear program."""
    from scipy.optimize import linprog

    one, none = np.ones((len(rows), 1)), np.zeros((len(kept), 1))
    A = np.vstack(
        [np.hstack([rows, -one]), np.hstack([-rows, -one]), np.hstack([kept, none]), np.hstack([-kept, none])]
    )
    b = np.concatenate([target, -target, goal + tolerance, tolerance - goal])
    if not len(A):
        return None
    cost = np.append(np.zeros(rows.shape[1]), 1.0)
    found = linprog(cost, A, b, bounds=[*[(None, None)] * rows.shape[1], (0.0, None)], method="highs")
    return None if found.x is None else float(np.asarray(found.x, dtype=float)[-1])
