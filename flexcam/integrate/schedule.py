"""What follows from the cam motion alone for the local forces, of a block of steps."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from flexcam.linalg import FloatArray, IntArray
from flexcam.system import Evaluated


class Weights:
    """Functions of the cam angle side by side, most of which are constant.

    Parameters
    ----------
    still
        Those that are constant, zero for the others, shape (k,).
    moving
        The places of the others, and what they are at m instants.
    count
        m.
    """

    def __init__(self, still: FloatArray, moving: Sequence[tuple[int, FloatArray]], count: int) -> None:
        self.still, self.moving, self.count = still, moving, count

    @classmethod
    def known(cls, whole: FloatArray) -> Weights:
        """Return those of which all are known at every instant, shape (m, k)."""
        if len(whole) == 1:
            return cls(whole.ravel(), (), 1)
        return cls(np.zeros(len(whole.T)), list(enumerate(whole.T)), len(whole))

    @cached_property
    def whole(self) -> FloatArray:
        """All of them, shape (m, k)."""
        found = np.empty((self.count, len(self.still)))
        self.put(found)
        return found

    def put(self, into: FloatArray) -> None:
        """Put all of them into an array, shape (m, k)."""
        into[:] = self.still
        for i, values in self.moving:
            into[:, i] = values

    def add(self, to: FloatArray) -> None:
        """Add all of them to an array, shape (m, k)."""
        to += self.still
        for i, values in self.moving:
            to[:, i] += values

    def columns(self, places: IntArray) -> FloatArray:
        """Return some of them, shape (m, len(places))."""
        moving = dict(self.moving)
        found = np.empty((self.count, len(places)), order="F")
        for j, i in enumerate(places.tolist()):
            found[:, j] = moving.get(i, self.still[i])
        return found

    def at(self, rows: IntArray | slice) -> Weights:
        """Return them at some instants."""
        moving = [(i, values[rows]) for i, values in self.moving]
        return Weights(self.still, moving, len(np.arange(self.count)[rows]))


@dataclass(frozen=True, eq=False)
class Schedule:
    """Everything about the local forces that follows from the cam motion alone, for a block of steps.

    Parameters
    ----------
    sensed, sensed_rates
        Weights of the sensing vectors and their time derivatives, k of them.
    acted
        Weights of the acting vectors, m of them.
    offsets, offset_rates
        Prescribed part of the sensed scalars and its time derivative, c of them.
    angle
        rad, shape (times,).
    senses, acts
        To which scalar each sensing vector, to which force each acting one belongs: 1 there, shape (c, k) and (c, m).
    cam
        Functions of the cam angle at these instants.
    """

    sensed: Weights
    sensed_rates: Weights
    acted: Weights
    offsets: Weights
    offset_rates: Weights
    angle: FloatArray
    senses: FloatArray
    acts: FloatArray
    cam: Evaluated

    @property
    def parts(self) -> tuple[Weights, ...]:
        """All that is weighed, in order."""
        return self.sensed, self.sensed_rates, self.acted, self.offsets, self.offset_rates

    @property
    def offset(self) -> FloatArray:
        """Prescribed part of the sensed scalars, shape (times, c)."""
        return self.offsets.whole

    @property
    def offset_rate(self) -> FloatArray:
        """Its time derivative, shape (times, c)."""
        return self.offset_rates.whole

    def row(self, i: int) -> Schedule:
        """Return one instant of it."""
        one = slice(i, i + 1)
        sensed, sensed_rates, acted, offsets, offset_rates = (part.at(one) for part in self.parts)
        return Schedule(
            sensed, sensed_rates, acted, offsets, offset_rates,
            self.angle[one], self.senses, self.acts, Evaluated(self.angle[one]),
        )  # fmt: skip

    def sensing(self, i: int) -> FloatArray:
        """Return the weights by which every scalar is made of the sensing vectors at an instant, shape (c, k)."""
        return self.senses * self.sensed.whole[i]

    def turning(self, i: int) -> FloatArray:
        """Return their time derivatives, shape (c, k)."""
        return self.senses * self.sensed_rates.whole[i]

    def acting(self, i: int) -> FloatArray:
        """Return the weights by which every force acts along the acting vectors at an instant, shape (c, m)."""
        return self.acts * self.acted.whole[i]
