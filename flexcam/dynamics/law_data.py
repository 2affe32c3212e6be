"""Force laws as data: a law with its constants and functions, and constructors of common laws."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import accumulate, pairwise

import numpy as np

from flexcam.core import FloatArray
from flexcam.dynamics.cam_motion import AngleFunction
from flexcam.dynamics.force_laws import (
    ARCH,
    BILATERAL,
    HUNT_CROSSLEY,
    LAWS,
    OIL_COLUMN,
    STOP,
    TABLE,
    TURN,
    force_table,
)

_PIECES = 720
"""Polynomials of the lift of a cam without joints."""
_LEFT = 1e-8
"""Angle before a joint at which the left limit is evaluated, rad."""


@dataclass(frozen=True, eq=False)
class CamLift:
    """Lift of a cam as polynomials of fifth degree, so that a law can follow the rotation of its shaft.

    A series about the prescribed angle would jump where a derivative of the lift jumps within the twist.
    """

    pieces: FloatArray  #: first angle, rad, and ascending coefficients of each, shape (p, 7)

    @classmethod
    def of(cls, function: AngleFunction, joints: Sequence[float]) -> CamLift:
        """Return the polynomials through lift, velocity and acceleration at both ends of pieces that end at the joints.

        The function of the cam angle, rad, gives the right limit where one of its derivatives jumps.
        """
        grid = np.linspace(0.0, TURN, _PIECES + 1)
        is_clear = [not any(0.0 < abs(at - joint) < 0.1 * grid[1] for joint in joints) for at in grid.tolist()]
        edges = np.union1d(grid[is_clear], joints)
        edges = edges[np.append(True, np.diff(edges) > _LEFT)]
        h, left = np.diff(edges), edges[1:] - _LEFT

        def exact(values: FloatArray, order: int) -> FloatArray:
            """Return values without rounding: a dwell has no curvature."""
            return np.where(np.abs(values) > 1e-14 * np.abs(function(grid, order)).max(), values, 0.0)

        s, v, a = (exact(function(edges[:-1], order), order) for order in range(3))
        new_a = exact(function(left, 2), 2)
        new_v = exact(function(left, 1) + _LEFT * new_a, 1)
        ds = exact(function(edges[1:], 0) - s - h * (v + 0.5 * h * a), 0)
        dv, da = h * exact(new_v - v - h * a, 1), h * h * exact(new_a - a, 2)
        third, fourth = 10.0 * ds - 4.0 * dv + 0.5 * da, -15.0 * ds + 7.0 * dv - da
        fifth = 6.0 * ds - 3.0 * dv + 0.5 * da
        return cls(np.column_stack([edges[:-1], s, v, 0.5 * a, third / h**3, fourth / h**4, fifth / h**5]))

    def __call__(self, angle: FloatArray, order: int) -> FloatArray:
        """Return a derivative at any angles, rad, see `cam_lift`."""
        t = angle - TURN * np.floor(angle / TURN)
        row = self.pieces[np.maximum(np.searchsorted(self.pieces[:, 0], t, side="right") - 1, 0)]
        x, result = t - row[..., 0], np.zeros_like(t)
        for k in range(5, order - 1, -1):
            result = result * x + math.perm(k, order) * row[..., k + 1]
        return result


@dataclass(frozen=True, eq=False)
class ForceLaw:
    """A force law as data.

    Parameters
    ----------
    kind
        Number of the law, such as `STOP`.
    constants
        As `LAWS` names them.
    functions
        Of the cam angle, as `LAWS` names them.
    friction
        mu and v0 (m/s) of Coulomb friction on an additional scalar after those of the law; None without friction.
    lift
        Of a cam, added to the penetration; the last scalar is its angle, rad. None without.
    """

    kind: int
    constants: tuple[float, ...]
    functions: tuple[AngleFunction, ...] = ()
    friction: tuple[float, float] | None = None
    lift: CamLift | None = None

    @property
    def scalars(self) -> int:
        """Number of sensed scalars."""
        return LAWS[self.kind].scalars + (self.friction is not None) + (self.lift is not None)

    @property
    def states(self) -> int:
        """Number of internal states."""
        return LAWS[self.kind].states

    @property
    def is_conservative(self) -> bool:
        """True if the law is conservative."""
        lossless = all(self.constants[i] == 0.0 for i in LAWS[self.kind].damping)
        return self.friction is None and not self.states and lossless

    @property
    def ramp(self) -> float:
        """Penetration over which the damping grows, m; infinite without such a damping."""
        kind = LAWS[self.kind]
        damped = kind.ramp is not None and any(self.constants[i] for i in kind.damping)
        return self.constants[kind.ramp] if damped and kind.ramp is not None else math.inf

    def idle_scalars(self) -> tuple[tuple[int, ...], ...]:
        """Return sets of scalars that, while zero, neither carry nor cause a force.

        The scalars of bending of a shallow arch without a bow in that plane: a straight strut stays straight.
        """
        if self.kind != ARCH:
            return ()
        bow = self.constants[37:43]
        return tuple((first + 1, first + 2, first + 3) for first in (0, 3) if not any(bow[first : first + 3]))


def elastic_stop(stiffness: float, damping: float = 0.0, depth: float = 1e-5) -> ForceLaw:
    """Return the law `stop`.

    Parameters
    ----------
    depth
        Penetration at which the damping is complete, m.
    """
    return ForceLaw(STOP, (stiffness, damping, depth))


def spring_damper(stiffness: float, damping: float = 0.0) -> ForceLaw:
    """Return the law `bilateral`."""
    return ForceLaw(BILATERAL, (stiffness, damping))


def hunt_crossley_contact(stiffness: float, dissipation: float) -> ForceLaw:
    """Return the law `hunt_crossley`.

    Parameters
    ----------
    dissipation
        chi, s/m.
    """
    return ForceLaw(HUNT_CROSSLEY, (stiffness, dissipation))


def oil_column_law(stiffness: float, leak: float, refill: float, plunger_force: float) -> ForceLaw:
    """Return the law `oil_column`.

    Parameters
    ----------
    leak, refill
        Force per velocity of leak-down and through the open check valve, N s/m.
    plunger_force
        Of the spring that extends the adjuster, N.
    """
    return ForceLaw(OIL_COLUMN, (stiffness, leak, refill, plunger_force))


def force_table_law(travel: Sequence[float], force: Sequence[float]) -> ForceLaw:
    """Return the law `force_table`, whose stored energy is zero at no travel.

    Parameters
    ----------
    travel, force
        Rows of the table, m (ascending) and N.
    """
    rows = list(zip(travel, force, strict=True))
    areas = (0.5 * (f0 + f1) * (x1 - x0) for (x0, f0), (x1, f1) in pairwise(rows))
    energies = list(accumulate(areas, initial=0.0))
    constants = np.array([len(rows), *travel, *force, *energies])
    constants[-len(rows) :] -= force_table(0.0, constants, 0)[3]
    return ForceLaw(TABLE, tuple(constants.tolist()))
