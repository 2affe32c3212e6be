"""Valve, seat and closing spring of a follower's train."""

from __future__ import annotations

import numpy as np

from flexcam.core import FloatArray
from flexcam.valvetrain import Model, Seat, Spring


def unit_vector(vector: FloatArray) -> FloatArray:
    """Return the unit vector along a vector."""
    return vector[:3] / np.linalg.norm(vector[:3])


def find_seat(model: Model, point: str) -> Seat | None:
    """Return the seat at a point; None if there is none."""
    return next((one for one in model.contacts.values() if isinstance(one, Seat) and one.at == point), None)


def closing_spring(model: Model, nodes: set[int]) -> Spring | None:
    """Return the stiffest spring from given nodes to ground that is not a bearing; None if there is none."""
    own = [
        one
        for one in model.springs.values()
        if one.at in model.mesh.points and one.to is None and model.mesh.node(one.at) in nodes and is_coil(model, one)
    ]
    return max(own, key=lambda one: one.stiffness, default=None)


def is_coil(model: Model, spring: Spring) -> bool:
    """Return whether a spring is drawn as a coil: translational and not a bearing of a shaft."""
    return bool(spring.direction[:3].any()) and not is_bearing(model, spring)


def is_bearing(model: Model, spring: Spring) -> bool:
    """Return whether a spring is drawn as a bearing: from a node of a camshaft to ground."""
    if spring.to is not None or spring.at not in model.mesh.points:
        return False
    return model.mesh.node(spring.at) in shaft_nodes(model)


def shaft_nodes(model: Model) -> set[int]:
    """Return the nodes of the members with cams."""
    return {node for name in shafts(model) for node in model.mesh.lines[name].tolist()}


def shafts(model: Model) -> list[str]:
    """Return the names of the members with cams."""
    cams = {model.mesh.node(cam.at) for cam in model.cams.values()}
    return [name for name, line in model.mesh.lines.items() if cams.intersection(line.tolist())]
