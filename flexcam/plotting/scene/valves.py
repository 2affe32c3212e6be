"""Valves: head, stem, retainer and the seat they close on."""

from __future__ import annotations

from dataclasses import dataclass

from flexcam.core import FloatArray
from flexcam.plotting.scene.solids import Solid, ring, turned

STEM = 1.0 / 6.0
"""Diameter of a stem over that of its head."""

LENGTH = 3.0
"""Length of a valve over the diameter of its head."""

_HALF = 0.5 * STEM
_TULIP = [(-0.45, _HALF), (-0.2, 1.3 * _HALF), (-0.1, 2.1 * _HALF), (-0.04, 0.47), (0.0, 0.5), (0.03, 0.5)]
"""Places before the end of a valve and radii there, over the diameter of its head."""


@dataclass(frozen=True, eq=False)
class ValvePlace:
    """Where a valve is.

    Parameters
    ----------
    point
        Name of the point it moves with.
    tip
        End of its stem, or the middle of its head where the stem is a member of the model, as installed, m, shape (3,).
    away
        Unit vector in which it opens, shape (3,).
    stem
        Whether its stem is drawn with it.
    seat
        Whether the model has a seat for it.
    """

    point: str
    tip: FloatArray
    away: FloatArray
    stem: bool
    seat: bool


def valve(place: ValvePlace, moved: FloatArray, head: float) -> list[Solid]:
    """Return a valve, and its seat where the model has one."""
    length, away = (LENGTH * head if place.stem else 0.0), place.away
    tip, stem = place.tip + moved, 0.5 * STEM * head
    profile = [(length + x * head, radius * head) for x, radius in _TULIP]
    parts = [turned("valve", tip, away, [*([(0.0, stem)] if place.stem else []), *profile])]
    if place.seat:
        closed = place.tip + (length - 0.08 * head) * away
        parts.append(ring("seat", closed, away, (0.47 * head, 0.62 * head), 0.14 * head))
    return parts
