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
        self._rows = [_Rows(room) for room in (instants, instants, instants, fields, fields)]
        self._end = (Status(), Stats())

    def response_of(self, block: Block) -> Response:
        """Return a block as a response."""
        return _response(self.outline, block, self._end)

    def write(self, block: Block) -> None:
        """Store a block."""
        times, field_times = (block.time, block.angle), (block.field_time, block.field_angle)
        parts = times, (block.channels,), block.probes, field_times, block.fields
        for rows, arrays in zip(self._rows, parts, strict=True):
            rows.add(arrays)

    def close(self, status: Status, stats: Stats) -> None:
        """Store the status."""
        self._end = (status, stats)

    def response(self) -> Response:
        """Return all stored results; empty arrays without results."""
        if not self._rows[0].count:
            self.write(_empty(self.outline))
        (time, angle), (channels,), probes, (field_time, field_angle), fields = (rows.arrays for rows in self._rows)
        block = Block(time, angle, Series(*probes), channels, field_time, field_angle, Series(*fields))
        return _response(self.outline, block, self._end)


class _Rows:
    """Growing arrays with a common number of rows in one allocation, which is faster than several."""

    def __init__(self, expected: int) -> None:
        self.count = 0
        self._expected, self._array = expected, np.zeros((0, 0))

    @property
    def arrays(self) -> FloatArray:
        """The rows added so far."""
        return self._array[:, : self.count]

    def add(self, arrays: tuple[FloatArray, ...]) -> None:
        """Add rows to every array."""
        end = self.count + len(arrays[0])
        if not self.count or end > self._array.shape[1]:
            minimum, columns = max(end, 2 * self.count), arrays[0].shape[1:]
            try:
                array = np.empty((len(arrays), max(self._expected, minimum), *columns))
            except MemoryError:  # a run may end long before its last step
                array = np.empty((len(arrays), minimum, *columns))
            if self.count:
                array[:, : self.count] = self.arrays
            self._array = array
        for target, source in zip(self._array, arrays, strict=True):
            target[self.count : end] = source
        self.count = end


def _response(outline: Outline, block: Block, end: tuple[Status, Stats]) -> Response:
    return Response(
        outline=outline, time=block.time, angle=block.angle, probes=block.probes,
        channels={name: block.channels[:, i] for i, (name, _) in enumerate(outline.channels)},
        field_time=block.field_time, field_angle=block.field_angle, fields=block.fields, status=end[0], stats=end[1],
    )  # fmt: skip


class RecentSink(MemorySink):
    """Sink that stores the histories of at least a time span, s, in whole blocks, and the last field."""

    def __init__(self, outline: Outline, span: float) -> None:
        super().__init__(outline)
        self._blocks: deque[Block] = deque()
        self._span = span
        self._empty_block = _empty(outline)
        self._field = self._empty_block.time, self._empty_block.angle, self._empty_block.fields

    def write(self, block: Block) -> None:
        """Store a block, and drop outdated ones."""
        if len(block.field_time):
            last = Series(*(np.array(values[-1:]) for values in block.fields))
            self._field = block.field_time[-1:].copy(), block.field_angle[-1:].copy(), last
        empty = self._empty_block
        self._blocks.append(replace(block, field_time=empty.time, field_angle=empty.angle, fields=empty.fields))
        oldest = block.time[-1] - self._span * (1.0 + _SLACK)
        while self._blocks[0].time[-1] < oldest:
            self._blocks.popleft()

    def response(self) -> Response:
        """Return the stored response."""
        block, (time, angle, fields) = Block.concatenate([*self._blocks] or [self._empty_block]), self._field
        return _response(self.outline, replace(block, field_time=time, field_angle=angle, fields=fields), self._end)


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
        self._last = _empty(outline)

    @classmethod
    def of(cls, response: Response) -> ExtremesSink:
        """Return the extremes of a response."""
        extremes = cls(response.outline)
        channels = [response.channels[name] for name, _ in response.outline.channels]
        rows = np.column_stack(channels) if channels else np.zeros((len(response.time), 0))
        saved = response.field_time, response.field_angle, response.fields
        extremes.write(Block(response.time, response.angle, response.probes, rows, *saved))
        return extremes

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
        before, now = self._last, block.probes
        self._last = replace(before, time=block.time[-1:].copy(), probes=Series(*(x[-1:].copy() for x in now)))
        probes = Series.concatenate([before.probes, now])
        return turning_points(np.append(before.time, block.time), probes.displacement, probes.velocity)[1]

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
        i = self._channel.get(name)
        return (0.0, 0.0) if i is None else (float(self._channels.least[i]), float(self._channels.largest[i]))


class _Bounds:
    """Minimum and maximum of columns; zeros initially."""

    def __init__(self, width: int) -> None:
        self.least: FloatArray = np.zeros(width)
        self.largest: FloatArray = np.zeros(width)
        self._has_rows = False

    def widen(self, rows: FloatArray) -> None:
        """Extend the range by some rows."""
        if len(rows):
            least, largest = rows.min(axis=0), rows.max(axis=0)
            self.least = np.minimum(self.least, least) if self._has_rows else least
            self.largest = np.maximum(self.largest, largest) if self._has_rows else largest
            self._has_rows = True


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
