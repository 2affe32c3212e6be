"""The plane of a cam in space: its directions, and the finger that swings in it."""

from __future__ import annotations

import numpy as np

from flexcam.cam import SwingFlatFollower, SwingRollerFollower
from flexcam.checks import refuse
from flexcam.linalg import FloatArray
from flexcam.train.model import Cam, CamContact
from flexcam.train.structure import Structure, find_node

_SAME = 1e-6
"""Difference of lengths that is a matter of digits written."""

_NEAR = 1e-2
"""Difference of an arm and its member that is a matter of how a finger was drawn."""


def turning(axis: FloatArray) -> FloatArray:
    """Return the direction of a rotation."""
    return np.concatenate([np.zeros(3), axis])


def to_right(contact: CamContact, cam: Cam) -> FloatArray:
    """Return the direction to the right of the lift in the profile's drawing, shape (6,)."""
    return np.concatenate([cam.turn * np.cross(contact.direction[:3], contact.shaft_axis), np.zeros(3)])


def sideways(structure: Structure, contact: CamContact, cam: Cam) -> FloatArray:
    """Return the row of what the cam moves to the right of the follower, in the profile's drawing."""
    along = to_right(contact, cam)
    own = structure.row(contact.follower, along) if structure.is_node(contact.follower) else 0.0
    return structure.row(cam.at, along) - own


def refuse_other_arm(structure: Structure, contact: CamContact, cam: Cam, where: str) -> None:
    """Refuse a follower whose profile is made for another arm than that of the finger it stands for."""
    swinging = cam.follower
    if not isinstance(swinging, SwingRollerFollower | SwingFlatFollower):
        return
    finger, key = structure.model.rocker_at(contact.follower), f"cams.{contact.cam}.follower"
    given, why = f"{1e3 * swinging.arm:g} mm", "the cam's profile is made for the path of the finger"
    if finger is not None:
        if abs(swinging.arm - finger.arms[0]) > _SAME * finger.arms[0]:
            allowed = f"{1e3 * finger.arms[0]:g} mm, that of the rocker"
            raise refuse(f"{key}.arm", given, allowed, why, f"see {where}")
        return
    for pivot in pivots(structure, contact):
        name = structure.model.mesh.node_name(pivot)
        length, square = _arm(structure, contact, cam, pivot)
        if min(abs(length - swinging.arm), abs(abs(square) - swinging.arm)) > _NEAR * swinging.arm:
            allowed = f"{1e3 * length:g} mm, from {name} to {contact.follower}"
            raise refuse(f"{key}.arm", given, allowed, why, f"see {where}")
        if swinging.side * square < 0.0:
            given, allowed = ("clockwise", "counterclockwise")[:: swinging.side]
            why = f"{name}, about which it turns, lies on the other side of the cam"
            raise refuse(f"{key}.rotation", given, allowed, why, f"or turn the cam, see {where}")


def pivots(structure: Structure, contact: CamContact) -> list[int]:
    """Return the node about which the follower's member turns in the plane of the cam, if that is just one."""
    mesh, vector = structure.model.mesh, structure.dofs.vector
    node = find_node(structure.model, contact.follower, "follower")
    across = np.concatenate([np.cross(contact.direction[:3], contact.shaft_axis), np.zeros(3)])
    plane = contact.direction, across
    held = [n for n in mesh.connected(node).tolist() if not any(vector(n, one).any() for one in plane)]
    away = mesh.nodes[node] - mesh.nodes[held[:1]]
    lifts = abs(away @ across[:3]) > _NEAR * np.linalg.norm(away, axis=1)  # a node beyond its pivot only swings aside
    turns = [n for n in held if vector(n, turning(contact.shaft_axis)).any()]
    return turns if len(held) == 1 and lifts.all() else []


def _arm(structure: Structure, contact: CamContact, cam: Cam, pivot: int) -> tuple[float, float]:
    """Return the distance of the follower from its pivot, m, and its part square to the lift, inwards positive."""
    mesh = structure.model.mesh
    away = mesh.nodes[pivot] - mesh.nodes[mesh.node(contact.follower)]
    lift, right = (float(away @ one[:3]) for one in (contact.direction, to_right(contact, cam)))
    return float(np.hypot(lift, right)), right
