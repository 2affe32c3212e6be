"""Compression and geometric stiffness of members."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from flexcam.core import DENSE_LIMIT, FloatArray, IntArray
from flexcam.dynamics import Channel, ForceLaw, LocalForce, Observable, Observation
from flexcam.dynamics.force_laws import ARCH
from flexcam.fem.elements.arch import SCALARS, Arch, deformation_matrix
from flexcam.valvetrain.buckling import buckling_load
from flexcam.valvetrain.contacts import Coupling, opposed_force
from flexcam.valvetrain.model import Model
from flexcam.valvetrain.structure import Structure


def compressed_members(model: Model) -> list[str]:
    """Return the members with a compression channel: all without a cam, and those with geometric stiffness."""
    shafts = {
        node for cam in model.cams.values() for node in model.mesh.connected_nodes(model.mesh.node(cam.at)).tolist()
    }
    return [
        name for name, member in model.members.items()
        if member.geometric_stiffness or shafts.isdisjoint(model.mesh.lines[name].tolist())
    ]  # fmt: skip


def elements_of(structure: Structure, member: str) -> IntArray:
    """Return the positions of a member's elements, shape (e,)."""
    return np.arange(len(structure.beams))[structure.model.mesh.element_ranges()[member]]


@dataclass(frozen=True, eq=False)
class Bars:
    """Some elements as straight bars.

    Parameters
    ----------
    structure
        The structure.
    elements
        Indices of the elements, shape (e,).
    """

    structure: Structure
    elements: IntArray

    @property
    def stiffness(self) -> FloatArray:
        """EA/L, N/m, shape (e,)."""
        beams = self.structure.beams.part(self.elements)
        return beams.EA / beams.length

    def tension(self, moved: FloatArray) -> FloatArray:
        """Return the axial force, N, tension positive, shape (m, e), of displacements of all unknowns, shape (m, n)."""
        found = np.zeros((len(moved), len(self.elements)))
        for at, force in self._ends:
            found += moved[:, at] * force
        return found

    def rows(self) -> FloatArray:
        """Return the tension by all unknowns, shape (e, n)."""
        rows = np.zeros((len(self.elements), self.structure.dofs.size))
        for at, force in self._ends:
            rows[np.arange(len(self.elements)), at] += force
        return rows

    @cached_property
    def _ends(self) -> list[tuple[IntArray, FloatArray]]:
        """Unknowns with an effect on the tension, shape (e,), and the tension per unit of each, shape (e,)."""
        beams, dofs = self.structure.beams.part(self.elements), self.structure.dofs
        numbers, along = dofs.numbers[beams.nodes, :3], beams.triads[:, 0]
        pulled = self.stiffness[:, None, None] * np.where(numbers >= 0, np.stack([-along, along], axis=1), 0.0)
        return [(numbers[:, i, j], pulled[:, i, j]) for i, j in np.argwhere(pulled.any(axis=0)).tolist()]


def linear_compression(bars: Bars) -> Observable:
    """Return the largest compression of some elements, N, from the motion of their ends along them."""
    if bars.structure.dofs.size > DENSE_LIMIT:
        return lambda seen: -bars.tension(seen.displacement).min(axis=1)
    rows = bars.rows()
    return lambda seen: -seen.moved.extract(rows).min(axis=1)


def arch_laws(arch: Arch) -> list[ForceLaw]:
    """Return the laws of some shallow arches beyond their straight bars and beams, element by element.

    Parameters
    ----------
    arch
        The elements.

    Returns
    -------
    list
        `flexcam.dynamics.force_laws.arch`, with the seven deformation parameters of an element.
    """
    pulled = np.einsum("eij,ej->ei", arch.shortening, arch.bow)
    parts = zip(arch.axial, arch.shortening, arch.bow, pulled, strict=True)
    return [ForceLaw(ARCH, (float(axial), *g.ravel().tolist(), *bow.tolist(), *pull.tolist()))
            for axial, g, bow, pull in parts]  # fmt: skip


def geometric_stiffness_forces(structure: Structure) -> Coupling:
    """Return the geometric stiffness forces and the compression channels of members.

    Parameters
    ----------
    structure
        The structure.

    Returns
    -------
    Coupling
        A local force per member with geometric stiffness. Channels: ``members.NAME.compression``, the largest of its
        elements, and where the member can buckle ``members.NAME.buckling_use``, the same by its buckling load.
    """
    forces: list[LocalForce] = []
    channels: list[Channel] = []
    model = structure.model
    first = 0
    for name in compressed_members(model):
        elements = elements_of(structure, name)
        where = f"members.{name}"
        if model.members[name].geometric_stiffness:
            rows, arch = _deformation_rows(structure, elements), Arch.of(structure.beams, elements)
            pairs = zip(np.split(rows, len(elements)), arch_laws(arch), strict=True)
            forces += [opposed_force(f"{where}.bending", part, law) for part, law in pairs]
            pressed = _compression(arch, slice(first, first + len(rows)))
            first += len(rows)
        else:
            pressed = linear_compression(Bars(structure, elements))
        channels.append(Channel(f"{where}.compression", "N", pressed))
        if 6 * len(elements) <= DENSE_LIMIT and math.isfinite(bearable := buckling_load(structure, name)):
            channels.append(Channel(f"{where}.buckling_use", "1", _part(pressed, bearable)))
    return Coupling((), tuple(forces), tuple(channels))


def _part(value: Observable, whole: float) -> Observable:
    return lambda seen: value(seen) / whole


def _compression(arch: Arch, part: slice) -> Observable:
    stretches = slice(part.start, part.stop, SCALARS)

    def largest(seen: Observation) -> FloatArray:
        # The force on the elongation is the axial force beyond that of the linear bar.
        return -(arch.axial * seen.penetrations[:, stretches] + seen.forces[:, stretches]).min(axis=-1)

    return largest


def _deformation_rows(structure: Structure, elements: IntArray) -> FloatArray:
    """Return the rows of all scalars, shape (7 e, n)."""
    each = zip(deformation_matrix(structure.beams, elements), elements.tolist(), strict=True)
    return np.concatenate([D @ _ends(structure, e) for D, e in each])


def _ends(structure: Structure, e: int) -> FloatArray:
    """Return the rows of an element's twelve local components, shape (12, n)."""
    beams, dofs = structure.beams, structure.dofs
    local = np.zeros((12, dofs.size))
    for end, node in zip((0, 6), beams.nodes[e].tolist(), strict=True):
        for k, axis in enumerate(beams.triads[e]):
            local[end + k] = dofs.vector(node, np.concatenate([axis, np.zeros(3)]))
            local[end + 3 + k] = dofs.vector(node, np.concatenate([np.zeros(3), axis]))
    return local
