"""Channels: named scalar histories of a run beside its motions, such as a contact's force."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from flexcam.linalg import FloatArray, IntArray
from flexcam.system.drive import CamMotion
from flexcam.system.local import AngleFunction


@dataclass(frozen=True, eq=False)
class Observed:
    """What is known of some instants, from which channels are computed.

    Parameters
    ----------
    motion
        The cam, shape (m,) each.
    displacement, velocity, acceleration
        All unknowns, shape (m, n).
    histories
        Scalar histories of the loads, shape (m, loads).
    forces, gaps, rates
        Of the local forces: force, sensed scalar and its rate, shape (m, c).
    states
        Internal states of the local laws, shape (m, s).
    """

    motion: CamMotion
    displacement: FloatArray
    velocity: FloatArray
    acceleration: FloatArray
    histories: FloatArray
    forces: FloatArray
    gaps: FloatArray
    rates: FloatArray
    states: FloatArray

    def at(self, rows: IntArray) -> Observed:
        """Return some of the instants."""
        motion = CamMotion(self.motion.angle[rows], self.motion.speed[rows], self.motion.rate[rows])
        names = [name for name in self.__dataclass_fields__ if name != "motion"]
        return Observed(motion, *(getattr(self, name)[rows] for name in names))

    def part(self, loads: slice, scalars: slice, states: slice) -> Observed:
        """Return what concerns some of the loads, sensed scalars and internal states."""
        return replace(
            self, histories=self.histories[:, loads], forces=self.forces[:, scalars], gaps=self.gaps[:, scalars],
            rates=self.rates[:, scalars], states=self.states[:, states],
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
    """Return the sum of some load histories, times a function of the cam angle.

    Parameters
    ----------
    loads
        Their positions.
    factor
        None for 1.

    Returns
    -------
    Callable
        Of what is observed.
    """
    return lambda seen: _times(seen, seen.histories[:, list(loads)].sum(axis=1), factor)


def force_sum(*scalars: int, factor: AngleFunction | None = None) -> Observable:
    """Return the sum of some local forces, times a function of the cam angle.

    Parameters
    ----------
    scalars
        Their positions.
    factor
        None for 1.

    Returns
    -------
    Callable
        Of what is observed.
    """
    return lambda seen: _times(seen, seen.forces[:, list(scalars)].sum(axis=1), factor)


def total(*parts: Observable) -> Observable:
    """Return the sum of observables.

    Parameters
    ----------
    parts
        The observables.

    Returns
    -------
    Callable
        Of what is observed.
    """
    return lambda seen: np.sum([part(seen) for part in parts], axis=0)


def row_of(row: FloatArray) -> Observable:
    """Return the displacement that a row picks.

    Parameters
    ----------
    row
        Shape (n,).

    Returns
    -------
    Callable
        Of what is observed.
    """
    return lambda seen: seen.displacement @ row


def _times(seen: Observed, values: FloatArray, factor: AngleFunction | None) -> FloatArray:
    return values if factor is None else values * factor(seen.motion.angle, 0)
