"""Cam lobes with their true profile, and their position in space."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from flexcam.cams import CamProfile, Follower, SwingFlatFollower, SwingRollerFollower, cam_profile
from flexcam.core import ComplexArray, FloatArray
from flexcam.plotting.scene.motion import rotation_matrices
from flexcam.plotting.scene.solids import Solid, prism
from flexcam.valvetrain import Cam

POINTS = 360
"""Number of points of a drawn profile."""


@dataclass(frozen=True, eq=False)
class CamFrame:
    """Plane of a cam in space, in which cam and follower are drawn.

    Parameters
    ----------
    profile
        Cam profile in its own coordinates.
    centre
        Centre of the cam at rest, m, shape (3,).
    plane
        Unit vectors in space of the drawing axes, shape (2, 3); the follower initially moves along the second.
    axis
        Unit vector of rotation, shape (3,).
    width
        Width, m.
    """

    profile: CamProfile
    centre: FloatArray
    plane: FloatArray
    axis: FloatArray
    width: float

    @property
    def follower(self) -> Follower:
        """Follower of the profile."""
        return self.profile.follower

    @property
    def side(self) -> int:
        """1 if the pivot of a swinging follower lies along the first axis from its contact end, else -1."""
        made_for = self.follower
        return made_for.side if isinstance(made_for, SwingRollerFollower | SwingFlatFollower) else 1

    def contact_end(self, lift: float) -> complex:
        """Return the contact end of the follower (a roller's centre) at a lift, in the plane, m."""
        touch = self.follower.contact(np.array([lift]), np.zeros(1), np.zeros(1), self.profile.turn)
        return complex(touch.trace[0]) * self._upright_rotation

    @property
    def _upright_rotation(self) -> complex:
        """Rotation of the drawing after which the initial follower motion is along the imaginary axis."""
        nothing = np.zeros(1)
        return 1j / complex(self.follower.contact(nothing, nothing, nothing, self.profile.turn).motion[0])

    def space(self, points: ComplexArray) -> FloatArray:
        """Return points of the rotated drawing in space, relative to the cam centre, m, shape (n, 3)."""
        return np.column_stack([points.real, points.imag]) @ self.plane

    def contour(self, angle: float) -> ComplexArray:
        """Return the profile at a cam angle, rad, in the rotated drawing, m, shape (POINTS,), counterclockwise."""
        own = self.profile.points @ np.array([1.0, 1j])
        points = own * np.exp(1j * self.profile.turn * angle) * self._upright_rotation
        return points if _area(points) > 0.0 else points[::-1]


def cam_frame(
    cam: Cam, follower: Follower, centre: FloatArray, lift: FloatArray, axis: FloatArray, width: float
) -> CamFrame:
    """Return the plane of a cam."""
    right = cam.turn * np.cross(lift, axis)
    made = cam_profile(cam.event, follower, count=POINTS, turn=cam.turn)
    return CamFrame(made, centre, np.array([right, lift]), axis, width)


def lobe_solid(frame: CamFrame, angle: float, moved: FloatArray) -> Solid:
    """Return the solid of a lobe."""
    outline = frame.contour(angle)
    flat = np.column_stack([outline.real, outline.imag])
    plane = frame.plane @ rotation_matrices(moved[None, 3:])[0]
    return prism("lobe", flat, plane, frame.centre + moved[:3], frame.width)


def _area(points: ComplexArray) -> float:
    return 0.5 * float(np.sum((np.conj(points) * np.roll(points, -1)).imag))
