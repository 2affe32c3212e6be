"""Coulomb's friction at the cam of a rigid train: the balance of normal force and friction in closed form."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from flexcam.checks import refuse
from flexcam.linalg import FloatArray
from flexcam.motion import Event
from flexcam.system import AngleFunction, CamMotion
from flexcam.train.cam_friction import rubbed
from flexcam.train.cam_functions import travelled
from flexcam.train.model import CamContact
from flexcam.train.structure import Structure

History = Callable[[CamMotion], FloatArray]

_ROUND = np.linspace(0.0, 2.0 * np.pi, 721)
"""Angles at which a follower may jam."""


@dataclass(frozen=True, eq=False)
class RigidFriction:
    """Friction mu f tanh(v/v0) of a contact force f that the follower's motion makes slide at v.

    The train needs a force along its lift. Where the face moves along itself as it is lifted (a swinging face beside
    its pivot), by a per lift, friction bears a part of it: ``f - a T = needed`` with ``T = mu f tanh(v/v0)``, so that
    ``f = needed/(1 - a mu tanh(v/v0))``: virtual work of what `flexcam.train.cam_friction` senses.

    Parameters
    ----------
    event
        Lift of the cam.
    coefficient, speed
        mu, and v0 in m/s.
    shares
        What the follower's motion moves along each of `along`, shape (k,).
    along
        Functions of the path along the face.
    slid
        Path that slides past while the follower stands, m; its derivative counts.
    """

    event: Event
    coefficient: float
    speed: float
    shares: FloatArray
    along: tuple[AngleFunction, ...]
    slid: AngleFunction

    def force(self, needed: History) -> History:
        """Return the contact force, N, from what the train needs along its lift."""
        return lambda motion: needed(motion) / (1.0 - self._per_lift(motion) * self._share(motion))

    def jams(self) -> bool:
        """Tell whether somewhere on the round friction bears all that the train needs, whatever the contact's force."""
        a = sum(
            (share * one(_ROUND, 0) for share, one in zip(self.shares, self.along, strict=True)), np.zeros(len(_ROUND))
        )
        path = a * self.event(_ROUND, 1) + self.slid(_ROUND, 1)
        return bool((self.coefficient * a * np.sign(path) >= 1.0).any())

    def friction(self, needed: History) -> History:
        """Return friction over the contact force's reach, N: what the laws of contacts give."""
        force = self.force(needed)
        return lambda motion: self._share(motion) * force(motion)

    def _per_lift(self, motion: CamMotion) -> FloatArray:
        return sum(
            (share * motion.cam(one, 0) for share, one in zip(self.shares, self.along, strict=True) if share),
            np.zeros_like(motion.angle),
        )

    def _share(self, motion: CamMotion) -> FloatArray:
        path = self._per_lift(motion) * motion.cam(self.event, 1) + motion.cam(self.slid, 1)
        return self.coefficient * np.tanh(path * motion.speed / self.speed)


def rigid_friction(structure: Structure, name: str, contact: CamContact, moved: FloatArray) -> RigidFriction:
    """Return the friction of a contact whose follower a rigid train moves."""
    cam = structure.model.cams[contact.cam]
    path = rubbed(structure, name, contact, cam)
    speed, slid = contact.friction_speed, travelled(cam)
    found = RigidFriction(cam.event, contact.friction, speed, path.vectors @ moved, path.functions, slid)
    if found.jams():
        allowed, why = "a friction at which the face slides", "friction alone would hold the rigid follower: it jams"
        remedy = "lower it, or place the pivot nearer to the line of the face"
        raise refuse(f"contacts.{name}.friction", contact.friction, allowed, why, remedy)
    return found
