"""Table of limits over two numbers of a case."""

from __future__ import annotations

import math

from flexcam.console.told import Told, csv_of, or_none, shown
from flexcam.study import LimitMap
from flexcam.sweep import Axis
from flexcam.terminal import table


def told_limit_map(found: LimitMap, shaft: str) -> Told:
    """Return a map of limits as tables."""
    first, second = found.axes
    tables = [
        table(
            f"{name.replace('_', ' ')}, {shaft} rpm; along: {axis_words(second)}",
            (axis_words(first), *(shown(value.number or 0.0) for value in second.values)),
            [
                (shown(value.number or 0.0), *(shown(x) for x in row))
                for value, row in zip(first.values, rpm.tolist(), strict=True)
            ],
        )
        for name, rpm in found.rpm.items()
    ]
    gaps = sum(not status.ok for status in found.statuses)
    words = (
        ["A dash: not met in the range looked at."] if any(_gaps(rpm.tolist()) for rpm in found.rpm.values()) else []
    )
    if gaps:
        failed = next(status for status in found.statuses if not status.ok)
        words.append(f"{gaps} variants have no numbers; the first: {failed}")
    head = (axis_words(first), axis_words(second), *(f"{name} [{shaft} rpm]" for name in found.rpm), "status")
    rows = [
        (one.number or 0.0, other.number or 0.0, *(float(rpm[i, j]) for rpm in found.rpm.values()),
         str(found.statuses[i * len(second.values) + j].cause))
        for i, one in enumerate(first.values)
        for j, other in enumerate(second.values)
    ]  # fmt: skip
    json = {
        "shaft": shaft,
        "over": {"key": first.key, "unit": first.unit, "values": [value.number for value in first.values]},
        "and": {"key": second.key, "unit": second.unit, "values": [value.number for value in second.values]},
        "limits_rpm": {name: [[or_none(x) for x in row] for row in rpm.tolist()] for name, rpm in found.rpm.items()},
        "statuses": [str(status.cause) for status in found.statuses],
    }
    return Told(tables, words, json, csv_of(head, rows))


def axis_words(axis: Axis) -> str:
    """Return what stands along an axis."""
    return f"{axis.key}, {axis.unit}" if axis.unit else axis.key


def _gaps(rows: list[list[float]]) -> bool:
    return any(math.isnan(x) for row in rows for x in row)
