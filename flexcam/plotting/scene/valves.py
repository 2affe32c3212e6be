"""Valves: head, stem, retainer and seat."""

from __future__ import annotations

from dataclasses import dataclass

from flexcam.core import FloatArray
from flexcam.plotting.scene.solids import Solid, revolve, ring

STEM = 1.0 / 6.0
"""Ratio of stem diameter to head diameter."""

LENGTH = 3.0
"""Ratio of valve length to head diameter."""

_HALF = 0.5 * STEM
_HEAD_PROFILE = [(-0.45, _HALF), (-0.2, 1.3 * _HALF), (-0.1, 2.1 * _HALF), (-0.04, 0.47), (0.0, 0.5), (0.03, 0.5)]
"""Axial positions from the valve end and radii there, relative to the head diameter."""


@dataclass(frozen=True, eq=False)
class ValvePlacement:
    """Position of a valve.

    Parameters
    ----------
    point
        Name of the point with which it moves.
    tip
        Installed position, m, shape (3,): end of the stem, or centre of the head if the stem is a member of the model.
    away
        Unit vector of the opening direction, shape (3,).
    stem
        Whether the stem is drawn.
    seat
        Whether the model has a seat for the valve.
    """

    point: str
    tip: FloatArray
    away: FloatArray
    stem: bool
    seat: bool


def valve_solids(place: ValvePlacement, moved: FloatArray, head: float) -> list[Solid]:
    """Return the solids of a valve, and of its seat if the model has one."""
    length, away = (LENGTH * head if place.stem else 0.0), place.away
    tip, stem = place.tip + moved, 0.5 * STEM * head
    profile = [(length + x * head, radius * head) for x, radius in _HEAD_PROFILE]
    parts = [revolve("valve", tip, away, [*([(0.0, stem)] if place.stem else []), *profile])]
    if place.seat:
        closed = place.tip + (length - 0.08 * head) * away
        parts.append(ring("seat", closed, away, (0.47 * head, 0.62 * head), 0.14 * head))
    return parts
