"""Names, order and sign conventions of components.

A node has six components in global axes: translations ``ux uy uz`` and rotations ``rx ry rz`` (right-hand rule). A beam
element has the six components of its first node, then those of its second, in local axes (x along the member). Axial
force is positive in tension.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from flexcam.core import FloatArray
from flexcam.core.errors import finite_array, refuse, suggest_name

COMPONENTS = ("ux", "uy", "uz", "rx", "ry", "rz")
"""The six components of a node, in array order."""

ROTATIONS = COMPONENTS[3:]
"""Components that are rotations."""


def component(name: str, where: str = "component") -> int:
    """Return the index of a component among the six."""
    if name in COMPONENTS:
        return COMPONENTS.index(name)
    raise refuse(where, repr(name), ", ".join(COMPONENTS), remedy=suggest_name(name, COMPONENTS))


def direction(value: str | FloatArray | Sequence[float], where: str = "direction") -> FloatArray:
    """Return a direction as a row of the six components of a node."""
    if isinstance(value, str):
        unit, name = np.zeros(6), value[1:] if value[:1] in ("+", "-") else value
        if name not in COMPONENTS:
            allowed = f"{', '.join(COMPONENTS)}, each also with a minus sign, or three or six numbers"
            raise refuse(where, repr(value), allowed, remedy=suggest_name(name, COMPONENTS))
        unit[COMPONENTS.index(name)] = -1.0 if value.startswith("-") else 1.0
        return unit
    entries = value if isinstance(value, np.ndarray | list | tuple) else [None]
    if any(isinstance(one, bool) or not isinstance(one, int | float) for one in entries):
        raise refuse(where, value, _DIRECTIONS)
    six, given = np.zeros(6), finite_array(where, value, (None,))
    if len(given) not in (3, 6) or not given.any():
        raise refuse(where, given.tolist(), f"{_DIRECTIONS}, not all zero")
    six[: len(given)] = given
    for part in (six[:3], six[3:]):
        length = np.linalg.norm(part)
        if length > 0.0:
            part /= length
    return six


_DIRECTIONS = "a component such as 'uy' or '-uy', or three or six numbers"


def rigid_motions(arms: FloatArray) -> FloatArray:
    """Return the components of points in six unit motions of a rigid body, shape (n, 6, 6), from their arms, m.

    A rigid body moves its points by ``u + theta x r``: H. Goldstein, Classical Mechanics, 3rd ed., sec. 4.8, for small
    rotations. The last axis has three translations, then three rotations.
    """
    motions = np.tile(np.eye(6), (len(arms), 1, 1))
    motions[:, :3, 3:] = np.swapaxes(np.cross(np.eye(3), arms[:, None]), 1, 2)
    return motions


_PARALLEL = 1e-6  # sine of the angle below which an orientation vector cannot define local y: six digits are lost there
_NEAR_VERTICAL = 0.02  # sine of the angle to global y below which the default orientation is global -x


def default_orientation(axis: FloatArray) -> FloatArray:
    """Return the default orientation vectors.

    The default is global y, so that a shaft along x has its local axes parallel to the global ones; for an element
    within about one degree of global y it is global -x, which is the same triad rotated by 90 degrees about z. A curved
    member that passes through global y, with a section that is not round, needs an explicit orientation.
    """
    vertical = np.hypot(axis[..., 0], axis[..., 2]) < _NEAR_VERTICAL
    return np.where(vertical[..., None], [-1.0, 0.0, 0.0], [0.0, 1.0, 0.0])


def triads(axes: FloatArray, orientations: FloatArray) -> FloatArray:
    """Return the local axes of elements as rows of rotation matrices.

    Local x runs along the element, local y lies in the plane of x and the orientation vector, on the side of the
    vector, and z = x cross y. With R the triad, ``u_local = R u_global``.
    """
    along = np.sum(axes * orientations, axis=1, keepdims=True)
    across = orientations - along * axes
    length = np.linalg.norm(across, axis=1)
    bad = np.flatnonzero(length <= _PARALLEL * np.linalg.norm(orientations, axis=1))
    if bad.size:
        raise refuse(
            f"orientation of element {bad[0]}", orientations[bad[0]].tolist(), "a vector that is not along the member",
            "the vector defines local y", "choose a vector across the member",
        )  # fmt: skip
    y = across / length[:, None]
    z = np.cross(axes, y).astype(float, copy=False)
    return np.stack([axes, y, z], axis=1) + 0.0  # + 0.0 changes -0.0 to 0.0
