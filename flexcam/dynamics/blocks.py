"""Motions over time, and the motion between saved instants."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from typing import Protocol, TypeVar

import numpy as np
from numpy.typing import NDArray

from flexcam.core import FloatArray, IntArray
from flexcam.core.errors import refuse
from flexcam.dynamics.status import Stats, Status

SLOPES = {"displacement": "velocity", "velocity": "acceleration"}
"""Motions that are cubics between two instants, and what their slopes are."""


@dataclass(frozen=True, eq=False)
class Series:
    """Displacement, velocity and acceleration over some instants, arrays of one shape (times, columns)."""

    displacement: FloatArray
    velocity: FloatArray
    acceleration: FloatArray

    @classmethod
    def joined(cls, parts: Sequence[Series]) -> Series:
        """Return the parts one after the other."""
        return cls(*(np.concatenate([getattr(p, name) for p in parts]) for name in cls.__annotations__))

    def between(self, own: FloatArray, times: FloatArray) -> Series:
        """Return the motion at other times than its own, s, rising, from the instants on both sides of each.

        Displacements are cubics with the velocities at both ends, velocities cubics with the accelerations,
        accelerations straight lines: of higher order than the integrators, and without overshoot where a law jumps.
        """
        right = np.clip(np.searchsorted(own, times, side="right"), 1, len(own) - 1)
        left = right - 1
        length = (own[right] - own[left])[:, None]
        x = (times - own[left])[:, None] / length
        d, v, a = self.displacement, self.velocity, self.acceleration
        moved = _cubic(x, d[left], d[right], length * v[left], length * v[right])
        moving = _cubic(x, v[left], v[right], length * a[left], length * a[right])
        return Series(moved, moving, a[left] + x * (a[right] - a[left]))

    def at(self, instants: NDArray[np.bool_] | IntArray | slice) -> Series:
        """Return the chosen instants: yes or no for each, or their places."""
        return Series(self.displacement[instants], self.velocity[instants], self.acceleration[instants])


def _cubic(x: FloatArray, old: FloatArray, new: FloatArray, slope: FloatArray, new_slope: FloatArray) -> FloatArray:
    """Return Hermite's cubic at x from 0 to 1."""
    y = 1.0 - x
    return y * y * ((1.0 + 2.0 * x) * old + x * slope) + x * x * ((3.0 - 2.0 * x) * new - y * new_slope)


_WORTH = 640
"""Steps below which a block costs more than what is in it."""


_FIELDS = 32
"""Saved fields that are written together, where they are not many steps apart."""


_MOST = 8192
"""Steps in a block at most: what a run has in memory does not depend on how seldom fields are saved."""


@dataclass(frozen=True, eq=False)
class Block:
    """Results of some successive steps.

    Parameters
    ----------
    time, angle
        s and rad, shape (b,).
    probes
        All probe scalars side by side, shape (b, p).
    channels
        All channels side by side, shape (b, c).
    field_time, field_angle
        Instants of the saved fields, shape (f,).
    fields
        All unknowns at those instants, shape (f, n).
    """

    time: FloatArray
    angle: FloatArray
    probes: Series
    channels: FloatArray
    field_time: FloatArray
    field_angle: FloatArray
    fields: Series

    @classmethod
    def joined(cls, parts: Sequence[Block]) -> Block:
        """Return successive blocks as one."""
        if len(parts) == 1:
            return parts[0]
        rows = {name: np.concatenate([getattr(p, name) for p in parts])
                for name in ("time", "angle", "channels", "field_time", "field_angle")}  # fmt: skip
        return cls(
            **rows, probes=Series.joined([p.probes for p in parts]), fields=Series.joined([p.fields for p in parts])
        )


@dataclass(frozen=True)
class SaveAt:
    """What of a run is kept; probes and channels are kept at every step.

    Parameters
    ----------
    field_every
        All unknowns at every so many steps, the first and the last step included.
    fields_per_block
        Saved fields handed out together; None for as many as make a block worth its trouble, and keep it small.
    channels
        Whether channels and energies are computed; without them a run cannot go on where laws have internal states.

    Examples
    --------
    >>> SaveAt(field_every=100).block
    3200
    """

    field_every: int = 20
    fields_per_block: int | None = None
    channels: bool = True

    @property
    def block(self) -> int:
        """Steps handed out together."""
        if self.fields_per_block:
            return self.field_every * self.fields_per_block
        fields = max(_FIELDS, -(-_WORTH // self.field_every))
        return self.field_every * min(fields, _MOST // self.field_every) or _MOST

    def fields(self, steps: IntArray, last: int) -> NDArray[np.bool_]:
        """Tell after which of some steps all unknowns are kept.

        Parameters
        ----------
        steps
            Numbers of steps, shape (b,).
        last
            Number of the last step of the run.

        Returns
        -------
        ndarray
            Shape (b,), bool.
        """
        return (steps % self.field_every == 0) | (steps == last)

    def __post_init__(self) -> None:
        for name in ("field_every", "fields_per_block"):
            given: int | None = getattr(self, name)
            if given is not None and given < 1:
                raise refuse(f"save.{name}", given, "a whole number from 1")


class Sink(Protocol):
    """Something that takes results as they come."""

    def write(self, block: Block) -> None:
        """Take the next block."""
        ...

    def close(self, status: Status, stats: Stats) -> None:
        """Learn how the run ended; called once, also after a failure."""
        ...


Advance = Callable[[int], None]
"""Told how many more of many things are finished."""


Thing = TypeVar("Thing")
"""What is counted."""


def track_progress(things: Iterable[Thing], advance: Advance | None) -> Iterator[Thing]:
    """Yield things one after the other, and tell after each that one more is finished."""
    for one in things:
        yield one
        if advance is not None:
            advance(1)
