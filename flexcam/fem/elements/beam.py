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

    Parameters
    ----------
    nodes
        Node numbers of both ends, shape (e, 2).
    length
        Lengths, m, shape (e,).
    triads
        Local axes as rows, shape (e, 3, 3): ``u_local = R u_global``.
    EA, GJ, EIy, EIz
        Rigidities, N and N m^2, shape (e,).
    rho_A, rho_Ip, rho_Iy, rho_Iz
        Mass (kg/m), polar and rotary inertia (kg m) per length, shape (e,). Switched-off rotary inertia is zero.
    phi_y, phi_z
        Shear parameters of bending in the x-y and x-z plane, shape (e,); zero without shear deformation.
    lumped
        1 where the mass is lumped, else 0, shape (e,).
    arched
        1 where axial force and bending are coupled, else 0, shape (e,).
    bow
        Initial slopes and rotations of such elements, see `arch`, shape (e, 6).

    Examples
    --------
    `flexcam.fem.members.beams` makes them from a mesh and its members.
    """

    nodes: IntArray
    length: FloatArray
    triads: FloatArray
    EA: FloatArray
    GJ: FloatArray
    EIy: FloatArray
    EIz: FloatArray
    rho_A: FloatArray
    rho_Ip: FloatArray
    rho_Iy: FloatArray
    rho_Iz: FloatArray
    phi_y: FloatArray
    phi_z: FloatArray
    lumped: FloatArray
    arched: FloatArray
    bow: FloatArray

    def __len__(self) -> int:
        return len(self.length)

    def part(self, index: slice | IntArray) -> Beams:
        """Return a subset of the elements."""
        return Beams(*(getattr(self, name)[index] for name in self.__dataclass_fields__))


def _place(bar: FloatArray, twist: FloatArray, xy: FloatArray, xz: FloatArray) -> FloatArray:
    full = np.zeros((len(xy), 12, 12))
    full[:, AXIAL[:, None], AXIAL] = bar
    full[:, TORSION[:, None], TORSION] = twist
    full[:, PLANE_XY[:, None], PLANE_XY] = xy
    full[:, PLANE_XZ[:, None], PLANE_XZ] = xz * _ROTATION_SIGNS
    return full


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
    consistent = bending.translational_mass(beams.rho_A, beams.length, phi)
    consistent += bending.rotary_mass(rho_I, beams.length, phi)
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


def to_global(beams: Beams, local: FloatArray) -> FloatArray:
    """Return element matrices transformed from local to global axes, ``T^T k T``.

    Parameters
    ----------
    beams
        The elements.
    local
        Shape (e, 12, 12), local axes.

    Returns
    -------
    ndarray
        Shape (e, 12, 12), global axes.
    """
    rows_turned = _rotate_rows(beams, local)
    return _rotate_rows(beams, rows_turned.swapaxes(1, 2)).swapaxes(1, 2)


def _rotate_rows(beams: Beams, matrices: FloatArray) -> FloatArray:
    """Return ``T^T m``; each group of three rows is a vector at one end."""
    back = np.swapaxes(beams.triads, -1, -2)[:, None]
    return (back @ matrices.reshape(-1, 4, 3, 12)).reshape(-1, 12, 12)


def axial_force(beams: Beams, nodal: FloatArray) -> FloatArray:
    """Return the axial force of every element from nodal displacements.

    Parameters
    ----------
    beams
        The elements.
    nodal
        Displacements in global axes, shape (nodes, 6), m and rad.

    Returns
    -------
    ndarray
        N, tension positive, shape (e,).
    """
    stretch = nodal[beams.nodes[:, 1], :3] - nodal[beams.nodes[:, 0], :3]
    return beams.EA / beams.length * np.sum(stretch * beams.triads[:, 0], axis=1)
