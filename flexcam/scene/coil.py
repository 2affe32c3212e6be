"""A coil spring as a helix whose coils lie where the spring's parts have moved."""

from __future__ import annotations

import math

import numpy as np

from flexcam.linalg import FloatArray
from flexcam.scene.shapes import across, circle
from flexcam.scene.sizes import CoilSizes
from flexcam.scene.solid import Solid, loft

_PER_COIL = 20
_WIRE = 10
_DEAD = 1.0
"""Closed coils at each end."""


def coil(sizes: CoilSizes, start: FloatArray, axis: FloatArray, moved: FloatArray, length: float) -> Solid:
    """Return a coil spring."""
    turns = sizes.coils + 2.0 * _DEAD
    angle = np.linspace(0.0, 2.0 * math.pi * turns, round(_PER_COIL * turns) + 1)
    place = _rise(angle / (2.0 * math.pi), turns, sizes, length)
    closed = (0.5 + _DEAD) * sizes.wire  # coils at the ends move with the ends
    along = place + np.interp(place, np.linspace(closed, max(length - closed, closed), len(moved)), moved)
    first, second = across(axis)
    out = np.cos(angle)[:, None] * first + np.sin(angle)[:, None] * second
    centres = start + along[:, None] * axis + 0.5 * sizes.diameter * out
    tangent = np.gradient(centres, axis=0)
    tangent /= np.linalg.norm(tangent, axis=1)[:, None]
    up = np.cross(tangent, out)
    wire = circle(0.5 * sizes.wire, _WIRE)
    return loft("spring", centres[:, None] + wire[:, :1] * out[:, None] + wire[:, 1:] * up[:, None])


def _rise(turn: FloatArray, turns: float, sizes: CoilSizes, length: float) -> FloatArray:
    """Return the height of the wire's centre over the turns: closed end coils, the active ones evenly between them."""
    inner = max(length - (1.0 + 2.0 * _DEAD) * sizes.wire, 0.0)
    half = 0.5 * sizes.wire
    knots = [0.0, _DEAD, turns - _DEAD, turns]
    return np.interp(turn, knots, [half, half + _DEAD * sizes.wire, half + _DEAD * sizes.wire + inner, length - half])
