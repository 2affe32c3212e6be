"""Tables of a Campbell diagram: modes over speed, and where orders meet them."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import asdict

from rich.table import Table

from flexcam.console.words import mm
from flexcam.linalg import FloatArray
from flexcam.response import Status
from flexcam.stability import Campbell
from flexcam.terminal import table
from flexcam.units import shaft_name


def campbell_table(found: Campbell, scale: float) -> Table:
    """Return the modes over speed, a row each."""
    low, high = (f"Hz at {scale * found.rpm[i]:.6g}" for i in (0, -1))
    rows = [
        (str(i + 1), _hz(column[0]), _hz(column[-1]), "yes" if reached else "no", words)
        for i, (column, reached, words) in enumerate(zip(found.frequencies.T, found.reached, found.words, strict=True))
    ]
    title = f"Modes at full lift of {found.contact} over {shaft_name(scale)} rpm"
    return table(title, ("mode", low, high, "felt", "what moves"), rows)


def _hz(value: float) -> str:
    return "-" if math.isnan(value) else f"{value:.5g}"


def crossing_table(found: Campbell, scale: float) -> Table:
    """Return where orders meet modes, the lowest speed first."""
    rows = [
        (f"{scale * one.rpm:.6g}", str(one.harmonic), str(one.mode + 1), f"{one.frequency:.5g}", mm(one.amplitude, 3),
         _force(one.load), one.words)
        for one in found.crossings
    ]  # fmt: skip
    title = "Where orders of the camshaft meet modes that are felt at the contact"
    head = (f"{shaft_name(scale)} rpm", "order", "mode", "Hz", "in the lift, mm", "in the force, N", "what moves")
    return table(title if rows else f"{title}: nowhere between these speeds", head, rows)


def _force(value: float) -> str:
    return "-" if math.isnan(value) else f"{value:.3g}"


def campbell_json(found: Campbell, scale: float) -> dict[str, object]:
    """Return the same as ``--json`` prints it."""
    modes = [
        {"frequencies_hz": [_or_none(x) for x in column.tolist()], "reached": reached, "moves": words}
        for column, reached, words in zip(found.frequencies.T, found.reached, found.words, strict=True)
    ]
    met = [
        {**asdict(one), "rpm": scale * one.rpm, "mode": one.mode + 1, "load": _or_none(one.load)}
        for one in found.crossings
    ]
    return {
        "shaft": shaft_name(scale), "contact": found.contact, "rpm": (scale * found.rpm).tolist(), "modes": modes,
        "lift_amplitudes_m": {str(n): size for n, size in found.lifts.items()},
        "force_amplitudes_n": {
            str(n): [_or_none(x) for x in column.tolist()] for n, column in zip(found.lifts, found.loads.T, strict=True)
        },
        "crossings": met, "ended": [str(one.cause) for one in found.statuses],
    }  # fmt: skip


def _or_none(value: float) -> float | None:
    return None if math.isnan(value) else value


def nothing_known(statuses: Sequence[Status]) -> Status | None:
    """Return how a command over speeds ends of which none was computed."""
    if any(one.ok for one in statuses):
        return None
    first = statuses[0]
    return Status(first.cause, f"none of {len(statuses)} speeds was completed; the first: {first.text}", first.remedy)


def ended_early(statuses: Sequence[Status], rpm: FloatArray, scale: float) -> list[str]:
    """Return what must be said of runs that did not reach their end."""
    return [
        f"Warning: nothing is known at {scale * speed:.6g} {shaft_name(scale)} rpm: {status}"
        for status, speed in zip(statuses, rpm.tolist(), strict=True)
        if not status.ok
    ]
