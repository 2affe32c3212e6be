"""How a rigid follower moves: along the lift, about its pivot, or as the springs that bear it are bent least."""

from __future__ import annotations

import numpy as np

from flexcam.linalg import FloatArray
from flexcam.train.following import completed
from flexcam.train.model import Adjuster, CamContact, Lash, PublishedLoad
from flexcam.train.springs import spring_row
from flexcam.train.structure import Structure

_SLIGHT = 1e-9
"""Part of a motion that counts as none."""


def borne(structure: Structure, contact: CamContact | PublishedLoad, node: int) -> FloatArray:
    """Return the unit motion along the lift of everything that members connect to a follower's node.

    In the plane of the cam it moves across the lift and turns as its supports ask: a finger about its pivot, each point
    by ``phi x (x - x_pivot)`` (J. L. Meriam and L. G. Kraige, Engineering Mechanics: Dynamics, ch. 5). Where supports
    leave several ways, springs are bent with the least energy, as in balance (C. L. Dym and I. H. Shames, Solid
    Mechanics: A Variational Approach (1973), ch. 3), but for what is behind a play: a finger on a stiff spring under
    its pivot turns about that, and the spring yields by its force over its stiffness. What costs none does not move.
    What supports hold along the lift itself, so that it bends, goes along it in what they leave free.
    """
    numbers = structure.dofs.numbers[structure.model.mesh.connected(node)]
    fields, free = _fields(structure, contact, node), numbers >= 0
    motions = np.zeros((len(fields), structure.dofs.size))
    motions[:, numbers[free]] = fields[:, free]
    asked, ways = _supported(fields[:, ~free])
    if asked is None:
        return motions[0]
    begun, beside = motions[0] + asked @ motions[1:], ways @ motions[1:]
    if not len(beside):
        return begun
    rows = _bent(structure)
    bent = np.array([rows @ completed(structure, one) for one in (begun, *beside)]).T
    return begun + _least(bent[:, 1:], -bent[:, 0]) @ beside


def _fields(structure: Structure, contact: CamContact | PublishedLoad, node: int) -> FloatArray:
    """Return motions of what is joined to a node, shape (k, m, 6): along the lift, across it, turning about the node.

    The last is by the length of it all; a single node does not turn.
    """
    mesh, axis = structure.model.mesh, np.asarray(contact.shaft_axis)
    away = mesh.nodes[mesh.connected(node)] - mesh.nodes[node]
    across = np.concatenate([np.cross(contact.direction[:3], axis), np.zeros(3)], dtype=np.float64)
    turned = np.concatenate([np.cross(axis, away), np.broadcast_to(axis, away.shape)], axis=1, dtype=np.float64)
    length = float(np.linalg.norm(away, axis=1).max())
    shifts = [np.broadcast_to(one, turned.shape) for one in (contact.direction, across)]
    return np.array([*shifts, *([turned / length] if length > 0.0 else [])])


def _supported(held: FloatArray) -> tuple[FloatArray | None, FloatArray]:
    """Return what of other motions supports ask beside the first, and the ways of these that they leave free.

    All are given where supports hold them, shape (k, h); None where they cannot hold still.
    """
    straight, others = held[0], held[1:]
    _, sizes, ways = np.linalg.svd(others.T, full_matrices=True)
    asked = _least(others.T, -straight)
    still = np.abs(straight + asked @ others).max(initial=0.0) <= _SLIGHT
    return asked if still else None, ways[int(np.count_nonzero(sizes > _SLIGHT)) :]


def _least(matrix: FloatArray, wanted: FloatArray) -> FloatArray:
    """Return the smallest amounts of columns that come nearest to what is wanted; rounding is no column."""
    return np.linalg.lstsq(matrix, wanted, rcond=_SLIGHT)[0].astype(np.float64, copy=False)


def _bent(structure: Structure) -> FloatArray:
    """Return the rows of what springs, and plays on what is held, are bent by, by the root of their stiffness."""
    model = structure.model
    rows = [np.sqrt(one.stiffness) * spring_row(structure, name, one) for name, one in model.springs.items()]
    for one in model.contacts.values():
        if isinstance(one, Lash | Adjuster) and one.ends is not None and one.direction is not None:
            ends = [structure.row(end, one.direction) for end in one.ends]
            rows += [np.sqrt(one.stiffness) * (ends[0] - ends[1])] * (not all(end.any() for end in ends))
    return np.array(rows).reshape(-1, structure.dofs.size)
