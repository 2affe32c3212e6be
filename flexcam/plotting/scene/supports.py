"""Symbols of bearings, guides and drives."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING

import numpy as np

from flexcam.core import FloatArray, IntArray
from flexcam.fem.frames import COMPONENTS
from flexcam.plotting.scene.solids import Solid, circle, perpendicular_axes, prism, ring
from flexcam.plotting.scene.trains import is_bearing, shafts
from flexcam.valvetrain import Model

if TYPE_CHECKING:
    from flexcam.plotting.scene.instant import SceneState
    from flexcam.plotting.scene.layout import Layout

_TEETH = 20


def support_solids(model: Model, layout: Layout, instant: SceneState) -> Iterator[Solid]:
    """Yield the symbols of supports."""
    bearings = {model.mesh.node(one.at) for one in model.springs.values() if is_bearing(model, one)}
    held = _fixed_components(model)
    turning = shafts(model)
    faces = {model.mesh.node(c.contact.follower) for c in layout.cams if c.ahead}
    for name, line in model.mesh.lines.items():
        radius = model.members[name].section.radius
        for place, node in enumerate(line.tolist()):
            axis = _tangent(model, line, place)
            where = model.mesh.nodes[node]
            kept = held.get(node, np.zeros(6, dtype=bool))
            driven = name in turning and float(np.abs(kept[3:] * axis).max()) > 0.5
            if driven:
                yield _wheel(where, axis, 2.4 * radius, instant.angle, _sense(layout, axis))
            if kept.all():
                yield _wall(where, axis, 2.0 * radius)
            elif (node in bearings or _fixes_transverse(kept, axis)) and node not in faces and not driven:
                yield ring("bearing", where, axis, (1.02 * radius, 1.6 * radius), 1.1 * radius)


def _fixed_components(model: Model) -> dict[int, FloatArray]:
    """Return the fixed components of every supported node, shape (6,) each."""
    held: dict[int, FloatArray] = {}
    for point, names in model.supports.items():
        for node in model.mesh.points[point].tolist():
            own = np.array([name in names for name in COMPONENTS])
            held[node] = held.get(node, np.zeros(6, dtype=bool)) | own
    return held


def _fixes_transverse(kept: FloatArray, axis: FloatArray) -> bool:
    """Return whether both translations perpendicular to an axis are fixed."""
    first, second = perpendicular_axes(axis)
    free = ~kept[:3].astype(bool)
    return not (np.abs(first[free]).max(initial=0.0) > 0.3 or np.abs(second[free]).max(initial=0.0) > 0.3)


def _tangent(model: Model, line: IntArray, place: int) -> FloatArray:
    before, after = max(place - 1, 0), min(place + 1, len(line) - 1)
    span = model.mesh.nodes[line[after]] - model.mesh.nodes[line[before]]
    return span / np.linalg.norm(span)


def _sense(layout: Layout, axis: FloatArray) -> float:
    return next((float(np.sign(one.frame.axis @ axis)) for one in layout.cams), 1.0)


def _wall(where: FloatArray, axis: FloatArray, half: float) -> Solid:
    """Return a plate for a clamped member."""
    corners = half * np.array([[1, 1], [-1, 1], [-1, -1], [1, -1]])
    return prism("ground", corners, np.array(perpendicular_axes(axis)), where, 0.4 * half)


def _wheel(where: FloatArray, axis: FloatArray, radius: float, angle: float, sense: float) -> Solid:
    """Return a toothed wheel that rotates with the shaft."""
    first, second = perpendicular_axes(axis)
    teeth = np.where(np.arange(4 * _TEETH) % 4 < 2, 1.0, 0.9)[:, None] * circle(radius, 4 * _TEETH)
    c, s = np.cos(sense * angle), np.sin(sense * angle)
    return prism("drive", teeth, np.array([c * first + s * second, c * second - s * first]), where, 0.35 * radius)
