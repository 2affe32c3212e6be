"""Forces spread over members, as consistent loads of their elements."""

from __future__ import annotations

import numpy as np

from flexcam.fem.dofs import DofMap
from flexcam.fem.elements import beam
from flexcam.fem.elements.beam import Beams
from flexcam.linalg import FloatArray


def spread_force(beams: Beams, elements: slice, per_length: FloatArray) -> FloatArray:
    """Return the element loads of a force spread evenly over some elements.

    They do the same work as the spread force on the element's own (cubic) shapes: q L/2 at both ends and the
    fixed-end moments q L^2/12. Source: J. S. Przemieniecki, Theory of Matrix Structural Analysis (1968), sec. 7.2.
    """
    L = beams.length[elements]
    x, y, z = (beams.triads[elements] @ per_length).T
    zero = 0.0 * L
    half, moment = L / 2.0, L**2 / 12.0
    loads = np.zeros((len(beams), 12))
    first = [x * half, y * half, z * half, zero, -z * moment, y * moment]
    second = [x * half, y * half, z * half, zero, z * moment, -y * moment]
    loads[elements] = np.stack([*first, *second], axis=-1)
    return loads


def element_weight(beams: Beams, gravity: FloatArray) -> FloatArray:
    """Return the element loads of their own weight, the mass matrix times the acceleration."""
    pulled = beams.triads @ gravity
    still = np.zeros_like(pulled)
    return np.einsum("eij,ej->ei", beam.mass(beams), np.hstack([pulled, still, pulled, still]))


def gathered(beams: Beams, loads: FloatArray, dofs: DofMap) -> FloatArray:
    """Return the load vector of element loads."""
    turned = np.einsum("eji,ekj->eki", beams.triads, loads.reshape(-1, 4, 3)).ravel()
    numbers = dofs.numbers[beams.nodes].ravel()
    free = numbers >= 0
    return np.bincount(numbers[free], weights=turned[free], minlength=dofs.size).astype(float, copy=False)
