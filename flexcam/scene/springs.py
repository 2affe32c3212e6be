"""Springs as coils between their ends."""

from __future__ import annotations

from dataclasses import dataclass

from flexcam.linalg import FloatArray
from flexcam.scene.coil import coil
from flexcam.scene.instant import Instant
from flexcam.scene.shapes import ring
from flexcam.scene.sizes import CoilSizes
from flexcam.scene.solid import Solid


@dataclass(frozen=True, eq=False)
class CoilPlace:
    """Where a coil is.

    Parameters
    ----------
    start
        Its fixed end (that at `to`) as installed, m, shape (3,).
    axis
        Unit vector from there to its moving end, shape (3,).
    sizes
        Of the coil.
    borders
        Rows over the unknowns of the motions of its parts' borders along the spring's direction, from the fixed end to
        the moving one, shape (parts + 1, n).
    sense
        1 where the spring's direction leads along `axis`, else -1.
    ground, retainer
        Whether it stands on a washer at ground, and whether it bears a retainer.
    """

    start: FloatArray
    axis: FloatArray
    sizes: CoilSizes
    borders: FloatArray
    sense: float
    ground: bool
    retainer: bool


def drawn(place: CoilPlace, instant: Instant) -> list[Solid]:
    """Return a spring."""
    moved = place.sense * (place.borders @ instant.unknowns)
    size, axis = place.sizes, place.axis
    made = [coil(size, place.start, axis, moved, size.length)]
    inner, outer, thick = 0.5 * (size.diameter - 1.6 * size.wire), 0.5 * size.diameter + size.wire, 0.7 * size.wire
    if place.retainer:
        top = place.start + (size.length + moved[-1] + 0.5 * thick) * axis
        made.append(ring("retainer", top, axis, (0.25 * inner, outer), thick))
    if place.ground:
        made.append(ring("ground", place.start - 0.5 * thick * axis, axis, (0.6 * inner, 1.1 * outer), thick))
    return made
