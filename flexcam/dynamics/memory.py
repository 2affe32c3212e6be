"""Results in memory: all results, recent ones, or only extremes.

`solve` writes its blocks to one of these sinks and returns its response.
"""

from __future__ import annotations

from collections import deque
from dataclasses import replace
from typing import Protocol

import numpy as np

from flexcam.core import FloatArray
from flexcam.dynamics.blocks import Block, Series, Sink
from flexcam.dynamics.response import Outline, Response, turning_points
from flexcam.dynamics.status import Stats, Status


class ResponseSink(Sink, Protocol):
    """Sink that provides a response."""

    def response(self) -> Response:
        """Return the stored response."""
        ...


class MemorySink:
    """Sink that stores all results and provides the `Response`; expected numbers of rows are allocated in advance."""

    def __init__(self, outline: Outline, instants: int = 0, fields: int = 0) -> None:
        self.outline = outline
        self._kept = [_Rows(room) for room in (instants, instants, instants, fields, fields)]
        self._end = (Status(), Stats())

    def response_of(self, block: Block) -> Response:
        """Return a block as a response."""
        return _response(self.outline, block, self._end)

    def write(self, block: Block) -> None:
        """Store a block."""
        times, field_times = (block.time, block.angle), (block.field_time, block.field_angle)
        more = times, (block.channels,), block.probes, field_times, block.fields
        for rows, arrays in zip(self._kept, more, strict=True):
            rows.add(arrays)

    def close(self, status: Status, stats: Stats) -> None:
        """Store the status."""
        self._end = (status, stats)

    def response(self) -> Response:
        """Return all stored results; empty arrays without results."""
        if not self._kept[0].count:
            self.write(_empty(self.outline))
        (time, angle), (channels,), probes, (field_time, field_angle), fields = (rows.arrays for rows in self._kept)
        whole = Block(time, angle, Series(*probes), channels, field_time, field_angle, Series(*fields))
        return _response(self.outline, whole, self._end)


class _Rows:
    """Growing arrays with a common number of rows in one allocation, which is faster than several."""

    def __init__(self, expected: int) -> None:
        self.count = 0
        self._expected, self._all = expected, np.zeros((0, 0))

    @property
    def arrays(self) -> FloatArray:
        """The rows added so far."""
        return self._all[:, : self.count]

    def add(self, arrays: tuple[FloatArray, ...]) -> None:
        """Add rows to every array."""
        end = self.count + len(arrays[0])
        if not self.count or end > self._all.shape[1]:
            least, columns = max(end, 2 * self.count), arrays[0].shape[1:]
            try:
                room = np.empty((len(arrays), max(self._expected, least), *columns))
            except MemoryError:  # a run may end long before its last step
                room = np.empty((len(arrays), least, *columns))
            if self.count:
                room[:, : self.count] = self.arrays
            self._all = room
        for kept, array in zip(self._all, arrays, strict=True):
            kept[self.count : end] = array
        self.count = end


def _response(outline: Outline, whole: Block, end: tuple[Status, Stats]) -> Response:
    """Return a response of one block that holds everything."""
    return Response(
        outline=outline, time=whole.time, angle=whole.angle, probes=whole.probes,
        channels={name: whole.channels[:, i] for i, (name, _) in enumerate(outline.channels)},
        field_time=whole.field_time, field_angle=whole.field_angle, fields=whole.fields, status=end[0], stats=end[1],
    )  # fmt: skip


class RecentSink(MemorySink):
    """Sink that stores the histories of at least a time span, s, in whole blocks, and the last field."""

    def __init__(self, outline: Outline, span: float) -> None:
        super().__init__(outline)
        self._blocks: deque[Block] = deque()
        self._span = span
        self._without = _empty(outline)
        self._field = self._without.time, self._without.angle, self._without.fields

    def write(self, block: Block) -> None:
        """Store a block, and drop outdated ones."""
        if len(block.field_time):
            last = Series(*(np.array(one[-1:]) for one in block.fields))
            self._field = block.field_time[-1:].copy(), block.field_angle[-1:].copy(), last
        nothing = self._without
        self._blocks.append(replace(block, field_time=nothing.time, field_angle=nothing.angle, fields=nothing.fields))
        oldest = block.time[-1] - self._span * (1.0 + _SLACK)
        while self._blocks[0].time[-1] < oldest:
            self._blocks.popleft()

    def response(self) -> Response:
        """Return the stored response."""
        kept, (time, angle, fields) = Block.concatenate([*self._blocks] or [self._without]), self._field
        return _response(self.outline, replace(kept, field_time=time, field_angle=angle, fields=fields), self._end)


class ExtremesSink:
    """Sink that tracks minima and maxima over a run without storing histories.

    Extremes of probes are those of the dense output, which may lie between two instants.
    """

    def __init__(self, outline: Outline) -> None:
        self.outline = outline
        self.steps = 0  #: instants seen
        self.most_bent: FloatArray = np.zeros(len(outline.unknowns))  #: field of maximum displacement, shape (n,)
        self._channel = {name: i for i, (name, _) in enumerate(outline.channels)}
        self._probes = _Bounds(sum(len(components) for _, components in outline.probes))
        self._channels = _Bounds(len(outline.channels))
        self._before = _empty(outline)

    @classmethod
    def of(cls, response: Response) -> ExtremesSink:
        """Return the extremes of a response."""
        seen = cls(response.outline)
        channels = [response.channels[name] for name, _ in response.outline.channels]
        rows = np.column_stack(channels) if channels else np.zeros((len(response.time), 0))
        saved = response.field_time, response.field_angle, response.fields
        seen.write(Block(response.time, response.angle, response.probes, rows, *saved))
        return seen

    def write(self, block: Block) -> None:
        """Update with a block."""
        if len(block.time):
            self.steps += len(block.time)
            self._probes.widen(block.probes.displacement)
            self._probes.widen(self._turns(block))
            self._channels.widen(block.channels)
        if block.fields.displacement.size:
            largest = np.abs(block.fields.displacement).max(axis=1)
            row = int(np.argmax(largest))
            if largest[row] > np.abs(self.most_bent).max(initial=0.0):
                self.most_bent = block.fields.displacement[row].copy()

    def close(self, status: Status, stats: Stats) -> None:
        """Do nothing."""

    def _turns(self, block: Block) -> FloatArray:
        """Return the turning points of probes within a block and before its first instant."""
        before, now = self._before, block.probes
        self._before = replace(before, time=block.time[-1:].copy(), probes=Series(*(x[-1:].copy() for x in now)))
        whole = Series.concatenate([before.probes, now])
        return turning_points(np.append(before.time, block.time), whole.displacement, whole.velocity)[1]

    def probe(self, name: str) -> tuple[FloatArray, FloatArray]:
        """Return minimum and maximum displacement of a probe or of a component, shape (components,)."""
        columns = self.outline.columns(name)
        return self._probes.least[columns], self._probes.largest[columns]

    @property
    def energies(self) -> bool:
        """True if the run computed its energy balance."""
        return any(name.startswith("energy.") for name in self._channel)

    def channel(self, name: str) -> tuple[float, float]:
        """Return minimum and maximum of a channel; zeros if not saved."""
        at = self._channel.get(name)
        return (0.0, 0.0) if at is None else (float(self._channels.least[at]), float(self._channels.largest[at]))


class _Bounds:
    """Minimum and maximum of columns; zeros initially."""

    def __init__(self, width: int) -> None:
        self.least: FloatArray = np.zeros(width)
        self.largest: FloatArray = np.zeros(width)
        self._begun = False

    def widen(self, rows: FloatArray) -> None:
        """Extend the range by some rows."""
        if len(rows):
            known = [self.least[None], self.largest[None]] if self._begun else []
            every = np.concatenate([rows, *known])
            self.least, self.largest, self._begun = every.min(axis=0), every.max(axis=0), True


_SLACK = 1e-6
"""Relative extension of a time span, because its first instants are rounded."""


def _empty(outline: Outline) -> Block:
    nothing = np.zeros(0)
    probes = np.zeros((0, sum(len(components) for _, components in outline.probes)))
    fields = np.zeros((0, len(outline.unknowns)))
    channels = np.zeros((0, len(outline.channels)))
    return Block(
        nothing, nothing, Series(probes, probes, probes), channels, nothing, nothing, Series(fields, fields, fields)
    )
