"""Meshes made from a few numbers: shafts, rods and the published models."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from flexcam.checks import refuse
from flexcam.fem.mesh import Mesh
from flexcam.linalg import FloatArray, IntArray


def chain(
    start: FloatArray | Sequence[float], end: FloatArray | Sequence[float], elements: int, name: str = "shaft"
) -> Mesh:
    """Return a straight member of equal elements with its ends named ``start`` and ``end``."""
    if elements < 1:
        raise refuse("elements", elements, "a whole number from 1")
    nodes = np.linspace(np.asarray(start, float), np.asarray(end, float), elements + 1)
    points: Mapping[str, Sequence[int]] = {"start": [0], "end": [elements], "inner": range(1, elements)}
    return Mesh(
        nodes,
        {name: np.arange(elements + 1)},
        {key: np.array(value, np.intp) for key, value in points.items() if len(value)},
    )


_SHAFT_X = {1: (0.0, 0.060, 0.120, 0.180), 2: (0.0, 0.060, 0.120, 0.180),
            3: (0.0, 0.060, 0.080, 0.100, 0.120, 0.140, 0.160, 0.180)}  # fmt: skip
_PUSHROD_ELEMENTS = {1: 1, 2: 5, 3: 3}
_BEARING_X = (0.060, 0.180)
_CAM_X, _BASE_RADIUS, _PUSHROD_LENGTH = 0.120, 0.018, 0.250


def published_model(model: int) -> Mesh:
    """Return the mesh of model 1, 2 or 3 of Tayeb and Sliman, as flexcam reconstructs it.

    The drawings are lost; this is the only arrangement with three bearings and axial-only inner pushrod nodes that
    has the printed counts of elements and unknowns (4/21, 8/25, 10/47). Nodes are numbered in the order of the
    printed load vector (26): shaft from the drive end, pushrod top, inner nodes downwards, tappet.
    """
    if model not in _SHAFT_X:
        raise refuse("model", model, "1, 2 or 3")
    x = np.array(_SHAFT_X[model])
    y = _BASE_RADIUS + np.linspace(_PUSHROD_LENGTH, 0.0, _PUSHROD_ELEMENTS[model] + 1)
    shaft = np.column_stack([x, 0.0 * x, 0.0 * x])
    rod = np.column_stack([np.full_like(y, _CAM_X), y, 0.0 * y])
    first = len(x)
    last = first + len(y) - 1
    points: dict[str, IntArray | list[int]] = {
        "drive": [0],
        "bearings": np.flatnonzero(np.isin(x, _BEARING_X)),
        "cam": np.flatnonzero(x == _CAM_X),
        "pushrod-top": [first],
        "guide": list(range(first, last)),
        "tappet": [last],
    }
    lines = {"camshaft": np.arange(first), "pushrod": np.arange(last, first - 1, -1)}
    return Mesh(np.concatenate([shaft, rod]), lines, points)  # pyright: ignore[reportArgumentType]
