"""The lobe of a cam with its real profile, and its place in space."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from flexcam.cams import CamProfile, Follower, SwingFlatFollower, SwingRollerFollower, cam_profile
from flexcam.core import ComplexArray, FloatArray
from flexcam.plotting.scene.motion import turn
from flexcam.plotting.scene.solids import Solid, prism
from flexcam.valvetrain import Cam

POINTS = 360
"""Points of a drawn profile."""


@dataclass(frozen=True, eq=False)
class CamFrame:
    """A cam's plane in space: where the drawing of cam and follower lies.

    Parameters
    ----------
    profile
        The cam, in its drawing.
    centre
        Of the cam, at rest, m, shape (3,).
    plane
        Unit vectors in space of the drawing's axes, the follower's first motion along the second, shape (2, 3).
    axis
        Unit vector of rotation, shape (3,).
    width
        m.
    """

    profile: CamProfile
    centre: FloatArray
    plane: FloatArray
    axis: FloatArray
    width: float

    @property
    def follower(self) -> Follower:
        """The follower it was made for."""
        return self.profile.follower

    @property
    def side(self) -> int:
        """1 where a swinging follower's pivot lies along the plane's first axis from its touching end, else -1."""
        made_for = self.follower
        return made_for.side if isinstance(made_for, SwingRollerFollower | SwingFlatFollower) else 1

    def drawn(self, lift: float) -> complex:
        """Return the follower's touching end (a roller's centre) at a lift, in the plane, m."""
        touch = self.follower.touch(np.array([lift]), np.zeros(1), np.zeros(1), self.profile.turn)
        return complex(touch.trace[0]) * self._upright

    @property
    def _upright(self) -> complex:
        """Turn of the drawing after which the follower begins to move along the imaginary axis."""
        nothing = np.zeros(1)
        return 1j / complex(self.follower.touch(nothing, nothing, nothing, self.profile.turn).motion[0])

    def space(self, points: ComplexArray) -> FloatArray:
        """Return points of the upright drawing in space, relative to the cam's centre, m, shape (n, 3)."""
        return np.column_stack([points.real, points.imag]) @ self.plane

    def contour(self, angle: float) -> ComplexArray:
        """Return the profile at a cam angle, rad, in the upright drawing, m, shape (POINTS,), counterclockwise."""
        own = self.profile.points @ np.array([1.0, 1j])
        points = own * np.exp(1j * self.profile.turn * angle) * self._upright
        return points if _area(points) > 0.0 else points[::-1]


def cam_frame(
    cam: Cam, follower: Follower, centre: FloatArray, lift: FloatArray, axis: FloatArray, width: float
) -> CamFrame:
    """Return the frame of a cam."""
    right = cam.turn * np.cross(lift, axis)
    made = cam_profile(cam.event, follower, count=POINTS, turn=cam.turn)
    return CamFrame(made, centre, np.array([right, lift]), axis, width)


def lobe(frame: CamFrame, angle: float, moved: FloatArray) -> Solid:
    """Return a lobe."""
    outline = frame.contour(angle)
    flat = np.column_stack([outline.real, outline.imag])
    plane = frame.plane @ turn(moved[None, 3:])[0]
    return prism("lobe", flat, plane, frame.centre + moved[:3], frame.width)


def _area(points: ComplexArray) -> float:
    return 0.5 * float(np.sum((np.conj(points) * np.roll(points, -1)).imag))
