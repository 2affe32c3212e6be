"""What a camshaft does under its cams: twist and deflection at each, torque at the end that drives it."""

from __future__ import annotations

import numpy as np

from flexcam.fem.elements import beam
from flexcam.linalg import FloatArray
from flexcam.system import Channel, Observable, Observed, row_of
from flexcam.train.coupling import Coupling
from flexcam.train.structure import Structure

_ALONG = 0.9
"""Cosine from which on a held rotation is one about the shaft."""


def shafts(structure: Structure) -> Coupling:
    """Return the channels of the camshafts.

    Parameters
    ----------
    structure
        The structure.

    Returns
    -------
    Coupling
        ``cams.NAME.twist`` (about the sense of rotation) and ``cams.NAME.deflection`` (along the lift) of every cam
        that drives something; ``supports.NAME.torque`` wherever the shaft's rotation is held: what its drive must give.
    """
    model = structure.model
    channels: list[Channel] = []
    driven: dict[int, FloatArray] = {}
    for contact in model.driven.values():
        at = model.cams[contact.cam].at
        axis = np.concatenate([np.zeros(3), contact.shaft_axis])
        channels += [
            Channel(f"cams.{contact.cam}.twist", "rad", row_of(structure.row(at, axis))),
            Channel(f"cams.{contact.cam}.deflection", "m", row_of(structure.row(at, contact.direction))),
        ]
        driven |= dict.fromkeys(model.mesh.connected(model.mesh.node(at)).tolist(), contact.shaft_axis)
    for point, held in model.supports.items():
        for node in model.mesh.select(point).tolist():
            along = driven.get(node, np.zeros(3))
            axis = int(np.argmax(np.abs(along)))
            if abs(float(along[axis])) > _ALONG and ("rx", "ry", "rz")[axis] in held:
                name = point if len(model.mesh.select(point)) == 1 else model.mesh.node_name(node)
                channels.append(Channel(f"supports.{name}.torque", "N m", _torque(structure, node, along)))
    return Coupling((), (), tuple(channels))


def _torque(structure: Structure, node: int, axis: FloatArray) -> Observable:
    """Return the torque that holds a node's rotation, from the elements that end there."""
    beams, dofs = structure.beams, structure.dofs
    stiff, heavy = (beam.to_global(beams, matrix) for matrix in (beam.stiffness(beams), beam.mass(beams)))
    on_d, on_a = np.zeros(dofs.size), np.zeros(dofs.size)
    for e, end in np.argwhere(beams.nodes == node).tolist():
        turned = np.zeros(12)
        turned[6 * end + 3 : 6 * end + 6] = axis
        numbers = dofs.numbers[beams.nodes[e]].ravel()
        free = numbers >= 0
        on_d[numbers[free]] += (turned @ stiff[e])[free]
        on_a[numbers[free]] += (turned @ heavy[e])[free]

    def held(seen: Observed) -> FloatArray:
        return seen.displacement @ on_d + seen.acceleration @ on_a

    return held
