"""Coil springs as helices that follow the motion of the spring parts."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from flexcam.core import FloatArray
from flexcam.plotting.scene.instant import SceneState
from flexcam.plotting.scene.sizes import CoilSizes
from flexcam.plotting.scene.solids import Solid, circle, loft, perpendicular_axes, ring

_PER_COIL = 20
_WIRE = 10
_END_COILS = 1.0
"""Number of closed coils at each end."""


def coil_solid(sizes: CoilSizes, start: FloatArray, axis: FloatArray, moved: FloatArray, length: float) -> Solid:
    """Return the solid of a coil spring."""
    turns = sizes.coils + 2.0 * _END_COILS
    angle = np.linspace(0.0, 2.0 * math.pi * turns, round(_PER_COIL * turns) + 1)
    place = _coil_height(angle / (2.0 * math.pi), turns, sizes, length)
    closed = (0.5 + _END_COILS) * sizes.wire  # end coils move with the ends
    along = place + np.interp(place, np.linspace(closed, max(length - closed, closed), len(moved)), moved)
    first, second = perpendicular_axes(axis)
    out = np.cos(angle)[:, None] * first + np.sin(angle)[:, None] * second
    centres = start + along[:, None] * axis + 0.5 * sizes.diameter * out
    tangent = np.gradient(centres, axis=0)
    tangent /= np.linalg.norm(tangent, axis=1)[:, None]
    up = np.cross(tangent, out)
    wire = circle(0.5 * sizes.wire, _WIRE)
    return loft("spring", centres[:, None] + wire[:, :1] * out[:, None] + wire[:, 1:] * up[:, None])


def _coil_height(turn: FloatArray, turns: float, sizes: CoilSizes, length: float) -> FloatArray:
    """Return the height of the wire centre over the turns: closed end coils, evenly spaced active coils."""
    inner = max(length - (1.0 + 2.0 * _END_COILS) * sizes.wire, 0.0)
    half = 0.5 * sizes.wire
    knots = [0.0, _END_COILS, turns - _END_COILS, turns]
    return np.interp(
        turn, knots, [half, half + _END_COILS * sizes.wire, half + _END_COILS * sizes.wire + inner, length - half]
    )


@dataclass(frozen=True, eq=False)
class CoilPlacement:
    """Position of a coil spring.

    Parameters
    ----------
    start
        Installed position of its fixed end (that at `to`), m, shape (3,).
    axis
        Unit vector from there to its moving end, shape (3,).
    sizes
        Sizes of the coil.
    borders
        Rows over the degrees of freedom for the displacements of the boundaries of its parts along the spring
        direction, from the fixed end to the moving end, shape (parts + 1, n).
    sense
        1 if the direction of the spring is along `axis`, else -1.
    ground, retainer
        Whether it stands on a washer at ground, and whether it has a retainer.
    """

    start: FloatArray
    axis: FloatArray
    sizes: CoilSizes
    borders: FloatArray
    sense: float
    ground: bool
    retainer: bool


def spring_solids(place: CoilPlacement, instant: SceneState) -> list[Solid]:
    """Return the solids of a spring."""
    moved = place.sense * (place.borders @ instant.unknowns)
    size, axis = place.sizes, place.axis
    made = [coil_solid(size, place.start, axis, moved, size.length)]
    inner, outer, thick = 0.5 * (size.diameter - 1.6 * size.wire), 0.5 * size.diameter + size.wire, 0.7 * size.wire
    if place.retainer:
        top = place.start + (size.length + moved[-1] + 0.5 * thick) * axis
        made.append(ring("retainer", top, axis, (0.25 * inner, outer), thick))
    if place.ground:
        made.append(ring("ground", place.start - 0.5 * thick * axis, axis, (0.6 * inner, 1.1 * outer), thick))
    return made
