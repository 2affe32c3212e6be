"""Solids as lofts: rings of points connected by triangles, used for all solids of a scene."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from flexcam.core import ComplexArray, FloatArray, IntArray
from flexcam.fem.dofs import default_orientation
from flexcam.fem.sections import Section, Taper

# Colours by kind of part: those of Okabe and Ito for moving parts
COLOURS = {
    "shaft": "#7a8fa6", "member": "#c9ced4", "lobe": "#D55E00", "follower": "#E69F00", "roller": "#F0C25A",
    "rocker": "#0072B2", "pivot": "#33414e", "spring": "#009E73", "retainer": "#5b6b78", "valve": "#CC79A7",
    "seat": "#33414e", "bearing": "#4d5a66", "ground": "#4d5a66", "drive": "#56B4E9", "mass": "#b08d57",
}  # fmt: skip

NEUTRAL_COLOUR = "#d5d9dd"  # colour of parts without a value if members are coloured by one
OPACITIES = {"bearing": 0.45, "seat": 0.6, "ground": 0.8}


@dataclass(frozen=True, eq=False)
class Solid:
    """Closed surface of triangles with outward normals."""

    kind: str  # kind of part, such as ``"lobe"``: parts of a kind share their colour
    points: FloatArray  # points, m, global axes, shape (n, 3)
    faces: IntArray  # point indices of the triangles, counterclockwise seen from outside, shape (t, 3)
    values: FloatArray | None = None  # colour values by point, shape (n,); None if there are none
    name: str = ""  # name of the part in the case


def loft(kind: str, rings: FloatArray, *, cyclic: bool = False, values: FloatArray | None = None) -> Solid:
    """Return the solid spanned by rings of points."""
    count, around = rings.shape[:2]
    points, index = rings.reshape(-1, 3), np.repeat(np.arange(len(rings)), around)
    if not cyclic:
        points, index = np.concatenate([points, rings[[0, -1]].mean(axis=1)]), np.append(index, [0, count - 1])
    return Solid(kind, points, _loft_faces(count, around, cyclic), None if values is None else values[index])


@lru_cache(maxsize=256)
def _loft_faces(count: int, around: int, cyclic: bool) -> IntArray:
    """Return the triangles between rings and those of the end faces."""
    here = np.arange(count if cyclic else count - 1)[:, None] * around
    there = (here + around) % (count * around)
    i, j = np.arange(around), (np.arange(around) + 1) % around
    sides = [[here + i, here + j, there + j], [here + i, there + j, there + i]]
    faces = [np.stack(side, axis=-1).reshape(-1, 3) for side in sides]
    if not cyclic:
        last, middle = (count - 1) * around, np.full(around, count * around)
        faces += [np.column_stack([middle, j, i]), np.column_stack([middle + 1, last + i, last + j])]
    skin = np.concatenate(faces)
    skin.setflags(write=False)
    return skin


CIRCLE_POINTS = 32  # points of a circle: a round bar then has 99.4 % of its volume


def circle(radius: float, count: int = CIRCLE_POINTS) -> FloatArray:
    """Return points of a circle about the origin, counterclockwise."""
    return radius * plane_points(np.exp(2j * math.pi * np.arange(count) / count))


def plane_points(outline: ComplexArray) -> FloatArray:
    """Return points of the complex plane as pairs of numbers."""
    return np.column_stack([outline.real, outline.imag])


def section_outlines(section: Section) -> list[FloatArray]:
    """Return the outline of a cross-section in its local y and z axes, and that of its hole."""
    if section.round:
        inner = math.sqrt(max(section.radius**2 - section.A / math.pi, 0.0))
        hollow = inner > 1e-6 * section.radius
        return [circle(section.radius), *([circle(inner)] if hollow else [])]
    high = math.sqrt(section.A * math.sqrt(section.Iz / section.Iy))
    corner = 0.5 * np.array([high, section.A / high])
    return [corner * np.array([[1, 1], [-1, 1], [-1, -1], [1, -1]])]


def member_outlines(section: Section | Taper, shares: FloatArray) -> list[FloatArray]:
    """Return the outlines of a member at shares of its length: shape (points, 2), or (shares, points, 2) if tapered."""
    if isinstance(section, Section):
        return section_outlines(section)
    rings = [section_outlines(section.at(share)) for share in shares.tolist()]
    return [np.array(outline) for outline in zip(*rings, strict=False)]


def capsule(start: complex, end: complex, radii: tuple[float, float]) -> FloatArray:
    """Return the outline of two circles and their outer tangents, counterclockwise."""
    span = end - start
    open_by = math.acos(max(-1.0, min(1.0, (radii[0] - radii[1]) / abs(span))))
    half = CIRCLE_POINTS // 2
    about = span / abs(span)
    near = start + radii[0] * about * np.exp(1j * np.linspace(open_by, 2.0 * math.pi - open_by, half))
    far = end + radii[1] * about * np.exp(1j * np.linspace(-open_by, open_by, half))
    return plane_points(np.concatenate([near, far]))


def unit_vector(vector: FloatArray) -> FloatArray:
    """Return the unit vector along a vector."""
    return vector[:3] / np.linalg.norm(vector[:3])


def perpendicular_axes(axis: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return two unit vectors that form a right-handed triad with an axis, the axis last."""
    near = default_orientation(axis)
    first = near - (near @ axis) * axis
    first = first / np.linalg.norm(first)
    return first, np.cross(axis, first)


def revolve(
    kind: str, centre: FloatArray, axis: FloatArray, profile: Sequence[tuple[float, float]], *, cyclic: bool = False
) -> Solid:
    """Return a body of revolution; a cyclic profile is closed."""
    ring = circle(1.0) @ np.array(perpendicular_axes(axis))
    return loft(kind, np.array([centre + x * axis + radius * ring for x, radius in profile]), cyclic=cyclic)


def cylinder(kind: str, start: FloatArray, end: FloatArray, radius: float) -> Solid:
    """Return a cylinder between two points."""
    span = end - start
    length = float(np.linalg.norm(span))
    return revolve(kind, start, span / length, [(0.0, radius), (length, radius)])


def ring(kind: str, centre: FloatArray, axis: FloatArray, radii: tuple[float, float], width: float) -> Solid:
    """Return a ring of rectangular cross-section."""
    (inner, outer), half = radii, 0.5 * width
    corners = [(-half, outer), (half, outer), (half, inner), (-half, inner)]
    return revolve(kind, centre, axis, corners, cyclic=True)


def ball(kind: str, centre: FloatArray, radius: float) -> Solid:
    """Return a sphere."""
    profile = [(-radius * math.cos(tilt), radius * math.sin(tilt)) for tilt in np.linspace(0.05, math.pi - 0.05, 17)]
    return revolve(kind, centre, np.array([0.0, 1.0, 0.0]), profile)


def prism(kind: str, outline: FloatArray, plane: FloatArray, centre: FloatArray, width: float) -> Solid:
    """Return an extruded outline."""
    flat, reach = centre + outline @ plane, 0.5 * width * np.cross(plane[0], plane[1])
    return loft(kind, np.array([flat - reach, flat + reach]))
