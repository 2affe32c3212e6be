"""The torque that a shaft's drive must give: what holds its rotation, in balance with everything that acts there.

A support takes its components out of the unknowns, and with them every load and force there. So the held rotations are
freed once more, in a structure made for nothing else: its rows say what elements, springs, bodies, loads and contacts
do to them, and the torque is what is missing in their equation of motion.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from flexcam.fem import ROTATIONS
from flexcam.fem.damping import rayleigh_damping
from flexcam.linalg import FloatArray, IntArray
from flexcam.system import AngleVector, Load, LocalForce, Observable, Observed
from flexcam.train.assembled import structure_in
from flexcam.train.model import Adjuster, CamContact, Contact, Lash, PublishedLoad, Seat
from flexcam.train.structure import Structure

_ALONG = 0.9
"""Cosine from which on a held rotation is one about the shaft."""


@dataclass(frozen=True, eq=False)
class HeldEnd:
    """A place where a shaft's rotation is held.

    Parameters
    ----------
    name
        Of the support or the node.
    node
        Its number.
    freed
        The structure with the held rotations of that node free.
    kept
        Places of the structure's own unknowns among those of `freed`, shape (n,).
    turned
        Unit rotation about the shaft in what is freed, shape (n of `freed`,).
    """

    name: str
    node: int
    freed: Structure
    kept: IntArray
    turned: FloatArray

    @property
    def bends(self) -> bool:
        """Whether a member with geometric stiffness ends there or passes."""
        model = self.freed.model
        return any(one.geometric_stiffness and self.node in model.mesh.lines[n] for n, one in model.members.items())

    @property
    def levers(self) -> bool:
        """Whether it drives a lever."""
        return self._is_at(*(one.start for one in self.freed.model.levers.values()))

    @property
    def springs(self) -> bool:
        """Whether a spring ends there."""
        return self._is_at(*(end for one in self.freed.model.springs.values() for end in (one.at, one.to) if end))

    def bears(self, contact: Contact) -> bool:
        """Tell whether a contact stands at this node and twists it: the published load only if it is said to."""
        model = self.freed.model
        match contact:
            case PublishedLoad():
                return contact.cam_torque and self._is_at(model.cams[contact.cam].at)
            case CamContact():
                return self._is_at(model.cams[contact.cam].at, contact.follower)
            case Seat():
                return self._is_at(contact.at)
            case Lash() | Adjuster():
                on = [model.rockers[contact.rocker].start] if contact.rocker else []
                return self._is_at(*(contact.ends or ()), *on)

    def _is_at(self, *points: str) -> bool:
        """Tell whether one of some named points is this node."""
        named = self.freed.model.mesh.points
        return any(self.node in named[point] for point in points if point in named)


def held_ends(structure: Structure) -> tuple[HeldEnd, ...]:
    """Return every place where a shaft's rotation is held."""
    return tuple(_freed(structure, *end) for end in _found(structure))


def _found(structure: Structure) -> Iterator[tuple[str, int, FloatArray]]:
    """Yield name, node and axis of every place where a shaft's rotation is held."""
    model = structure.model
    driven: dict[int, FloatArray] = {}
    for contact in model.driven.values():
        nodes = model.mesh.connected(model.mesh.node(model.cams[contact.cam].at))
        driven |= dict.fromkeys(nodes.tolist(), contact.shaft_axis)
    for point, held in model.supports.items():
        for node in model.mesh.select(point).tolist():
            along = driven.get(node, np.zeros(3))
            axis = int(np.argmax(np.abs(along)))
            if abs(float(along[axis])) > _ALONG and ROTATIONS[axis] in held:
                yield point if len(model.mesh.select(point)) == 1 else model.mesh.node_name(node), node, along


def _freed(structure: Structure, name: str, node: int, along: FloatArray) -> HeldEnd:
    held = 3 + np.flatnonzero(structure.dofs.numbers[node, 3:] < 0)
    dofs = structure.dofs.freed(node, held, name)
    new = dofs.numbers[node, held]
    turned = np.zeros(dofs.size)
    turned[new] = along[held - 3]
    return HeldEnd(name, node, structure_in(structure.model, dofs), np.delete(np.arange(dofs.size), new), turned)


def missing(end: HeldEnd) -> Observable:
    """Return what mass, damping and stiffness ask of a held rotation; modal damping, which couples all, is left out."""
    freed, damping = end.freed, end.freed.model.damping
    damped = freed.dampers + rayleigh_damping(freed.mass, freed.stiffness, damping.alpha, damping.beta)
    each = [matrix.times(end.turned)[end.kept][None] for matrix in (freed.stiffness, damped, freed.mass)]

    def asked(seen: Observed) -> FloatArray:
        return sum((seen.moved.picked(row, order)[:, 0] for order, row in enumerate(each)), np.zeros(1))

    return asked


def taken(end: HeldEnd, loads: tuple[Load, ...], forces: tuple[LocalForce, ...]) -> Observable:
    """Return what loads and local forces of the freed structure leave a held rotation to bear."""
    pushed = np.array([end.turned @ load.vector for load in loads])
    acting = [one for force in forces for one in force.act]
    turning = [(i, AngleVector((one.vectors @ end.turned)[:, None], one.functions)) for i, one in enumerate(acting)]
    turning = [(i, one) for i, one in turning if one.vectors.any()]

    def borne(seen: Observed) -> FloatArray:
        found = -(seen.histories @ pushed)
        for i, one in turning:
            weights = [seen.cam(function, 0) for function in one.functions] or [np.ones(len(found))]
            found -= seen.forces[:, i] * (one.vectors[:, 0] @ np.array(weights))
        return found

    return borne
