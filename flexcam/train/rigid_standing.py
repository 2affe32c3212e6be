"""What rigid trains cannot know of a standing cam, and what they press too far at full lift."""

from __future__ import annotations

import numpy as np

from flexcam.motion import event_extremes
from flexcam.system import Evaluated
from flexcam.train.assembled import build_structure
from flexcam.train.model import CamContact, Model
from flexcam.train.rigid_train import rigid_train


def shared_forces(model: Model, speed: float) -> dict[str, float]:
    """Return what a cam on its base circle and a seat share by their stiffness, of which rigid members know nothing."""
    structure = build_structure(model)
    free = {name: one for name, one in model.driven.items() if isinstance(one, CamContact)}
    found = {n: rigid_train(structure, one, f"contacts.{n}.follower", speed).shared for n, one in free.items()}
    return {name: force for name, force in found.items() if force > 0.0}


def touching_coils(model: Model, speed: float) -> dict[str, float]:
    """Return the springs whose coils touch when rigid trains stand at full lift."""
    structure, found = build_structure(model), dict[str, float]()
    for name, contact in model.driven.items():
        train = rigid_train(structure, contact, f"contacts.{name}.follower", speed)
        top = event_extremes(model.cams[contact.cam].event)[1]
        moved = np.stack([one(np.array([top.value]))[0] for one in train.coordinates], axis=-1)
        for one in train.springs:
            beyond = len(one.rows) * float(one.pressed(moved, Evaluated(np.array([top.at]))).max())
            if one.stops and beyond > 0.0:
                found[one.name.split(".")[1]] = beyond
    return found
