"""How much mass each mode moves along a direction."""

from __future__ import annotations

import numpy as np

from flexcam.linalg import FloatArray, Triplets
from flexcam.modal.modes import Modes


def effective_masses(modes: Modes, mass: Triplets, motions: FloatArray) -> FloatArray:
    """Return the effective modal masses ``(phi^T M r)^2`` of mass-orthonormal modes.

    Source: R. W. Clough and J. Penzien, Dynamics of Structures, 3rd ed. (2003), sec. 26-2. Over all modes they sum
    to ``r^T M r``, the mass of the free components along r.

    Parameters
    ----------
    modes
        The modes.
    mass
        Mass matrix, n unknowns.
    motions
        Unit rigid motions r, shape (m, n), such as those of `DofMap.rigid_motion`.

    Returns
    -------
    ndarray
        Shape (modes, m), kg (kg m^2 for rotations).

    Examples
    --------
    >>> from flexcam.modal import modes
    >>> M, K = Triplets.from_dense([[2.0]]), Triplets.from_dense([[8.0]])
    >>> effective_masses(modes(M, K), M, np.ones((1, 1))).round(12)
    array([[2.]])
    """
    pulled = np.array([mass.times(motion) for motion in motions]).reshape(len(motions), mass.size)
    return (modes.shapes.T @ pulled.T) ** 2
