"""Damping matrices: Rayleigh's and modal."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from flexcam.checks import positive
from flexcam.linalg import FloatArray, Triplets


@dataclass(frozen=True)
class Damping:
    """Damping of the whole structure; both kinds add up, beside dampers given as parts.

    Parameters
    ----------
    alpha
        Factor of the mass, 1/s.
    beta
        Factor of the stiffness, s.
    modal
        Damping ratio of every mode of the undamped structure.

    Examples
    --------
    >>> Damping(alpha=5.36, beta=7.46e-5).modal
    0.0
    """

    alpha: float = 0.0
    beta: float = 0.0
    modal: float = 0.0

    def __post_init__(self) -> None:
        positive("damping.alpha", self.alpha, "1/s", zero=True)
        positive("damping.beta", self.beta, "s", zero=True)
        positive("damping.modal", self.modal, "", zero=True)


def rayleigh_damping(mass: Triplets, stiffness: Triplets, alpha: float, beta: float) -> Triplets:
    """Return ``alpha M + beta K``."""
    parts = [matrix.scaled(factor) for matrix, factor in ((mass, alpha), (stiffness, beta)) if factor != 0.0]
    return sum(parts, start=Triplets.zeros(mass.size))


def modal_damping(mass: Triplets, shapes: FloatArray, omegas: FloatArray, ratio: float) -> Triplets:
    """Return the matrix that damps given modes by one ratio.

    C = M Phi diag(2 zeta omega) Phi^T M with Phi^T M Phi = I; it is full, as modal damping is.
    Source: R. W. Clough and J. Penzien, Dynamics of Structures, 3rd ed. (2003), eq. 12-56.
    """
    spread = np.column_stack([mass.times(shape) for shape in shapes.T]) if shapes.size else shapes
    return Triplets.from_dense((spread * (2.0 * ratio * omegas)) @ spread.T)
