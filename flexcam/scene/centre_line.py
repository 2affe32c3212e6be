"""The deformed centre line of a member: the element's own shape functions between its nodes.

Deflections are cubics of the nodal deflections and rotations (Hermite's where nothing shears), stretch and twist are
linear. With the shear parameter phi they are those of Z. Friedman and J. B. Kosmatka, Comput. Struct. 47 (1993), eqs.
15-20, whose masses the element has.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from flexcam.fem import Beams
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
    """Return the deformed centre line of a chain of elements.

    Parameters
    ----------
    beams
        All elements.
    elements
        Those of the member, in order.
    nodes
        Coordinates of all nodes, m, shape (nodes, 3).
    nodal
        Their displacements as drawn, shape (nodes, 6), global axes, m and rad.
    parts
        Stations per element.

    Returns
    -------
    CentreLine
        With ``parts`` times the elements, plus one, stations.

    Examples
    --------
    `flexcam.scene.assembly` draws every member so.
    """
    ends, triads = beams.nodes[elements], beams.triads[elements]
    local = nodal[ends].reshape(len(ends), 4, 3) @ np.swapaxes(triads, 1, 2)  # displacement, rotation; both ends
    x = np.arange(parts) / parts
    pieces = [_stations(beams, elements, local, x), _stations(beams, elements, local, np.ones(1))]
    moved, rotated = (np.concatenate([a.reshape(-1, 3), b[-1]]) for a, b in zip(*pieces, strict=True))
    own = np.append(np.repeat(np.arange(len(ends)), parts), len(ends) - 1)
    part = np.append((np.arange(len(ends))[:, None] + x).ravel(), len(ends))
    along = (part - own)[:, None]
    start, end = nodes[ends[own, 0]], nodes[ends[own, 1]]
    straight = (1.0 - along) * start + along * end
    back = triads[own]
    points = straight + np.einsum("ni,nij->nj", moved, back)
    axes = back @ turn(np.einsum("ni,nij->nj", rotated, back))
    return CentreLine(points, axes, part)


def _stations(beams: Beams, elements: slice, local: FloatArray, x: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return displacement and rotation at parts x of every element, shape (e, len(x), 3), local axes."""
    L = beams.length[elements, None]
    (u1, t1), (u2, t2) = ((local[:, i], local[:, i + 1]) for i in (0, 2))
    linear = (1.0 - x) * u1[:, :1] + x * u2[:, :1], (1.0 - x) * t1[:, :1] + x * t2[:, :1]
    v, rz = _bent(L, beams.phi_y[elements, None], x, (u1[:, 1:2], t1[:, 2:], u2[:, 1:2], t2[:, 2:]))
    w, ry = _bent(L, beams.phi_z[elements, None], x, (u1[:, 2:], -t1[:, 1:2], u2[:, 2:], -t2[:, 1:2]))
    return np.stack([linear[0], v, w], axis=-1), np.stack([linear[1], -ry, rz], axis=-1)


Ends = tuple[FloatArray, FloatArray, FloatArray, FloatArray]
"""Deflection and rotation at both ends, shape (e, 1) each."""


def _bent(L: FloatArray, phi: FloatArray, x: FloatArray, ends: Ends) -> tuple[FloatArray, FloatArray]:
    """Return deflection and rotation of the section in one plane, shape (e, len(x)) each."""
    v1, r1, v2, r2 = ends
    rise = (3.0 * x**2 - 2.0 * x**3 + phi * x) / (1.0 + phi)
    at_start = (x**3 - (2.0 + phi / 2.0) * x**2 + (1.0 + phi / 2.0) * x) / (1.0 + phi)
    at_end = (x**3 - (1.0 - phi / 2.0) * x**2 - phi / 2.0 * x) / (1.0 + phi)
    deflection = v1 + rise * (v2 - v1) + L * (at_start * r1 + at_end * r2)
    bump = 6.0 * (x - x**2) / (1.0 + phi)
    first = (3.0 * x**2 - (4.0 + phi) * x + 1.0 + phi) / (1.0 + phi)
    second = (3.0 * x**2 - (2.0 - phi) * x) / (1.0 + phi)
    return deflection, bump * (v2 - v1) / L + first * r1 + second * r2


def turn(vectors: FloatArray) -> FloatArray:
    """Return rotations by vectors, by Rodrigues' formula: rows of the result are the turned axes.

    Parameters
    ----------
    vectors
        Axis times angle, rad, shape (n, 3).

    Returns
    -------
    ndarray
        Shape (n, 3, 3); ``rows @ turn(v)`` turns row vectors.

    Examples
    --------
    >>> (np.array([1.0, 0.0, 0.0]) @ turn(np.array([[0.0, 0.0, np.pi / 2.0]]))[0]).round(12) + 0.0
    array([0., 1., 0.])
    """
    angle = np.linalg.norm(vectors, axis=1)[:, None, None]
    x, y, z = vectors.T
    nothing = np.zeros_like(x)
    cross = np.moveaxis(np.array([[nothing, z, -y], [-z, nothing, x], [y, -x, nothing]]), -1, 0)
    return np.eye(3) + np.sinc(angle / np.pi) * cross + 0.5 * np.sinc(0.5 * angle / np.pi) ** 2 * cross @ cross


def swept(outline: FloatArray, line: CentreLine) -> FloatArray:
    """Return the rings of an outline that is carried along a centre line.

    Parameters
    ----------
    outline
        In local y and z, m, shape (k, 2).
    line
        The centre line.

    Returns
    -------
    ndarray
        Shape (m, k, 3), m.
    """
    return line.points[:, None] + outline @ line.triads[:, 1:]
