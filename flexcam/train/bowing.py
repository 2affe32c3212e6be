"""Geometric stiffness within a run: the shallow arch of `flexcam.fem.elements.shallow` as a local force.

What is beyond the linear ``EA/L D^2/2`` acts: N g (y + y0) on bending, the axial force of the shortening on the chord.
"""

from __future__ import annotations

import math

import numpy as np

from flexcam.fem.elements.shallow import SCALARS, Arch, deforming
from flexcam.linalg import DENSE_LIMIT, FloatArray, IntArray
from flexcam.system import Channel, ForceLaw, LocalForce, Observable, Observed
from flexcam.system.force_laws import ARCH
from flexcam.train.buckling import buckling_load
from flexcam.train.compression import Bars, compressed, elements_of, linear_compression
from flexcam.train.coupling import Coupling, opposed
from flexcam.train.structure import Structure


def arch_laws(arch: Arch) -> list[ForceLaw]:
    """Return the laws of some shallow arches beyond their straight bars and beams, element by element.

    Parameters
    ----------
    arch
        The elements.

    Returns
    -------
    list
        `flexcam.system.force_laws.arch`, which senses the seven scalars of an element.
    """
    pulled = np.einsum("eij,ej->ei", arch.shortening, arch.bow)
    parts = zip(arch.axial, arch.shortening, arch.bow, pulled, strict=True)
    return [ForceLaw(ARCH, (float(axial), *g.ravel().tolist(), *bow.tolist(), *pull.tolist()))
            for axial, g, bow, pull in parts]  # fmt: skip


def bowings(structure: Structure) -> Coupling:
    """Return the geometric stiffness of the members that ask for it, and the compression of all that carry no cam.

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
    for name in compressed(model):
        elements = elements_of(structure, name)
        where = f"members.{name}"
        if model.members[name].geometric_stiffness:
            rows, arch = _sensed(structure, elements), Arch.of(structure.beams, elements)
            pairs = zip(np.split(rows, len(elements)), arch_laws(arch), strict=True)
            forces += [opposed(f"{where}.bending", part, law) for part, law in pairs]
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

    def largest(seen: Observed) -> FloatArray:
        # What acts on a stretch is the axial force beyond that of the straight bar.
        return -(arch.axial * seen.gaps[:, stretches] + seen.forces[:, stretches]).min(axis=-1)

    return largest


def _sensed(structure: Structure, elements: IntArray) -> FloatArray:
    """Return the rows of all scalars, shape (7 e, n)."""
    each = zip(deforming(structure.beams, elements), elements.tolist(), strict=True)
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
