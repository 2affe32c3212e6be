"""Superelements: mass and stiffness of an elastic body between named nodes, reduced to these nodes and some modes.

R. R. Craig and M. C. C. Bampton, Coupling of substructures for dynamic analyses, AIAA Journal 6 (1968): the unknowns
are the six components of every interface node and the amplitudes of modes with fixed interface.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from flexcam.core import FloatArray
from flexcam.core.errors import refuse
from flexcam.fem.dofs import rigid_motions

INTERNAL_LIMIT = 200
"""Number of internal unknowns up to which all of them are kept as modes without being asked for."""

_SYMMETRY = 1e-6  # relative difference of two entries of a symmetric matrix, for files with few digits
_RIGID = 1e-4  # strain energy of a rigid-body motion relative to that of its parts, for files with few digits
_MASS_TOLERANCE = 0.01  # relative difference of the masses of a body along x, y and z, for files with few digits
_ZERO = 1e-9  # eigenvalue of the scaled stiffness below which a motion has no strain energy


@dataclass(frozen=True, eq=False)
class Superelement:
    """Reduced matrices of a body; its unknowns are ux to rz of each interface node, global axes, then its modes."""

    nodes: tuple[str, ...]  #: names of the interface nodes
    #: `mass`, `stiffness`, `damping`: SI, shape (n, n)
    mass: FloatArray
    stiffness: FloatArray
    damping: FloatArray

    @property
    def modes(self) -> int:
        """Number of modes with fixed interface."""
        return len(self.mass) - 6 * len(self.nodes)

    def rigid_body(self, positions: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return the mass along x, y and z, kg, and the centre of gravity, m, with its nodes at positions (k, 3)."""
        R = rigid_motions(positions).reshape(-1, 6)
        inertia = R.T @ self.mass[: len(R), : len(R)] @ R
        moments = np.array([inertia[1, 5], inertia[2, 3], inertia[0, 4]])
        return np.diag(inertia)[:3], moments / (np.diag(inertia)[:3].mean() or 1.0)


def reduce_superelement(
    nodes: tuple[str, ...], positions: FloatArray, matrices: tuple[FloatArray, FloatArray, FloatArray],
    modes: int | None = None,
) -> Superelement:  # fmt: skip
    """Return the superelement of mass, stiffness and damping, whose first unknowns are those of the interface nodes.

    Refuses matrices that are not symmetric or have negative energy, and a stiffness that resists one of the six
    rigid-body motions of the nodes at their positions (m, shape (k, 3)), or a seventh motion does not.
    """
    names = ("mass", "stiffness", "damping")
    mass, stiffness, damping = (_symmetric(name, matrix) for name, matrix in zip(names, matrices, strict=True))
    outer = 6 * len(nodes)
    internal = len(stiffness) - outer
    count = internal if modes is None else min(modes, internal)
    if count > INTERNAL_LIMIT:
        given, why = f"{count} modes", "each becomes an unknown of the run"
        raise refuse("modes", given, f"up to {INTERNAL_LIMIT}", why, "add modes = 20, or another number of modes")
    basis = np.zeros((len(stiffness), outer + count))
    basis[:outer, :outer] = np.eye(outer)
    if internal:
        basis[outer:, :outer], basis[outer:, outer:] = _internal_shapes(mass, stiffness, outer, count)
    reduced = [basis.T @ matrix @ basis for matrix in (mass, stiffness, damping)]
    reduced[1][:outer, outer:] = reduced[1][outer:, :outer] = 0.0  # static shapes have no energy with the modes
    reduced[1][:outer, :outer] = _free_of_rigid_motions(reduced[1][:outer, :outer], positions)
    body = Superelement(nodes, reduced[0], reduced[1], reduced[2])
    masses = body.rigid_body(positions)[0]
    if float(np.ptp(masses)) > _MASS_TOLERANCE * float(masses.max()):
        given = " kg, ".join(f"{mass:.4g}" for mass in masses) + " kg along x, y and z"
        why, remedy = "a free body has the same mass in all directions", "compare the nodes and units of the file"
        raise refuse("mass", given, "the same mass along x, y and z", why, remedy)
    return body


def _symmetric(name: str, matrix: FloatArray) -> FloatArray:
    """Return a symmetric matrix without rounding; refuse another one, and one with negative energy."""
    size = np.sqrt(np.abs(np.diag(matrix)))
    uneven = np.abs(matrix - matrix.T) > _SYMMETRY * np.maximum(np.outer(size, size), np.abs(matrix).max() * 1e-12)
    if uneven.any():
        i, j = np.argwhere(uneven)[0].tolist()
        given = f"{matrix[i, j]:g} in row {i + 1}, column {j + 1}, and {matrix[j, i]:g} in the transposed place"
        raise refuse(name, given, "a symmetric matrix", "action and reaction are equal")
    even = 0.5 * (matrix + matrix.T)
    scale = np.where(size > 0.0, size, 1.0)
    minimum = float(np.linalg.eigvalsh(even / np.outer(scale, scale)).min())
    if minimum < -_SYMMETRY:
        given, why = f"an eigenvalue of {minimum:.3g}, with unit diagonal", "no motion has negative energy"
        raise refuse(name, given, "a positive semi-definite matrix", why, "check whether the file is complete")
    return even


def _internal_shapes(mass: FloatArray, stiffness: FloatArray, outer: int, count: int) -> tuple[FloatArray, FloatArray]:
    """Return the static shapes and the lowest modes of the internal unknowns with fixed interface."""
    from scipy.linalg import LinAlgError, eigh

    internal, coupling = stiffness[outer:, outer:], stiffness[outer:, :outer]
    try:
        np.linalg.cholesky(internal)
    except np.linalg.LinAlgError:
        why = "with fixed interface nodes an internal motion has no stiffness"
        raise refuse("stiffness", "a singular matrix of the internal unknowns", "a regular one", why) from None
    static = np.asarray(-np.linalg.solve(internal, coupling), dtype=np.float64)
    if not count:
        return static, np.zeros((len(internal), 0))
    try:
        shapes = eigh(internal, mass[outer:, outer:], subset_by_index=[0, count - 1])[1]
    except LinAlgError:
        why = "modes need a mass for every internal unknown"
        raise refuse("mass", "internal unknowns without mass", "a consistent mass", why, "use modes = 0") from None
    return static, np.asarray(shapes / np.abs(shapes).max(axis=0), dtype=np.float64)


def _free_of_rigid_motions(stiffness: FloatArray, positions: FloatArray) -> FloatArray:
    """Return the stiffness of the interface without the rounding that resists rigid-body motions."""
    R = rigid_motions(positions - positions.mean(axis=0)).reshape(-1, 6)
    energy, parts = np.diag(R.T @ stiffness @ R), np.diag(np.abs(R).T @ np.abs(stiffness) @ np.abs(R))
    strained = np.flatnonzero(energy > _RIGID * parts).tolist()
    if strained:
        kinds = ("x", "y", "z", "rotation about x", "rotation about y", "rotation about z")
        names = ", ".join(kinds[i] for i in strained)
        why = "the matrix must be that of a free body in global axes, with its nodes at the positions in the case"
        raise refuse("stiffness", f"a stiffness against rigid motion: {names}", "none", why, "compare nodes and units")
    free = np.eye(len(R)) - R @ np.linalg.pinv(R)
    exact = free.T @ stiffness @ free
    scale = np.sqrt(np.abs(np.diag(stiffness)))
    scale = np.where(scale > 0.0, scale, 1.0)
    loose = int(np.count_nonzero(np.linalg.eigvalsh(exact / np.outer(scale, scale)) < _ZERO)) - 6
    if loose > 0:
        why = "each interface node needs the stiffness of its three displacements and three rotations"
        raise refuse("stiffness", f"{loose} further motions without strain energy", "six rigid-body motions", why)
    return np.asarray(exact, dtype=np.float64)
