"""The deflected line of beam elements between their nodes, by the element's own shape functions.

Deflections are cubics of the nodal deflections and rotations (Hermite's where nothing shears), stretch and twist are
linear. With the shear parameter phi they are those of Z. Friedman and J. B. Kosmatka, Comput. Struct. 47 (1993), eqs.
15-20, whose masses the element has.
"""

from __future__ import annotations

import numpy as np

from flexcam.fem.elements.beam import Beams
from flexcam.linalg import FloatArray

_ALL = slice(None)


def deflection(beams: Beams, nodal: FloatArray, parts: int, elements: slice = _ALL) -> FloatArray:
    """Return the motion of the line of every element at points between its nodes."""
    nodes, length = beams.nodes[elements], beams.length[elements, None]
    ends = nodal[..., nodes, :].reshape(*nodal.shape[:-2], len(nodes), 4, 3)
    local = np.einsum("eij,...ekj->...eki", beams.triads[elements], ends)
    (u1, t1), (u2, t2) = ((local[..., i, :], local[..., i + 1, :]) for i in (0, 2))
    x = np.linspace(0.0, 1.0, parts + 1)
    u, rx = ((1.0 - x) * first[..., :1] + x * second[..., :1] for first, second in ((u1, u2), (t1, t2)))
    v, rz = _bent(length, beams.phi_y[elements, None], x, (u1[..., 1:2], t1[..., 2:], u2[..., 1:2], t2[..., 2:]))
    w, ry = _bent(length, beams.phi_z[elements, None], x, (u1[..., 2:], -t1[..., 1:2], u2[..., 2:], -t2[..., 1:2]))
    return np.stack([u, v, w, rx, -ry, rz], axis=-1)


Ends = tuple[FloatArray, FloatArray, FloatArray, FloatArray]
"""Deflection and rotation at both ends, shape (..., e, 1) each."""


def _bent(L: FloatArray, phi: FloatArray, x: FloatArray, ends: Ends) -> tuple[FloatArray, FloatArray]:
    """Return deflection and rotation of the section in one plane, shape (..., e, len(x)) each."""
    v1, r1, v2, r2 = ends
    rise = (3.0 * x**2 - 2.0 * x**3 + phi * x) / (1.0 + phi)
    at_start = (x**3 - (2.0 + phi / 2.0) * x**2 + (1.0 + phi / 2.0) * x) / (1.0 + phi)
    at_end = (x**3 - (1.0 - phi / 2.0) * x**2 - phi / 2.0 * x) / (1.0 + phi)
    deflected = v1 + rise * (v2 - v1) + L * (at_start * r1 + at_end * r2)
    bump = 6.0 * (x - x**2) / (1.0 + phi)
    first = (3.0 * x**2 - (4.0 + phi) * x + 1.0 + phi) / (1.0 + phi)
    second = (3.0 * x**2 - (2.0 - phi) * x) / (1.0 + phi)
    return deflected, bump * (v2 - v1) / L + first * r1 + second * r2
