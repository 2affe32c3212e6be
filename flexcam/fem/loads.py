"""Consistent load vectors: forces spread over members, and the weight of everything."""

from __future__ import annotations

import numpy as np

from flexcam.fem.dofs import DofMap
from flexcam.fem.elements.beam import Beams
from flexcam.linalg import FloatArray


def line_load(beams: Beams, elements: slice, per_length: FloatArray, dofs: DofMap) -> FloatArray:
    """Return the load vector of a force spread evenly over some elements.

    The nodal loads do the same work as the spread force on the element's own (cubic) shapes: q L/2 at both ends and
    the fixed-end moments q L^2/12. Source: J. S. Przemieniecki, Theory of Matrix Structural Analysis (1968), sec. 7.2.

    Parameters
    ----------
    beams
        The elements.
    elements
        Which of them carry the force.
    per_length
        Force per length, N/m, shape (3,), global axes.
    dofs
        The numbering.

    Returns
    -------
    ndarray
        Shape (n,), N and N m.

    Examples
    --------
    >>> from flexcam.fem import Material, Member, Mesh, Section, beams, dof_map
    >>> mesh = Mesh([[0, 0, 0], [2, 0, 0]], {"bar": [0, 1]}, {})
    >>> bar = beams(mesh, {"bar": Member(Material(E=1.0, nu=0.0, density=1.0), Section.circle(1.0))})
    >>> line_load(bar, slice(0, 1), np.array([0.0, 3.0, 0.0]), dof_map(mesh, []))[[1, 5, 7, 11]]
    array([ 3.,  1.,  3., -1.])
    """
    L = beams.length[elements]
    x, y, z = (beams.triads[elements] @ per_length).T
    zero = 0.0 * L
    half, moment = L / 2.0, L**2 / 12.0
    first = [x * half, y * half, z * half, zero, -z * moment, y * moment]
    second = [x * half, y * half, z * half, zero, z * moment, -y * moment]
    local = np.stack([*first, *second], axis=-1).reshape(-1, 4, 3)
    turned = np.einsum("eji,ekj->eki", beams.triads[elements], local).reshape(-1, 12)
    return _gathered(turned, dofs.numbers[beams.nodes[elements]].reshape(-1, 12), dofs.size)


def _gathered(values: FloatArray, numbers: np.ndarray[tuple[int, int], np.dtype[np.intp]], size: int) -> FloatArray:
    free = numbers >= 0
    return np.bincount(numbers[free], weights=values[free], minlength=size).astype(float, copy=False)
