"""Concentrated parts: masses on a rigid arm, springs and dampers."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from flexcam.checks import finite_array, positive, refuse
from flexcam.fem.dofs import DofMap
from flexcam.linalg import FloatArray, Triplets


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

    Raises
    ------
    InputError
        If a mass or a moment is negative, or three moments violate the triangle inequality of rigid bodies.

    Examples
    --------
    >>> PointMass(2.0, offset=(0.0, 0.0, 0.5)).matrix()[3, 3]
    np.float64(0.5)
    """

    mass: float
    inertia: tuple[float, float, float] = (0.0, 0.0, 0.0)
    offset: tuple[float, float, float] = (0.0, 0.0, 0.0)

    def __post_init__(self) -> None:
        positive("mass", self.mass, "kg", zero=True)
        for axis, value in zip("xyz", self.inertia, strict=True):
            positive(f"inertia {axis}", value, "kg m^2", zero=True)
        if 2.0 * max(self.inertia) > sum(self.inertia) * (1.0 + 1e-9):
            why = "no body has a moment of inertia above the sum of the other two"
            raise refuse("inertia", list(self.inertia), "each moment up to the sum of the others", why)
        finite_array("offset", self.offset, (3,))

    def matrix(self) -> FloatArray:
        """Return the 6 x 6 mass matrix at the node, global axes.

        With S the matrix of ``r cross``, the body's velocity is ``v - S w``, so M = m [[I, -S], [S, -S S]] plus
        the inertia: J. S. Przemieniecki, Theory of Matrix Structural Analysis (1968), sec. 11.6 in matrix form.
        """
        x, y, z = self.offset
        S = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
        return np.block(
            [[self.mass * np.eye(3), -self.mass * S], [self.mass * S, np.diag(self.inertia) - self.mass * S @ S]]
        )


def mass_at(node: int, body: PointMass, dofs: DofMap) -> Triplets:
    """Return the mass of a body fixed to a node, in the free components."""
    numbers, matrix = dofs.numbers[node], body.matrix()
    i, j = np.nonzero((matrix != 0.0) & (numbers[:, None] >= 0) & (numbers >= 0))
    return Triplets(dofs.size, numbers[i], numbers[j], matrix[i, j])


def along(row: FloatArray, coefficient: float) -> Triplets:
    """Return the matrix of a mass, spring or damper that acts on one scalar ``row^T u``."""
    return Triplets.outer(row, row, coefficient)
