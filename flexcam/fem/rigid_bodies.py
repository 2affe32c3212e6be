"""Concentrated masses with offset, springs and dampers, and rigid-body motions."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from flexcam.core import FloatArray, IntArray, Triplets
from flexcam.core.errors import finite_array, positive, refuse
from flexcam.fem.dofs import DofMap, rigid_motions
from flexcam.fem.mesh import Mesh


@dataclass(frozen=True)
class PointMass:
    """Rigid body fixed to a node.

    Parameters
    ----------
    mass
        kg.
    inertia
        Moments about axes through the body's centre parallel to the global ones, kg m^2.
    offset
        From the node to the centre of mass, m, global axes.
    products
        Products of inertia about the same axes: the integrals of xy, xz and yz over the mass, kg m^2.

    Raises
    ------
    InputError
        If a mass or a moment is negative, or the principal moments violate the triangle inequality of rigid bodies.

    Examples
    --------
    >>> PointMass(2.0, offset=(0.0, 0.0, 0.5)).matrix()[3, 3]
    np.float64(0.5)
    """

    mass: float
    inertia: tuple[float, float, float] = (0.0, 0.0, 0.0)
    offset: tuple[float, float, float] = (0.0, 0.0, 0.0)
    products: tuple[float, float, float] = (0.0, 0.0, 0.0)

    def __post_init__(self) -> None:
        positive("mass", self.mass, "kg", zero=True)
        for axis, value in zip("xyz", self.inertia, strict=True):
            positive(f"inertia {axis}", value, "kg m^2", zero=True)
        if 2.0 * max(self.inertia) > sum(self.inertia) * (1.0 + 1e-9):
            why = "no body has a moment of inertia above the sum of the other two"
            raise refuse("inertia", list(self.inertia), "each moment up to the sum of the others", why)
        finite_array("offset", self.offset, (3,))
        finite_array("products", self.products, (3,))
        if any(self.products):
            principal = np.linalg.eigvalsh(self.tensor)
            if principal[0] < -1e-9 * principal[2] or principal[2] > (principal[0] + principal[1]) * (1.0 + 1e-9):
                given = f"principal moments of {', '.join(f'{moment:.4g}' for moment in principal)} kg m^2"
                why = "no body has a moment of inertia above the sum of the other two"
                raise refuse("products", given, "each principal moment up to the sum of the others", why)

    @property
    def tensor(self) -> FloatArray:
        """Tensor of inertia about the centre, kg m^2, shape (3, 3): moments, and products with a negative sign."""
        xy, xz, yz = self.products
        return np.diag(self.inertia) - np.array([[0.0, xy, xz], [xy, 0.0, yz], [xz, yz, 0.0]])

    def matrix(self) -> FloatArray:
        """Return the 6 x 6 mass matrix at the node, global axes.

        With S the matrix of ``r cross``, the body's velocity is ``v - S w``, so M = m [[I, -S], [S, -S S]] plus
        the inertia: J. S. Przemieniecki, Theory of Matrix Structural Analysis (1968), sec. 11.6 in matrix form.
        """
        x, y, z = self.offset
        S = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
        return np.block([[self.mass * np.eye(3), -self.mass * S], [self.mass * S, self.tensor - self.mass * S @ S]])


def mass_at(node: int, body: PointMass, dofs: DofMap) -> Triplets:
    """Return the mass matrix of a body fixed to a node, in the free components."""
    numbers, matrices = dofs.congruence(np.array([[node]]), body.matrix()[None])
    return place_matrix(matrices[0], numbers[0], dofs.size)


def place_matrix(matrix: FloatArray, numbers: IntArray, size: int) -> Triplets:
    """Return a small matrix among all unknowns by the number of each row; -1 for a component that does not move."""
    i, j = np.nonzero((matrix != 0.0) & (numbers[:, None] >= 0) & (numbers >= 0))
    return Triplets(size, numbers[i], numbers[j], matrix[i, j])


def scalar_matrix(row: FloatArray, coefficient: float) -> Triplets:
    """Return the matrix of a mass, spring or damper that acts on one scalar ``row^T u``."""
    return Triplets.outer(row, row, coefficient)


_RANK_TOLERANCE = 1e-10  # singular values of the constraints below this are rounding: the rows have size 1


def free_motions(mesh: Mesh, dofs: DofMap, springs: Iterable[FloatArray]) -> FloatArray:
    """Return a basis of the motions without strain energy."""
    joined = np.isin(np.arange(len(mesh.nodes)), np.concatenate([*mesh.parts, np.zeros(0, np.intp)]))
    movable = joined | (dofs.numbers >= 0).any(axis=1)
    single = np.flatnonzero(movable & ~joined)
    rigid = _rigid_motions(mesh, [*mesh.parts, *single[:, None]])
    nodal = int(np.count_nonzero(dofs.numbers >= 0))
    further = dofs.size - nodal  # additional unknowns after those of the nodes: each is free
    relative = (
        rigid if dofs.ties is None else rigid - np.einsum("ncj,njm->ncm", dofs.ties.matrices, rigid[dofs.ties.leader])
    )
    constraints = np.pad(relative[movable[:, None] & (dofs.numbers < 0)], ((0, 0), (0, further)))
    free = np.zeros((dofs.size, rigid.shape[-1] + further))
    free[dofs.numbers[dofs.numbers >= 0], : rigid.shape[-1]] = rigid[dofs.numbers >= 0]
    free[nodal:, rigid.shape[-1] :] = np.eye(further)
    rows = np.concatenate([constraints, *(_row_product(row, free) for row in springs)])
    size = np.abs(rows).max(axis=1, initial=0.0)
    rows = rows[size > 0.0] / size[size > 0.0, None]
    R = np.linalg.qr(rows, mode="r")  # the same null space with few rows
    _, values, vectors = np.linalg.svd(R)
    rank = int(np.count_nonzero(values > _RANK_TOLERANCE * max(1.0, float(values.max(initial=0.0)))))
    return free @ vectors[rank:].T


def _row_product(row: FloatArray, free: FloatArray) -> FloatArray:
    at = np.flatnonzero(row != 0.0)
    return row[None, at] @ free[at]


def _rigid_motions(mesh: Mesh, parts: Sequence[IntArray]) -> FloatArray:
    """Return six rigid-body motions per part, shape (nodes, 6, 6 parts), rotations about its centre.

    Rotations are scaled by the size of the part.
    """
    motions = np.zeros((len(mesh.nodes), 6, 6 * len(parts)))
    for p, nodes in enumerate(parts):
        arm = mesh.nodes[nodes] - mesh.nodes[nodes].mean(axis=0)
        size = float(np.linalg.norm(arm, axis=1).max()) or 1.0  # of a single node
        motions[nodes, :, 6 * p : 6 * p + 6] = rigid_motions(arm) / np.repeat([1.0, size], 3)
    return motions
