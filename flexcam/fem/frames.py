"""Local axes of beam elements in space."""

from __future__ import annotations

import numpy as np

from flexcam.checks import refuse
from flexcam.linalg import FloatArray

_PARALLEL = 1e-6
"""Sine of the angle below which an orientation vector cannot fix the local y axis: six digits are lost there."""

_NEAR_VERTICAL = 0.02
"""Sine of the angle to global y below which the default orientation is global -x (about one degree)."""


def default_orientation(axis: FloatArray) -> FloatArray:
    """Return the orientation vector used where none is given.

    It is global y, so that a shaft along x has its local axes parallel to the global ones; for an element
    within about one degree of global y it is global -x, the same triad turned by 90 degrees about z. A curved member
    that passes through global y, with a section that is not round, needs an orientation of its own.
    """
    vertical = np.hypot(axis[..., 0], axis[..., 2]) < _NEAR_VERTICAL
    return np.where(vertical[..., None], [-1.0, 0.0, 0.0], [0.0, 1.0, 0.0])


def triads(axes: FloatArray, orientations: FloatArray) -> FloatArray:
    """Return the local axes of elements as rows of rotation matrices.

    Local x runs along the element, local y lies in the plane of x and the orientation vector, on its side,
    and z = x cross y. With R the triad, ``u_local = R u_global``.
    """
    along = np.sum(axes * orientations, axis=1, keepdims=True)
    across = orientations - along * axes
    length = np.linalg.norm(across, axis=1)
    bad = np.flatnonzero(length <= _PARALLEL * np.linalg.norm(orientations, axis=1))
    if bad.size:
        raise refuse(
            f"orientation of element {bad[0]}", orientations[bad[0]].tolist(), "a vector that is not along the member",
            "it fixes the direction of local y", "choose one across the member",
        )  # fmt: skip
    y = across / length[:, None]
    z = np.cross(axes, y).astype(float, copy=False)
    return np.stack([axes, y, z], axis=1) + 0.0  # + 0.0 turns -0.0 into 0.0
