"""Assemble element matrices, all at once, into the matrix of the free components."""

from __future__ import annotations

import numpy as np

from flexcam.fem.dofs import DofMap
from flexcam.fem.elements import beam
from flexcam.fem.elements.beam import Beams
from flexcam.linalg import FloatArray, Triplets


def assemble(beams: Beams, local: FloatArray, dofs: DofMap) -> Triplets:
    """Return the matrix of the free components from element matrices in local axes.

    Parameters
    ----------
    beams
        The elements.
    local
        Element matrices, shape (e, 12, 12), local axes.
    dofs
        The numbering.

    Returns
    -------
    Triplets
        Size ``dofs.size``; exact zeros are left out.

    Examples
    --------
    >>> from flexcam.fem import Material, Member, Mesh, Section, beam, beams, dof_map
    >>> mesh = Mesh([[0, 0, 0], [2, 0, 0]], {"bar": [0, 1]}, {"root": [0]})
    >>> bar = beams(mesh, {"bar": Member(Material(E=1.0, nu=0.0, density=1.0), Section(A=4.0, Iy=1.0, Iz=1.0, J=1.0))})
    >>> dofs = dof_map(mesh, [("root", ["ux", "uy", "uz", "rx", "ry", "rz"])])
    >>> assemble(bar, beam.stiffness(bar), dofs).dense()[0, 0]
    np.float64(2.0)
    """
    matrices = beam.to_global(beams, local)
    unknowns = dofs.numbers[beams.nodes].reshape(-1, 12)
    rows = np.broadcast_to(unknowns[:, :, None], matrices.shape)
    cols = np.broadcast_to(unknowns[:, None, :], matrices.shape)
    keep = (matrices != 0.0) & (rows >= 0) & (cols >= 0)
    return Triplets(dofs.size, rows[keep], cols[keep], matrices[keep])


def stiffness(beams: Beams, dofs: DofMap) -> Triplets:
    """Return the assembled elastic stiffness, SI.

    Parameters
    ----------
    beams
        The elements.
    dofs
        The numbering.

    Returns
    -------
    Triplets
        Size ``dofs.size``.
    """
    return assemble(beams, beam.stiffness(beams), dofs)


def mass(beams: Beams, dofs: DofMap) -> Triplets:
    """Return the assembled mass of the beams, SI.

    Parameters
    ----------
    beams
        The elements.
    dofs
        The numbering.

    Returns
    -------
    Triplets
        Size ``dofs.size``.
    """
    return assemble(beams, beam.mass(beams), dofs)


def geometric(beams: Beams, axial_force: FloatArray, dofs: DofMap) -> Triplets:
    """Return the assembled geometric stiffness under given axial forces.

    Parameters
    ----------
    beams
        The elements.
    axial_force
        N, tension positive, shape (e,).
    dofs
        The numbering.

    Returns
    -------
    Triplets
        Size ``dofs.size``; added to the stiffness it stiffens in tension and softens in compression.
    """
    return assemble(beams, beam.geometric(beams, axial_force), dofs)
