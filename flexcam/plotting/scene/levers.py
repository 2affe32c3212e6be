"""Rockers and finger followers: positions of their ends and pivots, and their bodies."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from flexcam.core import FloatArray
from flexcam.plotting.scene.solids import Solid, capsule, cylinder, prism
from flexcam.valvetrain import Lever, Rocker


@dataclass(frozen=True, eq=False)
class LeverFrame:
    """Plane of a rocker in space.

    Parameters
    ----------
    rocker
        Rocker.
    pivot
        Pivot, m, shape (3,).
    plane
        Unit vectors perpendicular to and along the motion of the driven end, shape (2, 3).
    side
        Side of the pivot with the driven end along the first axis of the plane, 1 or -1.
    """

    rocker: Rocker
    pivot: FloatArray
    plane: FloatArray
    side: int = -1

    def ends(self, path: float) -> tuple[complex, complex]:
        """Return both ends relative to the pivot, in the plane, m, for a displacement of the driven end (m)."""
        rocker, far = self.rocker, self.side if self.rocker.finger else -self.side
        if isinstance(rocker, Lever):
            angles = rocker.angles[0] + path / rocker.arms[0], rocker.angles[1] + path / rocker.arms[0]
        else:  # constant ratio: the sine of the rotation is proportional to the displacement
            share = max(-0.9, min(0.9, path / rocker.arms[0]))
            angles = math.asin(share), math.asin(share)
        driven = rocker.arms[0] * complex(self.side * math.cos(angles[0]), math.sin(angles[0]))
        up = 1.0 if rocker.finger else -1.0
        return driven, rocker.arms[1] * complex(far * math.cos(angles[1]), up * math.sin(angles[1]))

    def space(self, point: complex) -> FloatArray:
        """Return a point of the plane in space, m, shape (3,)."""
        return self.pivot + np.array([point.real, point.imag]) @ self.plane

    @property
    def opening_direction(self) -> FloatArray:
        """Unit vector of the output motion during lift, shape (3,)."""
        return self.plane[1] if self.rocker.finger else -self.plane[1]


def lever_frame(rocker: Rocker, end: FloatArray, plane: FloatArray, side: int) -> LeverFrame:
    """Return the plane of a rocker with a given position of its driven end."""
    driven = LeverFrame(rocker, np.zeros(3), plane, side).ends(0.0)[0]
    return LeverFrame(rocker, end - np.array([driven.real, driven.imag]) @ plane, plane, side)


def lever_solids(frame: LeverFrame, path: float, thick: float) -> list[Solid]:
    """Return the solids of a rocker and its pivot."""
    bend, radii, pivot = _outline(frame, path, thick)
    links = zip(bend[:-1], bend[1:], radii[:-1], radii[1:], strict=True)
    body = [prism("rocker", capsule(a, b, (r, s)), frame.plane, frame.pivot, thick) for a, b, r, s in links]
    reach, middle = 0.9 * thick * np.cross(frame.plane[0], frame.plane[1]), frame.space(bend[pivot])
    post = [
        cylinder("pivot", middle + 0.3 * thick * frame.plane[1], middle + 3.0 * thick * frame.plane[1], 0.6 * thick)
    ]
    shaft = cylinder("pivot", middle - reach, middle + reach, 0.45 * thick)
    return [*body, shaft, *(post if frame.rocker.finger else [])]


def _outline(frame: LeverFrame, path: float, thick: float) -> tuple[list[complex], list[float], int]:
    """Return the joints of the body from end to end in the plane, their radii, and the index of the pivot.

    The lower side of a rocker touches its pushrod and its valve; a finger touches its valve.
    """
    (driven, point), thin = frame.ends(path), 0.5 * thick
    if frame.rocker.finger:
        return [0j, driven, point - 1j * thin], [0.7 * thick, 0.7 * thick, thin], 0
    return [driven + 1j * thin, 1j * thin, point + 1j * thin], [thin, 0.85 * thick, thin], 1
