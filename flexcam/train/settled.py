"""Where the bodies of a rigid train rest before its cam lifts: against the one before, their seat or their springs."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import product
from typing import NamedTuple

import numpy as np

from flexcam.linalg import FloatArray

_BALANCED = 1e-9
"""Part of the largest force that counts as none."""

_NOTHING = 1e-12
"""Depth that counts as none, m."""


@dataclass(frozen=True)
class Body:
    """What no play of a train divides; motions and forces as they are felt at the follower.

    Parameters
    ----------
    before
        Number of the body that pushes it; its own number for the first, which its cam holds.
    gap
        Play between them, m.
    push
        With which an adjuster pushes both apart, N.
    extends
        Whether an adjuster stands between them, which takes up all play.
    seated
        Whether a seat stops it on its way back.
    """

    before: int = 0
    gap: float = 0.0
    push: float = 0.0
    extends: bool = False
    seated: bool = False

    def closed(self, place: float, before: float) -> bool:
        """Tell whether its play is closed where it and the body before it are, m."""
        return self.extends or place - before <= _NOTHING - self.gap


@dataclass(frozen=True, eq=False)
class Settled:
    """How bodies rest while their cam does not lift.

    Parameters
    ----------
    places
        m along the lift, shape (g,).
    seats
        Forces of their seats, N, shape (g,); none of the first, whose share the stiffness of seat and cam would tell.
    """

    places: FloatArray
    seats: FloatArray


def settled(bodies: Sequence[Body], stiffness: FloatArray, force: FloatArray) -> Settled:
    """Return how bodies rest while their cam does not lift.

    Forces push a body back until the play before it is closed, its seat stops it, or its springs hold it. Of all these
    ways the one is taken in which forces balance and nothing that only pushes would have to pull: the conditions of
    A. Signorini, as in P. Wriggers, Computational Contact Mechanics, 2nd ed. (2006), ch. 2.
    """
    own = force.copy()
    for i, body in enumerate(bodies[1:], 1):
        own[body.before] += body.push
        own[i] -= body.push
    stops = _stops(bodies)
    for held in product(*((stop.likely, not stop.likely) for stop in stops)) if stops else ():
        holding = [stop for stop, holds in zip(stops, held, strict=True) if holds]
        places, forces = _balance(stiffness[1:, 1:], own[1:], holding)
        if places is not None and all(float(one.row @ places) >= one.bound - _NOTHING for one in stops):
            seats = sum((size * one.row * one.seat for one, size in zip(holding, forces, strict=True)), 0.0 * own[1:])
            return Settled(*(np.concatenate([[0.0], one]) for one in (places, seats)))
    return Settled(np.zeros(len(bodies)), np.zeros(len(bodies)))


class _Stop(NamedTuple):
    """What stops bodies, ``row x >= bound``, and whether it likely does: a seat where there is one, else a play."""

    row: FloatArray
    bound: float
    likely: bool
    seat: bool


def _stops(bodies: Sequence[Body]) -> list[_Stop]:
    unit = np.eye(len(bodies))[:, 1:]
    numbered = list(enumerate(bodies))[1:]
    plays = [_Stop(unit[i] - unit[one.before], -one.gap, not one.seated, False) for i, one in numbered]
    return plays + [_Stop(unit[i], 0.0, True, True) for i, one in numbered if one.seated]


def _balance(K: FloatArray, force: FloatArray, stops: Sequence[_Stop]) -> tuple[FloatArray | None, FloatArray]:
    """Return where bodies rest that some stops hold, and the forces of these; None if they would have to pull.

    ``K x + f = A^T r`` with ``A x = b`` and ``r >= 0``.
    """
    n, scale = len(force), float(np.abs(K).max(initial=0.0)) or 1.0
    A = np.array([stop.row for stop in stops]).reshape(-1, n)
    matrix = np.block([[K / scale, -A.T], [A, np.zeros((len(A), len(A)))]])
    given = np.concatenate([-force / scale, [stop.bound for stop in stops]])
    found: FloatArray = np.linalg.lstsq(matrix, given)[0].astype(np.float64, copy=False)
    slight = _BALANCED * float(np.abs(force).max(initial=0.0)) / scale + _NOTHING
    if (np.abs(matrix @ found - given) > slight).any() or (found[n:] < -slight).any():
        return None, found[n:]
    return found[:n], scale * found[n:]
