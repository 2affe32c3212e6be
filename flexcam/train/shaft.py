"""What a camshaft does under its cams: twist and deflection at each, torque at the end that drives it."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import replace

import numpy as np

from flexcam.fem.elements import beam
from flexcam.linalg import FloatArray, IntArray
from flexcam.system import Channel, Load, Observable, Observed, row_of, total
from flexcam.train.coupling import Coupling
from flexcam.train.model import PublishedLoad
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
    for contact in model.driven.values():
        at = model.cams[contact.cam].at
        axis = _turning(contact.shaft_axis)
        if model.mesh.on_members()[model.mesh.node(at)]:
            channels += [
                Channel(f"cams.{contact.cam}.twist", "rad", row_of(structure.row(at, axis))),
                Channel(f"cams.{contact.cam}.deflection", "m", row_of(structure.row(at, contact.direction))),
            ]
    channels += [Channel(name, "N m", _torque(structure, *end)) for name, end in _held_ends(structure)]
    return Coupling(_inertias(structure), (), tuple(channels))


def with_cams_at_ends(structure: Structure, channels: Iterable[Channel]) -> tuple[Channel, ...]:
    """Add to the torque of a held end that of the cams which stand there themselves: no element passes it on.

    Parameters
    ----------
    structure
        The structure.
    channels
        Of the whole system, each shown its own part.

    Returns
    -------
    tuple
        As many, in their order.
    """
    found, model = {one.name: one for one in channels}, structure.model
    for name, (node, _) in _held_ends(structure):
        for contact, driven in model.driven.items():
            felt = driven.cam_torque if isinstance(driven, PublishedLoad) else True
            if felt and model.mesh.node(model.cams[driven.cam].at) == node:
                both = total(found[name].value, found[f"contacts.{contact}.torque"].value)
                found[name] = replace(found[name], value=both)
    return tuple(found.values())


def _held_ends(structure: Structure) -> Iterator[tuple[str, tuple[int, FloatArray]]]:
    """Yield the channel, the node and the axis of every place where a shaft's rotation is held."""
    model = structure.model
    driven: dict[int, FloatArray] = {}
    for contact in model.driven.values():
        nodes = model.mesh.connected(model.mesh.node(model.cams[contact.cam].at))
        driven |= dict.fromkeys(nodes.tolist(), contact.shaft_axis)
    for point, held in model.supports.items():
        for node in model.mesh.select(point).tolist():
            along = driven.get(node, np.zeros(3))
            axis = int(np.argmax(np.abs(along)))
            if abs(float(along[axis])) > _ALONG and ("rx", "ry", "rz")[axis] in held:
                name = point if len(model.mesh.select(point)) == 1 else model.mesh.node_name(node)
                yield f"supports.{name}.torque", (node, along)


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


def _torque(structure: Structure, node: int, axis: FloatArray) -> Observable:
    """Return the torque that holds a node's rotation, from the elements that end there and the bodies on it.

    Modal damping, which couples everything, is left out.
    """
    dofs, damping = structure.dofs, structure.model.damping
    turning = _turning(axis)
    elements, ends = np.nonzero(structure.beams.nodes == node)
    beams = structure.beams.part(elements)
    turned = np.zeros((len(elements), 2, 6))
    turned[np.arange(len(elements)), ends] = turning
    picked = turned.reshape(-1, 1, 12)
    numbers, heavy = dofs.numbers[beams.nodes], picked @ beam.to_global(beams, beam.mass(beams))
    on_d = _assembled(dofs.size, numbers, picked @ beam.to_global(beams, beam.stiffness(beams)))
    on_a = _assembled(dofs.size, numbers, heavy)
    inertia = float(np.sum(heavy @ np.tile(turning, 2)))
    inertia += sum(float(turning @ matrix @ turning) for at, matrix in _bodies(structure) if at == node)
    each = [row[None] for row in (on_d, damping.alpha * on_a + damping.beta * on_d, on_a)]

    def held(seen: Observed) -> FloatArray:
        own = sum(seen.moved.picked(row, order)[:, 0] for order, row in enumerate(each))
        return own + inertia * seen.motion.rate

    return held


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
