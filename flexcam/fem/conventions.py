"""Names, order and signs that every module shares.

A node has six components in global axes: translations ``ux uy uz`` and rotations ``rx ry rz`` (right-hand rule).
A beam element has the same six at its first node, then at its second, in local axes (x along the member). Axial
force is positive in tension.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import cast

import numpy as np

from flexcam.checks import did_you_mean, finite_array, refuse
from flexcam.linalg import FloatArray

COMPONENTS = ("ux", "uy", "uz", "rx", "ry", "rz")
"""The six components of a node, in the order of every array."""

ROTATIONS = COMPONENTS[3:]
"""Those of them that are angles."""


def component(name: str, where: str = "component") -> int:
    """Return the position of a component among the six."""
    if name in COMPONENTS:
        return COMPONENTS.index(name)
    raise refuse(where, repr(name), ", ".join(COMPONENTS), remedy=did_you_mean(name, COMPONENTS))


def direction(value: str | FloatArray | Sequence[float], where: str = "direction") -> FloatArray:
    """Return a direction in the six components of a node."""
    if isinstance(value, str):
        unit, name = np.zeros(6), value[1:] if value[:1] in ("+", "-") else value
        unit[component(name, where)] = -1.0 if value.startswith("-") else 1.0
        return unit
    if not isinstance(value, np.ndarray) and not _are_numbers(value):
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


def _are_numbers(value: object) -> bool:
    """Tell whether a value is a row of numbers; truth values are none."""
    if not isinstance(value, (list, tuple)):
        return False
    row = cast("Sequence[object]", value)
    return all(isinstance(one, (int, float)) and not isinstance(one, bool) for one in row)
