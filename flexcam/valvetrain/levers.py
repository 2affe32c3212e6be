"""Lever joints: nonlinear forces of large rotation beyond the linear springs.

The structure contains the joints as springs with the installed ratio. This module adds the difference: the force of the
exact penetration ``y(p) - x`` minus that of the linear one, which acts on the lever with ``y'(p)`` by virtual work.
"""

from __future__ import annotations

import numpy as np

from flexcam.dynamics import ForceLaw, LocalForce
from flexcam.dynamics.force_laws import LEVER
from flexcam.valvetrain.contacts import Coupling, opposed_force
from flexcam.valvetrain.loads import follower_train
from flexcam.valvetrain.parts import Lever
from flexcam.valvetrain.structure import Structure, lever_ends


def lever_end(lever: Lever, end: int) -> ForceLaw:
    """Return the law of an elastic lever end beyond its linear spring; it senses the path p and the motion x."""
    return ForceLaw(
        LEVER, (lever.stiffness[end], lever.damping[end], lever.arms[end], lever.arms[0], lever.angles[end])
    )


def lever_joints(structure: Structure) -> Coupling:
    """Return the nonlinear forces of all levers."""
    check_lever_rotation(structure)
    forces: list[LocalForce] = []
    for name, lever in structure.model.levers.items():
        for end, rows in lever_ends(structure, lever).items():
            where = f"rockers.{name}.{('from', 'to')[end]}"
            forces.append(opposed_force(where, np.array(rows), lever_end(lever, end)))
    return Coupling((), tuple(forces), ())


def check_lever_rotation(structure: Structure) -> None:
    """Refuse a lift that rotates a lever until its arm is parallel to the motion."""
    model = structure.model
    for name, contact in model.cam_contacts.items():
        train = follower_train(structure, contact, f"contacts.{name}.follower")
        event = model.cams[contact.cam].event
        for rocker, lever in model.levers.items():
            driven = float(structure.row(lever.start, lever.direction) @ train.motion)
            lever.path_at(np.array([driven * event.height]), f"rockers.{rocker}.arms")
