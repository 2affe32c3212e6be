"""The deformed centre line of a member, with the axes of its sections."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from flexcam.fem import Beams
from flexcam.fem.deflection import deflection
from flexcam.linalg import FloatArray

PARTS = 8
"""Parts an element is drawn with."""


@dataclass(frozen=True, eq=False)
class CentreLine:
    """Stations along a member.

    Parameters
    ----------
    points
        m, global axes, shape (m, 3).
    triads
        Axes of the section as rows, x along the member, shape (m, 3, 3).
    part
        Place in units of elements from the member's first node, shape (m,): 1.5 is the middle of the second element.
    """

    points: FloatArray
    triads: FloatArray
    part: FloatArray


def centre_line(beams: Beams, elements: slice, nodes: FloatArray, nodal: FloatArray, parts: int = PARTS) -> CentreLine:
    """Return the deformed centre line of a chain of elements."""
    ends, triads = beams.nodes[elements], beams.triads[elements]
    bent = deflection(beams, nodal, parts, elements)
    moved, rotated = np.hsplit(np.concatenate([bent[:, :-1].reshape(-1, 6), bent[-1, -1:]]), 2)
    x = np.arange(parts) / parts
    own = np.append(np.repeat(np.arange(len(ends)), parts), len(ends) - 1)
    part = np.append((np.arange(len(ends))[:, None] + x).ravel(), len(ends))
    along = (part - own)[:, None]
    start, end = nodes[ends[own, 0]], nodes[ends[own, 1]]
    straight = (1.0 - along) * start + along * end
    back = triads[own]
    points = straight + np.einsum("ni,nij->nj", moved, back)
    axes = back @ turn(np.einsum("ni,nij->nj", rotated, back))
    return CentreLine(points, axes, part)


def turn(vectors: FloatArray) -> FloatArray:
    """Return rotations by vectors, by Rodrigues' formula: rows of the result are the turned axes."""
    angle = np.linalg.norm(vectors, axis=1)[:, None, None]
    x, y, z = vectors.T
    nothing = np.zeros_like(x)
    cross = np.moveaxis(np.array([[nothing, z, -y], [-z, nothing, x], [y, -x, nothing]]), -1, 0)
    return np.eye(3) + np.sinc(angle / np.pi) * cross + 0.5 * np.sinc(0.5 * angle / np.pi) ** 2 * cross @ cross


def swept(outline: FloatArray, line: CentreLine) -> FloatArray:
    """Return the rings of an outline that is carried along a centre line."""
    return line.points[:, None] + outline @ line.triads[:, 1:]
