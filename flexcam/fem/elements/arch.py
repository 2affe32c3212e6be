"""Shallow arch: beam element with coupled axial force and bending.

Seven deformation parameters describe the element: the elongation D of its chord, and in each plane the slope of the
chord and both end rotations, y. With one axial strain its axial energy is ``EA/(2 L) e^2``, ``e = D + 1/2 y^T g (y + 2
y0)``: bending shortens the chord by half the integral of v'^2, y0 is an initial bow, g the geometric stiffness under a
unit force. M. A. Crisfield, Non-linear Finite Element Analysis of Solids and Structures 1 (1991), sec. 7.1 and 7.2.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from flexcam.core import FloatArray, IntArray
from flexcam.fem.elements import bending
from flexcam.fem.elements.beam import PLANE_XY, PLANE_XZ, Beams

SCALARS = 7
"""Deformation parameters per element: elongation, then chord slope and both end rotations in both planes."""


def deformation_matrix(beams: Beams, elements: IntArray) -> FloatArray:
    """Return the matrix from the twelve local components to the seven deformation parameters.

    Parameters
    ----------
    beams
        All elements.
    elements
        Selected elements, shape (e,).

    Returns
    -------
    ndarray
        Shape (e, 7, 12).
    """
    L = beams.length[elements]
    D = np.zeros((len(L), SCALARS, 12))
    D[:, 0, 0], D[:, 0, 6] = -1.0, 1.0
    for first, plane, sign in ((1, PLANE_XY, 1.0), (4, PLANE_XZ, -1.0)):
        D[:, first, plane[0]], D[:, first, plane[2]] = -1.0 / L, 1.0 / L
        D[:, first + 1, plane[1]] = D[:, first + 2, plane[3]] = sign
    return D


@dataclass(frozen=True, eq=False)
class Arch:
    """Shallow arch elements in terms of their seven deformation parameters.

    Examples
    --------
    >>> arch = Arch(np.ones(1), np.eye(6)[None], np.zeros((1, 6)))
    >>> arch.forces(np.array([[0.5, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0]]))
    array([[0.5, 1. , 0. , 0. , 0. , 0. , 0. ]])
    """

    axial: FloatArray  #: EA/L, N/m, shape (e,)
    shortening: FloatArray  #: g over slopes and rotations of both planes, m, shape (e, 6, 6)
    bow: FloatArray  #: y0, shape (e, 6)

    @classmethod
    def of(cls, beams: Beams, elements: IntArray) -> Arch:
        """Return the arches of selected elements, shape (e,)."""
        L = beams.length[elements]
        from_chord = np.zeros((len(L), 4, 3))  # v1 = 0, rotation 1, v2, rotation 2
        from_chord[:, 1, 1] = from_chord[:, 3, 2] = 1.0
        from_chord[:, 2, 0] = L
        g = np.zeros((len(L), 6, 6))
        for first, phi in ((0, beams.phi_y), (3, beams.phi_z)):
            matrix = bending.geometric(np.ones(len(L)), L, phi[elements])
            g[:, first : first + 3, first : first + 3] = np.swapaxes(from_chord, 1, 2) @ matrix @ from_chord
        return cls(beams.EA[elements] / L, g, beams.bow[elements])

    def forces(self, values: FloatArray) -> FloatArray:
        """Return the forces beyond those of the linear bar and beam, shape (..., e, 7), for that shape.

        The same as `flexcam.dynamics.force_laws.arch`, for all instants and elements at once.
        """
        y, forces = values[..., 1:], np.empty_like(values)
        gradient = np.einsum("eij,...ej->...ei", self.shortening, y + self.bow)
        start = np.einsum("eij,ej->ei", self.shortening, self.bow)
        # y.g.(y + 2 y0): the difference of both squares would leave rounding at zero bending.
        forces[..., 0] = 0.5 * self.axial * np.sum(y * (gradient + start), axis=-1)
        forces[..., 1:] = (self.axial * values[..., 0] + forces[..., 0])[..., None] * gradient
        return forces
