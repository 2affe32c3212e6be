"""How a rigid follower moves that springs bear where another has a support: as they are bent least."""

from __future__ import annotations

import numpy as np

from flexcam.linalg import FloatArray
from flexcam.train.following import completed, shifted
from flexcam.train.model import Adjuster, CamContact, Lash, PublishedLoad
from flexcam.train.springs import spring_row
from flexcam.train.structure import Structure

_FREE = 1e-9
"""Motion of what supports hold, as a part of the largest, that counts as none."""


def borne(structure: Structure, contact: CamContact | PublishedLoad, node: int) -> FloatArray:
    """Return the unit motion along the lift of a follower's member that turns and swings aside as its springs make it.

    Its cam gives the motion of one node along the lift. Where supports leave a turning in the plane of the cam, or a
    motion across the lift, the springs are bent with the least energy: in balance, but for what is behind a play. A
    finger on a stiff spring under its pivot turns about that; the spring yields by its force over its stiffness. What
    costs no energy does not move. Minimum potential energy: C. L. Dym and I. H. Shames, Solid Mechanics: A Variational
    Approach (1973), ch. 3.

    Parameters
    ----------
    structure
        The structure.
    contact
        Of cam and follower.
    node
        Of the follower.

    Returns
    -------
    ndarray
        Shape (n,).
    """
    straight, beside = shifted(structure, node, contact.direction), _beside(structure, contact, node)
    if not beside:
        return straight
    rows = _bent(structure)
    bent = np.array([rows @ completed(structure, one) for one in (straight, *beside)]).T
    # Rounding of what costs nothing is no energy.
    amounts = np.linalg.lstsq(bent[:, 1:], -bent[:, 0], rcond=_FREE)[0]
    return straight + amounts @ np.array(beside)


def _beside(structure: Structure, contact: CamContact | PublishedLoad, node: int) -> list[FloatArray]:
    """Return the motions of a follower's member in the plane of its cam that supports leave it, its node not lifting.

    Moving across the lift and turning about its node, by its own length: both, one, what is left of both, or none.
    """
    mesh, numbers = structure.model.mesh, structure.dofs.numbers
    moved, axis = mesh.connected(node), np.asarray(contact.shaft_axis)
    across = np.concatenate([np.cross(contact.direction[:3], axis), np.zeros(3)])
    away = mesh.nodes[moved] - mesh.nodes[node]
    length = float(np.linalg.norm(away, axis=1).max())
    if length == 0.0:
        return []
    turned = np.concatenate([np.cross(axis, away), np.broadcast_to(axis, away.shape)], axis=1) / length
    fields = np.array([np.broadcast_to(across, turned.shape), turned])
    free = numbers[moved] >= 0
    _, sizes, ways = np.linalg.svd(fields[:, ~free].T, full_matrices=True)
    left = ways[int(np.count_nonzero(sizes > _FREE)) :]
    motions: list[FloatArray] = []
    for field in np.tensordot(left, fields, axes=1):
        motions.append(np.zeros(structure.dofs.size))
        motions[-1][numbers[moved][free]] = field[free]
    return motions


def _bent(structure: Structure) -> FloatArray:
    """Return the rows of what springs, and plays on what is held, are bent by, by the root of their stiffness."""
    model = structure.model
    rows = [np.sqrt(one.stiffness) * spring_row(structure, name, one) for name, one in model.springs.items()]
    for one in model.contacts.values():
        if isinstance(one, Lash | Adjuster) and one.ends is not None and one.direction is not None:
            ends = [structure.row(end, one.direction) for end in one.ends]
            rows += [np.sqrt(one.stiffness) * (ends[0] - ends[1])] * (not all(end.any() for end in ends))
    return np.array(rows).reshape(-1, structure.dofs.size)
