"""What a sweep found, in a table of ranges and in words."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from rich.table import Table as RichTable

from flexcam.linalg import FloatArray
from flexcam.response import Cause, Status
from flexcam.sweep import Table
from flexcam.terminal import table

_NAMED = 3
"""Variants that a sentence names."""


def sweep_table(found: Table) -> RichTable:
    """Return the range of every scalar; one that is the same in all variants is left out."""
    rows: list[tuple[str, ...]] = []
    for name, values in found.scalars.items():
        if _differs(values):
            least, largest = int(np.nanargmin(values)), int(np.nanargmax(values))
            ends = (f"{values[least]:.5g}", _at(found, least), f"{values[largest]:.5g}", _at(found, largest))
            rows.append((name, found.units[name], *ends))
    title = f"{len(found)} variants over {', '.join(one.name for one in found.inputs)}"
    return table(title, ("scalar", "SI unit", "least", "at", "largest", "at"), rows)


def _differs(values: FloatArray) -> bool:
    """Tell whether a scalar has a range to show: two values or more, or one alone."""
    known = values[np.isfinite(values)]
    return len(known) == 1 or (len(known) > 0 and bool(np.ptp(known) > 0.0))


def _at(found: Table, i: int) -> str:
    """Return the inputs of a variant."""
    values = [one.values[i] for one in found.inputs]
    told = [value if isinstance(value, str) else f"{value:.6g}" for value in values]
    return ", ".join(f"{value} {one.unit}".rstrip() for value, one in zip(told, found.inputs, strict=True))


def sweep_words(found: Table) -> list[str]:
    """Return sentences of what went wrong, and of a table without rows."""
    alike = found.scalars and not any(_differs(values) for values in found.scalars.values())
    words = ["every scalar is the same in all variants; the files have them"] if alike else list[str]()
    for cause, rows in _failures(found).items():
        named = ", ".join(str(i + 1) for i in rows[:_NAMED])
        more = f" and {len(rows) - _NAMED} more" if len(rows) > _NAMED else ""
        one, first = "variant" if len(rows) == 1 else "variants", found.statuses[rows[0]]
        words.append(f"{len(rows)} of {len(found)} failed ({cause}): {one} {named}{more}. The first: {first.text}")
    return words


def _failures(found: Table) -> dict[str, list[int]]:
    causes: dict[str, list[int]] = {}
    for i in found.failed:
        causes.setdefault(str(found.statuses[i].cause), []).append(i)
    return causes


def sweep_status(found: Table) -> Status | None:
    """Return how the command ends: a sweep fails when every variant does."""
    if len(found.failed) < len(found):
        return None
    first = found.statuses[0]
    return Status(first.cause, f"none of {len(found)} variants was completed; the first: {first.text}", first.remedy)


def sweep_json(found: Table, ended: Status | None, files: Sequence[Path]) -> dict[str, object]:
    """Return the same as ``--json`` prints it."""
    status = ended or Status(Cause.DONE, "the sweep is complete")
    return {
        "status": "ok" if ended is None else str(status.cause),
        "message": status.text,
        "variants": len(found),
        "failed": {cause: [i + 1 for i in rows] for cause, rows in _failures(found).items()},
        "inputs": {one.name: one.unit for one in found.inputs},
        "scalars": {name: _range(found, name) for name in found.scalars},
        "files": [str(path) for path in files],
    }


def _range(found: Table, name: str) -> dict[str, object]:
    values = found.scalars[name]
    return {"unit": found.units[name], "least": float(np.nanmin(values)), "largest": float(np.nanmax(values))}
