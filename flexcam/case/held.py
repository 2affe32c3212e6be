"""Rockers and plays that stand along a direction in which supports hold what they would move."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from flexcam.case.case import Case
from flexcam.checks import Fault
from flexcam.fem import component
from flexcam.linalg import FloatArray
from flexcam.train import Adjuster, Lash, Model


def held_faults(case: Case, model: Model) -> list[Fault]:
    """Return the rockers that nothing can drive, and the plays of which neither end can move."""
    return [*_undriven(case, model), *_still(case, model)]


def _undriven(case: Case, model: Model) -> Iterator[Fault]:
    for name, rocker in model.rockers.items():
        if not rocker.finger and _is_held(model, rocker.start, rocker.direction):
            given, why = f"{rocker.start!r}, held along the rocker's direction", "nothing could drive the rocker"
            remedy = "give the direction in which the node moves, or free it"
            yield Fault(case.place(("rockers", name, "from")), given, "a node that can move along it", why, remedy)


def _still(case: Case, model: Model) -> Iterator[Fault]:
    """Yield the plays between two held nodes; one held node makes a stop of it, which is meant."""
    for name, one in model.contacts.items():
        if not isinstance(one, Lash | Adjuster) or one.ends is None or one.direction is None:
            continue
        if all(_is_held(model, end, one.direction) for end in one.ends):
            given = f"{one.ends[0]!r} and {one.ends[1]!r}, both held along it"
            allowed, why = "a direction in which one of them can move", "the play would never act"
            yield Fault(case.place(("contacts", name, "direction")), given, allowed, why, "turn it, or free a node")


def _is_held(model: Model, point: str, direction: FloatArray) -> bool:
    """Tell whether supports hold a node along a direction."""
    node = model.mesh.node(point)
    kept = [held for name, held in model.supports.items() if node in model.mesh.points[name]]
    numbers = [component(one) for held in kept for one in held]
    return not np.delete(direction, numbers).any()
