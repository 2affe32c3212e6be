"""Beam element with 12 degrees of freedom in space: bar, torsion bar and bending in two planes.

Local order: ux uy uz rx ry rz at node 1, then at node 2. In the x-y plane the rotation is rz = dv/dx; in the x-z plane
ry = -dw/dx, so that plane uses the same bending element with the signs of its rotations reversed.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from flexcam.core import FloatArray, IntArray
from flexcam.fem.elements import bending

AXIAL = np.array([0, 6])
TORSION = np.array([3, 9])
PLANE_XY = np.array([1, 5, 7, 11])
PLANE_XZ = np.array([2, 4, 8, 10])
_ROTATION_SIGNS = np.outer([1.0, -1.0, 1.0, -1.0], [1.0, -1.0, 1.0, -1.0])


@dataclass(frozen=True, eq=False)
class Beams:
    """Properties of e straight beam elements, every field an array over the elements.

    Examples
    --------
    `flexcam.fem.assembly.beams` makes them from a mesh and its members.
    """

    nodes: IntArray  #: node numbers of both ends, shape (e, 2)
    length: FloatArray  #: lengths, m, shape (e,)
    triads: FloatArray  #: local axes as rows, shape (e, 3, 3): ``u_local = R u_global``
    #: `EA`, `GJ`, `EIy`, `EIz`: rigidities, N and N m^2, shape (e,)
    EA: FloatArray
    GJ: FloatArray
    EIy: FloatArray
    EIz: FloatArray
    #: `rho_A`, `rho_Ip`, `rho_Iy`, `rho_Iz`: mass (kg/m), polar and rotary inertia (kg m) per length, shape (e,).
    #: Switched-off rotary inertia is zero.
    rho_A: FloatArray
    rho_Ip: FloatArray
    rho_Iy: FloatArray
    rho_Iz: FloatArray
    #: `phi_y`, `phi_z`: shear parameters of bending in the x-y and x-z plane, shape (e,); zero without shear
    #: deformation
    phi_y: FloatArray
    phi_z: FloatArray
    lumped: FloatArray  #: 1 where the mass is lumped, else 0, shape (e,)
    arched: FloatArray  #: 1 where axial force and bending are coupled, else 0, shape (e,)
    bow: FloatArray  #: initial slopes and rotations of such elements, see `arch`, shape (e, 6)
    thermal: FloatArray  #: compression if both ends are fixed, ``EA alpha dT``, N, shape (e,)

    def __len__(self) -> int:
        return len(self.length)

    def part(self, index: slice | IntArray) -> Beams:
        """Return a subset of the elements."""
        return Beams(*(getattr(self, name)[index] for name in self.__dataclass_fields__))


def _place(bar: FloatArray, twist: FloatArray, xy: FloatArray, xz: FloatArray) -> FloatArray:
    matrix = np.zeros((len(xy), 12, 12))
    matrix[:, AXIAL[:, None], AXIAL] = bar
    matrix[:, TORSION[:, None], TORSION] = twist
    matrix[:, PLANE_XY[:, None], PLANE_XY] = xy
    matrix[:, PLANE_XZ[:, None], PLANE_XZ] = xz * _ROTATION_SIGNS
    return matrix


def stiffness(beams: Beams) -> FloatArray:
    """Return the elastic stiffness of every element.

    Parameters
    ----------
    beams
        The elements.

    Returns
    -------
    ndarray
        Shape (e, 12, 12), local axes, SI.
    """
    return _place(
        bending.bar_stiffness(beams.EA, beams.length),
        bending.bar_stiffness(beams.GJ, beams.length),
        bending.stiffness(beams.EIz, beams.length, beams.phi_y),
        bending.stiffness(beams.EIy, beams.length, beams.phi_z),
    )


def mass(beams: Beams) -> FloatArray:
    """Return the mass matrix of every element, consistent or lumped.

    Parameters
    ----------
    beams
        The elements.

    Returns
    -------
    ndarray
        Shape (e, 12, 12), local axes, SI.
    """
    return _place(
        bending.bar_mass(beams.rho_A, beams.length, beams.lumped),
        bending.bar_mass(beams.rho_Ip, beams.length, beams.lumped),
        _bending_mass(beams, beams.rho_Iz, beams.phi_y),
        _bending_mass(beams, beams.rho_Iy, beams.phi_z),
    )


def _bending_mass(beams: Beams, rho_I: FloatArray, phi: FloatArray) -> FloatArray:
    consistent = bending.consistent_mass(beams.rho_A, rho_I, beams.length, phi)
    lumped = bending.lumped_mass(beams.rho_A, rho_I, beams.length)
    return np.where(beams.lumped[:, None, None] > 0.0, lumped, consistent)


def geometric(beams: Beams, axial_force: FloatArray) -> FloatArray:
    """Return the geometric stiffness of every element under an axial force.

    Parameters
    ----------
    beams
        The elements.
    axial_force
        N, tension positive, shape (e,).

    Returns
    -------
    ndarray
        Shape (e, 12, 12), local axes, N/m.
    """
    nothing = np.zeros((len(beams), 2, 2))
    xy, xz = (bending.geometric(axial_force, beams.length, phi) for phi in (beams.phi_y, beams.phi_z))
    return _place(nothing, nothing, xy, xz)
