"""What a camshaft does under its cams: twist and deflection at each, torque at the end that drives it."""

from __future__ import annotations

import numpy as np

from flexcam.fem.elements import beam
from flexcam.linalg import FloatArray, IntArray
from flexcam.system import Channel, Load, Observable, Observed, row_of
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
    return Coupling(_inertias(structure), (), tuple(channels))


def _inertias(structure: Structure) -> tuple[Load, ...]:
    mesh = structure.model.mesh
    shafts: dict[int, Load] = {}
    for contact in structure.model.driven.values():
        nodes = mesh.connected(mesh.node(structure.model.cams[contact.cam].at))
        if int(nodes[0]) not in shafts:
            shafts[int(nodes[0])] = _inertia(structure, nodes, contact.shaft_axis)
    return tuple(shafts.values())


def _torque(structure: Structure, node: int, axis: FloatArray) -> Observable:
    """Return the torque that holds a node's rotation, from the elements that end there and the bodies on it.

    Modal damping, which couples everything, is left out.
    """
    stiff, heavy = _global(structure)
    beams, dofs, damping = structure.beams, structure.dofs, structure.model.damping
    on_d, on_a, inertia = np.zeros(dofs.size), np.zeros(dofs.size), 0.0
    turning = np.tile(np.concatenate([np.zeros(3), axis]), 2)
    for e, end in np.argwhere(beams.nodes == node).tolist():
        turned = np.zeros(12)
        turned[6 * end + 3 : 6 * end + 6] = axis
        numbers = dofs.numbers[beams.nodes[e]].ravel()
        free = numbers >= 0
        on_d[numbers[free]] += (turned @ stiff[e])[free]
        on_a[numbers[free]] += (turned @ heavy[e])[free]
        inertia += float(turned @ heavy[e] @ turning)
    for part in structure.model.masses.values():
        if structure.is_node(part.at) and structure.model.mesh.node(part.at) == node:
            inertia += float(turning[:6] @ part.body.matrix() @ turning[:6])
    on_v = damping.alpha * on_a + damping.beta * on_d

    def held(seen: Observed) -> FloatArray:
        own = seen.displacement @ on_d + seen.velocity @ on_v + seen.acceleration @ on_a
        return own + inertia * seen.motion.rate

    return held


def _global(structure: Structure) -> tuple[FloatArray, FloatArray]:
    """Return stiffness and mass of every element, shape (e, 12, 12), global axes."""
    beams = structure.beams
    return beam.to_global(beams, beam.stiffness(beams)), beam.to_global(beams, beam.mass(beams))


def _inertia(structure: Structure, nodes: IntArray, axis: FloatArray) -> Load:
    """Return the load of a shaft's rotary inertia while its speed changes: unknowns turn with the shaft."""
    beams, dofs = structure.beams, structure.dofs
    turning = np.concatenate([np.zeros(3), axis])
    heavy = _global(structure)[1]
    vector = np.zeros(dofs.size)
    for e in np.flatnonzero(np.isin(beams.nodes[:, 0], nodes)).tolist():
        numbers = dofs.numbers[beams.nodes[e]].ravel()
        free = numbers >= 0
        vector[numbers[free]] -= (heavy[e] @ np.tile(turning, 2))[free]
    for part in structure.model.masses.values():
        if structure.is_node(part.at) and structure.model.mesh.node(part.at) in nodes:
            node = structure.model.mesh.node(part.at)
            numbers = dofs.numbers[node]
            vector[numbers[numbers >= 0]] -= (part.body.matrix() @ turning)[numbers >= 0]
    return Load(f"shaft of {structure.model.mesh.node_name(int(nodes[0]))}", vector, lambda motion: motion.rate)
