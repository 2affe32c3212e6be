"""What a camshaft does under its cams: twist and deflection at each; its inertia while its speed changes."""

from __future__ import annotations

import numpy as np

from flexcam.fem.elements import beam
from flexcam.linalg import FloatArray, IntArray
from flexcam.system import Channel, Load, row_of
from flexcam.train.coupling import Coupling
from flexcam.train.structure import Structure


def shafts(structure: Structure) -> Coupling:
    """Return the channels of the camshafts."""
    model = structure.model
    channels: list[Channel] = []
    for contact in model.driven.values():
        at = model.cams[contact.cam].at
        axis = _turning(contact.shaft_axis)
        if model.mesh.on_members()[model.mesh.node(at)]:
            channels += [
                Channel(f"cams.{contact.cam}.twist", "rad", row_of(structure.row(at, axis))),
                Channel(f"cams.{contact.cam}.deflection", "m", row_of(structure.row(at, contact.direction))),
            ]
    return Coupling(_inertias(structure), (), tuple(channels))


def _bodies(structure: Structure) -> list[tuple[int, FloatArray]]:
    """Return node and mass matrix (6, 6), global axes, of every body at a node."""
    on_nodes = [part for part in structure.model.masses.values() if structure.is_node(part.at)]
    return [(structure.model.mesh.node(part.at), part.body.matrix()) for part in on_nodes]


def _inertias(structure: Structure) -> tuple[Load, ...]:
    mesh = structure.model.mesh
    shafts: dict[int, Load] = {}
    for contact in structure.model.driven.values():
        nodes = mesh.connected(mesh.node(structure.model.cams[contact.cam].at))
        if int(nodes[0]) not in shafts:
            shafts[int(nodes[0])] = _inertia(structure, nodes, contact.shaft_axis)
    return tuple(shafts.values())


def _inertia(structure: Structure, nodes: IntArray, axis: FloatArray) -> Load:
    """Return the load of a shaft's rotary inertia while its speed changes: unknowns turn with the shaft."""
    dofs, turning = structure.dofs, _turning(axis)
    beams = structure.beams.part(np.flatnonzero(np.isin(structure.beams.nodes[:, 0], nodes)))
    pulled = beam.to_global(beams, beam.mass(beams)) @ np.tile(turning, 2)
    vector = _assembled(dofs.size, dofs.numbers[beams.nodes], pulled)
    for at, matrix in _bodies(structure):
        if at in nodes:
            vector = vector + _assembled(dofs.size, dofs.numbers[at], matrix @ turning)
    return Load(f"shaft of {structure.model.mesh.node_name(int(nodes[0]))}", -vector, lambda motion: motion.rate)


def _turning(axis: FloatArray) -> FloatArray:
    """Return the six components of a node that turns with a shaft."""
    return np.concatenate([np.zeros(3), axis])


def _assembled(size: int, numbers: IntArray, values: FloatArray) -> FloatArray:
    """Return a vector of values at numbered unknowns, shape (size,); those that are held have no number."""
    free = numbers.ravel() >= 0
    vector = np.zeros(size)
    np.add.at(vector, numbers.ravel()[free], values.ravel()[free])
    return vector
