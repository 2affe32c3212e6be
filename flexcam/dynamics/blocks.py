"""Blocks of results, dense output between instants, sinks of results, and checkpoints.

A checkpoint is the state of a run between two blocks, as plain arrays, from which an interrupted run resumes. It is
created and restored here; `io` stores it in the partial result.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, fields, is_dataclass
from typing import Any, NamedTuple, Protocol, TypeVar, runtime_checkable

import numpy as np
from numpy.typing import NDArray

from flexcam.core import FloatArray, IntArray
from flexcam.core.errors import refuse
from flexcam.dynamics.status import Stats, Status

SLOPES = {"displacement": "velocity", "velocity": "acceleration"}
"""Motions that are cubics between two instants, and their derivatives."""


class Series(NamedTuple):
    """Displacement, velocity and acceleration at a sequence of instants, arrays of shape (times, columns)."""

    displacement: FloatArray
    velocity: FloatArray
    acceleration: FloatArray

    @classmethod
    def concatenate(cls, parts: Sequence[Series]) -> Series:
        """Return the concatenated parts."""
        return cls(*map(np.concatenate, zip(*parts, strict=True)))

    def whole(self, order: int) -> FloatArray:
        """Return displacement, velocity or acceleration, see `flexcam.dynamics.system.MotionView`."""
        return self[order]

    def extract(self, rows: FloatArray, order: int = 0) -> FloatArray:
        """Return the components that rows select, see `flexcam.dynamics.system.MotionView`."""
        return (rows @ self[order].T).T  # contiguous history per row

    def interpolate(self, own: FloatArray, times: FloatArray) -> Series:
        """Return the motion at other ascending times, s, by interpolation between instants.

        Displacements are cubics with the velocities at both ends, velocities cubics with the accelerations,
        accelerations linear: of higher order than the integrators, and without overshoot at a jump of a law.
        """
        right = np.clip(np.searchsorted(own, times, side="right"), 1, len(own) - 1)
        left = right - 1
        length = (own[right] - own[left])[:, None]
        x = (times - own[left])[:, None] / length
        d, v, a = self
        d_new = _cubic(x, d[left], d[right], length * v[left], length * v[right])
        v_new = _cubic(x, v[left], v[right], length * a[left], length * a[right])
        return Series(d_new, v_new, a[left] + x * (a[right] - a[left]))

    def at(self, instants: NDArray[np.bool_] | IntArray | slice) -> Series:
        """Return selected instants by mask or index."""
        return Series(*(values[instants] for values in self))


def _cubic(x: FloatArray, old: FloatArray, new: FloatArray, slope: FloatArray, new_slope: FloatArray) -> FloatArray:
    """Return Hermite's cubic at x from 0 to 1."""
    y = 1.0 - x
    return y * y * ((1.0 + 2.0 * x) * old + x * slope) + x * x * ((3.0 - 2.0 * x) * new - y * new_slope)


_BLOCK_STEPS, _LARGE_BLOCK_STEPS, _MAX_BLOCK_STEPS = 2560, 640, 8192
"""Minimum steps per block: of a small system, whose blocks take a third longer if they have 640 steps, and of a large
one, whose fields need memory. Maximum, so that the memory of a run does not depend on the interval of saved fields."""

_BLOCK_VALUES = 1_600_000
"""Number of unknowns times steps per block above which a system is large."""

_FIELDS = 32
"""Number of saved fields written together if they are close in time."""


@dataclass(frozen=True, eq=False)
class Block:
    """Results of successive steps."""

    time: FloatArray  #: s, shape (b,)
    angle: FloatArray  #: cam angle, rad
    probes: Series  #: all probe scalars side by side, shape (b, p)
    channels: FloatArray  #: all channels side by side, shape (b, c)
    field_time: FloatArray  #: instants of the saved fields, shape (f,)
    field_angle: FloatArray
    fields: Series  #: all unknowns at those instants, shape (f, n)

    @classmethod
    def concatenate(cls, parts: Sequence[Block]) -> Block:
        """Return successive blocks as one."""
        if len(parts) == 1:
            return parts[0]
        probes, fields = Series.concatenate([p.probes for p in parts]), Series.concatenate([p.fields for p in parts])
        names = ("time", "angle", "channels", "field_time", "field_angle")
        rows = {name: np.concatenate([getattr(part, name) for part in parts]) for name in names}
        return cls(**rows, probes=probes, fields=fields)


@dataclass(frozen=True)
class SaveAt:
    """Output settings of a run; probes and channels are saved at every step.

    Parameters
    ----------
    field_every
        Interval of saved fields in steps; the first and the last step are included.
    fields_per_block
        Saved fields per block; None for an automatic choice.
    channels
        Whether channels and energies are computed; without them a run with internal states cannot be resumed.
    energies
        Whether energies and internal states are among the channels.
    unknowns
        Number of unknowns: a block of a large system has fewer steps.

    Examples
    --------
    >>> SaveAt(field_every=100).block, SaveAt(field_every=20, unknowns=100_000).block
    (3200, 640)
    """

    field_every: int = 20
    fields_per_block: int | None = None
    channels: bool = True
    energies: bool = True
    unknowns: int = 0

    @property
    def block(self) -> int:
        """Steps per block."""
        if self.fields_per_block:
            return self.field_every * self.fields_per_block
        steps = min(max(_BLOCK_VALUES // max(self.unknowns, 1), _LARGE_BLOCK_STEPS), _BLOCK_STEPS)
        fields = max(_FIELDS, -(-steps // self.field_every))
        return self.field_every * min(fields, _MAX_BLOCK_STEPS // self.field_every) or _MAX_BLOCK_STEPS

    def fields(self, steps: IntArray, last: int) -> NDArray[np.bool_]:
        """Return after which steps all unknowns are saved, shape (b,).

        Parameters
        ----------
        steps, last
            Numbers of b steps, and of the last step of the run.
        """
        return (steps % self.field_every == 0) | (steps == last)

    def __post_init__(self) -> None:
        for name in ("field_every", "fields_per_block"):
            given: int | None = getattr(self, name)
            if given is not None and given < 1:
                raise refuse(f"save.{name}", given, "a whole number, at least 1")


class Sink(Protocol):
    """Interface of a receiver of results."""

    def write(self, block: Block) -> None:
        """Write the next block."""
        ...

    def close(self, status: Status, stats: Stats) -> None:
        """Close with the status of the run; called once, even after a failure."""
        ...


ProgressCallback = Callable[[int], None]
"""Progress callback; its argument is the number of newly finished items."""


Item = TypeVar("Item")


def track_progress(things: Iterable[Item], advance: ProgressCallback | None) -> Iterator[Item]:
    """Yield items and report progress after each."""
    for item in things:
        yield item
        if advance is not None:
            advance(1)


Arrays = Mapping[str, NDArray[Any]]
"""Arrays by name; dots separate nested names."""


@dataclass(frozen=True, eq=False)
class Checkpoint:
    """State of a run between two blocks."""

    steps: int  #: instants output so far, including the start
    problem: str  #: digest of the problem, see `flexcam.dynamics.solve`
    arrays: Arrays  #: state for the next step that is not part of the problem


@runtime_checkable
class CheckpointSink(Protocol):
    """Sink that also stores checkpoints."""

    def write_checkpoint(self, checkpoint: Checkpoint) -> None:
        """Store the checkpoint after the last block written."""
        ...


class CompletedPart(Protocol):
    """Completed part of an interrupted run."""

    @property
    def checkpoint(self) -> Checkpoint:
        """Checkpoint from which the run resumes."""
        ...

    def blocks(self) -> Iterator[Block]:
        """Yield the completed results block by block."""
        ...


def flatten(name: str, value: object) -> dict[str, NDArray[Any]]:
    """Return a value and its fields as flat arrays."""
    if value is None:
        return {}
    if not is_dataclass(value):
        return {name: np.asarray(value)}
    parts = (flatten(f"{name}.{field.name}", getattr(value, field.name)) for field in fields(value))
    return {key: array for part in parts for key, array in part.items()}


def select_prefix(name: str, arrays: Arrays) -> dict[str, NDArray[Any]]:
    """Return the arrays of one value by their nested names."""
    return {key.removeprefix(f"{name}."): array for key, array in arrays.items() if key.startswith(f"{name}.")}
