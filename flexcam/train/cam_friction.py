"""Friction along a flat face, against the velocity at which the cam's surface slides."""

from __future__ import annotations

from dataclasses import replace
from typing import cast

import numpy as np

from flexcam.cam import SwingFlatFollower
from flexcam.checks import refuse
from flexcam.linalg import FloatArray
from flexcam.system import AngleVector, ForceLaw, LocalForce, constant
from flexcam.train.cam_functions import along_lift, beside_lift, lightened, off_pivot, rub, travelled
from flexcam.train.cam_plane import sideways, to_right, turning
from flexcam.train.model import Cam, CamContact
from flexcam.train.structure import Structure


def rubbing(structure: Structure, name: str, contact: CamContact, cam: Cam, force: LocalForce) -> LocalForce:
    """Return the contact with friction: a second scalar whose rate is the velocity of sliding."""
    along = rubbed(structure, name, contact, cam)
    acting = AngleVector(-along.vectors, along.functions)
    law = replace(cast("ForceLaw", force.law), friction=(contact.friction, contact.friction_speed))
    offset = (*force.offset, travelled(cam))
    return LocalForce(
        force.name, (*force.sense, along), (*force.act, acting), law, offset, force.switching, force.restitution
    )  # fmt: skip


def rubbed(structure: Structure, name: str, contact: CamContact, cam: Cam) -> AngleVector:
    """Return the derivative of the path along the face by the unknowns, per force along the normal.

    By virtual work (C. Lanczos, The Variational Principles of Mechanics, 4th ed., ch. III) the friction T does
    T times the path of the cam's surface less that of the face. A swinging face at the distance e from its pivot moves
    along itself by e per angle, lift by arm: that is the moment T e of friction about the pivot. With the force f along
    the lift, T is mu f over the reach, by which every path is divided here.
    """
    where = f"contacts.{name}.friction"
    if cam.follower is None:
        remedy = "give base_radius and follower of the cam"
        raise refuse(where, contact.friction, "a cam with a profile", "the velocity of sliding follows from it", remedy)
    if np.isfinite(cam.follower.roller_radius):
        why = "a roller takes the sliding up by turning"
        raise refuse(where, contact.friction, "a follower with a flat face", why, "leave friction out")
    twist, right = structure.row(cam.at, turning(contact.shaft_axis)), to_right(contact, cam)
    if not isinstance(cam.follower, SwingFlatFollower):
        return AngleVector(np.array([sideways(structure, contact, cam), twist]), (constant(1.0), rub(cam)))
    rows = [structure.row(cam.at, right), -structure.row(cam.at, contact.direction), twist]
    rows.append(-_drawn(structure, contact, cam, cam.follower))
    return AngleVector(np.array(rows), (along_lift(cam), beside_lift(cam), rub(cam), lightened(cam)))


def _drawn(structure: Structure, contact: CamContact, cam: Cam, face: SwingFlatFollower) -> FloatArray:
    """Return the row of how far a swinging face moves along itself, to the right."""
    along = off_pivot(cam) * structure.row(contact.follower, contact.direction)
    if not structure.is_node(contact.follower):
        return along
    own, turned = (structure.row(contact.follower, d) for d in (to_right(contact, cam), turning(contact.shaft_axis)))
    if not turned.any():
        return own + along
    mesh = structure.model.mesh
    node, centre = (mesh.nodes[mesh.node(one)] for one in (contact.follower, cam.at))
    height = face.base_radius - float((node - centre) @ contact.direction[:3])  # of the face above its node
    return own - cam.turn * height * turned
