"""Channels: named scalar histories of a run beside its motions, such as a contact's force."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from flexcam.linalg import FloatArray
from flexcam.system.angle_functions import AngleFunction
from flexcam.system.drive import CamMotion
from flexcam.system.evaluated import Evaluated


class Moved(Protocol):
    """Motion of some unknowns at some instants."""

    def whole(self, order: int) -> FloatArray:
        """Return displacement (order 0), velocity (1) or acceleration (2) of all unknowns, shape (m, n)."""
        ...

    def picked(self, rows: FloatArray, order: int = 0) -> FloatArray:
        """Return what rows pick of that, shape (k, n) to (m, k); rows are known again by the array that they are."""
        ...


@dataclass(frozen=True, eq=False)
class Motions:
    """Motion of all unknowns.

    Parameters
    ----------
    displacement, velocity, acceleration
        Shape (m, n).
    """

    displacement: FloatArray
    velocity: FloatArray
    acceleration: FloatArray

    def whole(self, order: int) -> FloatArray:
        """Return the motion, as `Moved` says."""
        return (self.displacement, self.velocity, self.acceleration)[order]

    def picked(self, rows: FloatArray, order: int = 0) -> FloatArray:
        """Return what rows pick, as `Moved` says."""
        return (rows @ self.whole(order).T).T  # what a row picks lies together


@dataclass(frozen=True, eq=False)
class Observed:
    """What is known of some instants, from which channels are computed.

    Parameters
    ----------
    motion
        The cam, shape (m,) each.
    cam
        Functions of the cam angle at these instants.
    moved
        Motion of all unknowns.
    histories
        Scalar histories of the loads, shape (m, loads).
    forces, gaps, rates
        Of the local forces: force, sensed scalar and its rate, shape (m, c).
    states
        Internal states of the local laws, shape (m, s).
    """

    motion: CamMotion
    cam: Evaluated
    moved: Moved
    histories: FloatArray
    forces: FloatArray
    gaps: FloatArray
    rates: FloatArray
    states: FloatArray

    @property
    def displacement(self) -> FloatArray:
        """Of all unknowns, shape (m, n)."""
        return self.moved.whole(0)

    @property
    def velocity(self) -> FloatArray:
        """Of all unknowns, shape (m, n)."""
        return self.moved.whole(1)

    @property
    def acceleration(self) -> FloatArray:
        """Of all unknowns, shape (m, n)."""
        return self.moved.whole(2)

    def part(self, loads: slice, scalars: slice, states: slice) -> Observed:
        """Return what concerns some of the loads, sensed scalars and internal states."""
        return Observed(
            self.motion, self.cam, self.moved, self.histories[:, loads], self.forces[:, scalars],
            self.gaps[:, scalars], self.rates[:, scalars], self.states[:, states],
        )  # fmt: skip


Observable = Callable[[Observed], FloatArray]
"""A scalar of what is observed, shape (m,)."""


@dataclass(frozen=True, eq=False)
class Channel:
    """A named scalar history.

    Parameters
    ----------
    name
        Such as ``"contacts.intake.force"``.
    unit
        SI unit.
    value
        What it is; positions count within what the channel is shown (a whole system, or one coupling of it).
    """

    name: str
    unit: str
    value: Observable


def load_sum(*loads: int, factor: AngleFunction | None = None) -> Observable:
    """Return the sum of some load histories, times a function of the cam angle."""
    return lambda seen: _times(seen, _sum(seen.histories, loads), factor)


def force_sum(*scalars: int, factor: AngleFunction | None = None) -> Observable:
    """Return the sum of some local forces, times a function of the cam angle."""
    return lambda seen: _times(seen, _sum(seen.forces, scalars), factor)


def total(*parts: Observable) -> Observable:
    """Return the sum of observables."""
    return lambda seen: np.sum([part(seen) for part in parts], axis=0)


def row_of(row: FloatArray) -> Observable:
    """Return the displacement that a row picks."""
    rows = row[None]
    return lambda seen: seen.moved.picked(rows)[:, 0]


def _sum(values: FloatArray, columns: tuple[int, ...]) -> FloatArray:
    return values[:, columns[0]] if len(columns) == 1 else values[:, list(columns)].sum(axis=1)


def _times(seen: Observed, values: FloatArray, factor: AngleFunction | None) -> FloatArray:
    return values if factor is None else values * seen.cam(factor, 0)
