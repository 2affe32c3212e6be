"""Plane outlines and the simple bodies made of them: cylinders, rings, turned parts, balls, prisms."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from flexcam.fem import Section
from flexcam.fem.frames import default_orientation
from flexcam.linalg import FloatArray
from flexcam.scene.solid import Solid, loft

AROUND = 32
"""Points of a circle: a round bar then has 99.4 % of its volume."""


def circle(radius: float, count: int = AROUND) -> FloatArray:
    """Return points of a circle about the origin, counterclockwise."""
    turn = 2.0 * math.pi * np.arange(count) / count
    return radius * np.column_stack([np.cos(turn), np.sin(turn)])


def section_outlines(section: Section) -> list[FloatArray]:
    """Return the outline of a cross-section in its local y and z axes, and that of its hole."""
    if section.round:
        inner = math.sqrt(max(section.radius**2 - section.A / math.pi, 0.0))
        hollow = inner > 1e-6 * section.radius
        return [circle(section.radius), *([circle(inner)] if hollow else [])]
    high = math.sqrt(section.A * math.sqrt(section.Iz / section.Iy))
    corner = 0.5 * np.array([high, section.A / high])
    return [corner * np.array([[1, 1], [-1, 1], [-1, -1], [1, -1]])]


def capsule(start: complex, end: complex, radii: tuple[float, float]) -> FloatArray:
    """Return the outline around two circles and their outer tangents, counterclockwise."""
    span = end - start
    open_by = math.acos(max(-1.0, min(1.0, (radii[0] - radii[1]) / abs(span))))
    half = AROUND // 2
    about = span / abs(span)
    near = start + radii[0] * about * np.exp(1j * np.linspace(open_by, 2.0 * math.pi - open_by, half))
    far = end + radii[1] * about * np.exp(1j * np.linspace(-open_by, open_by, half))
    outline = np.concatenate([near, far])
    return np.column_stack([outline.real, outline.imag])


def across(axis: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return two unit vectors that make a right-handed triad with an axis, the axis last."""
    near = default_orientation(axis)
    first = near - (near @ axis) * axis
    first = first / np.linalg.norm(first)
    return first, np.cross(axis, first)


def turned(kind: str, centre: FloatArray, axis: FloatArray, profile: Sequence[tuple[float, float]]) -> Solid:
    """Return a body of revolution."""
    first, second = across(axis)
    ring = circle(1.0) @ np.array([first, second])
    return loft(kind, np.array([centre + x * axis + radius * ring for x, radius in profile]))


def cylinder(kind: str, start: FloatArray, end: FloatArray, radius: float) -> Solid:
    """Return a round bar between two points."""
    span = end - start
    length = float(np.linalg.norm(span))
    return turned(kind, start, span / length, [(0.0, radius), (length, radius)])


def ring(kind: str, centre: FloatArray, axis: FloatArray, radii: tuple[float, float], width: float) -> Solid:
    """Return a ring of rectangular section."""
    first, second = across(axis)
    spokes = circle(1.0) @ np.array([first, second])
    inner, outer = radii
    corners = [(inner, -0.5), (inner, 0.5), (outer, 0.5), (outer, -0.5)]
    return loft(kind, np.array([[centre + r * spoke + x * width * axis for r, x in corners] for spoke in spokes]),
                cyclic=True)  # fmt: skip


def ball(kind: str, centre: FloatArray, radius: float) -> Solid:
    """Return a ball."""
    tilt = np.linspace(0.05, math.pi - 0.05, 17)
    pairs = zip((-radius * np.cos(tilt)).tolist(), (radius * np.sin(tilt)).tolist(), strict=True)
    return turned(kind, centre, np.array([0.0, 1.0, 0.0]), list(pairs))


def prism(kind: str, outline: FloatArray, plane: FloatArray, centre: FloatArray, width: float) -> Solid:
    """Return an outline with thickness."""
    flat, normal = centre + outline @ plane, np.cross(plane[0], plane[1])
    return loft(kind, np.array([flat - 0.5 * width * normal, flat + 0.5 * width * normal]))
