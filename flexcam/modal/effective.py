"""How much mass each mode moves along a direction."""

from __future__ import annotations

import numpy as np

from flexcam.linalg import FloatArray, Triplets
from flexcam.modal.modes import Modes


def effective_masses(modes: Modes, mass: Triplets, motions: FloatArray) -> FloatArray:
    """Return the effective modal masses ``(phi^T M r)^2`` of mass-orthonormal modes.

    Source: R. W. Clough and J. Penzien, Dynamics of Structures, 3rd ed. (2003), sec. 26-2. Over all modes they sum
    to ``r^T M r``, the mass of the free components along r.
    """
    pulled = np.array([mass.times(motion) for motion in motions]).reshape(len(motions), mass.size)
    return (modes.shapes.T @ pulled.T) ** 2
