"""Geometric stiffness within a run: the shallow arch of `flexcam.fem.elements.shallow` as a local force.

What is beyond the linear ``EA/L D^2/2`` acts: N g (y + y0) on bending, the axial force of the shortening on the chord.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from flexcam.fem.elements.shallow import SCALARS, Arch, deforming
from flexcam.linalg import DENSE_LIMIT, FloatArray, IntArray
from flexcam.system import Channel, Formula, Kind, LocalForce, Observable, Observed, Reaction, Stored
from flexcam.train.buckling import buckling_load
from flexcam.train.compression import Bars, compressed, elements_of, linear_compression
from flexcam.train.coupling import Coupling, opposed
from flexcam.train.penalty import Stateless
from flexcam.train.structure import Structure


@dataclass(frozen=True, eq=False)
class Bowing(Stateless):
    """Local law of some elements side by side; it senses the seven scalars of each, one element after the other.

    Parameters
    ----------
    arch
        The elements.
    """

    arch: Arch

    def respond(self, gap: FloatArray, rate: FloatArray, state: FloatArray, angle: float) -> Reaction:
        """Return force and tangent."""
        values = _by_element(gap)
        e, each = len(values), np.arange(len(values))
        by_gap = np.zeros((e, SCALARS, e, SCALARS))
        force, by_gap[each, :, each, :] = self.arch.answer(values)
        return Reaction(force.ravel(), by_gap.reshape(gap.size, gap.size), np.zeros((gap.size, gap.size)))

    def formulas(self, count: int) -> tuple[Formula, ...]:
        """Return the law as data, element by element."""
        arch = self.arch
        pulled = np.einsum("eij,ej->ei", arch.shortening, arch.bow)
        shapes = [
            np.concatenate([[arch.axial[e]], arch.shortening[e].ravel(), arch.bow[e], pulled[e]])
            for e in range(count // SCALARS)
        ]
        return tuple(Formula(Kind.ARCH, tuple(shape.tolist()), scalars=SCALARS) for shape in shapes)

    def idle(self) -> tuple[IntArray, ...]:
        """Return, by element and plane, the scalars of bending: a strut without a bow stays straight if left alone."""
        planes = 1 + np.arange(SCALARS - 1).reshape(2, -1)
        return tuple(
            SCALARS * e + plane for e, bow in enumerate(self.arch.bow) for plane in planes if not bow[plane - 1].any()
        )

    def stored(self, gap: FloatArray, state: FloatArray, angle: FloatArray) -> Stored:
        """Return the energy beyond that of the linear bar and its derivative, per instant."""
        forces = self.arch.forces(_by_element(gap))
        return Stored(self.energy(gap), forces.reshape(gap.shape), np.zeros_like(state))

    def energy(self, gap: FloatArray) -> FloatArray:
        """Return the energy alone: the force is a polynomial of the third degree."""
        return self.arch.energy(_by_element(gap))


def _by_element(gap: FloatArray) -> FloatArray:
    """Return the scalars by element, shape (..., e, 7)."""
    return gap.reshape(*gap.shape[:-1], gap.shape[-1] // SCALARS, SCALARS)


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
            rows, law = _sensed(structure, elements), Bowing(Arch.of(structure.beams, elements))
            forces.append(opposed(f"{where}.bending", rows, law))
            pressed = _compression(law, slice(first, first + len(rows)))
            first += len(rows)
        else:
            pressed = linear_compression(Bars(structure, elements))
        channels.append(Channel(f"{where}.compression", "N", pressed))
        if 6 * len(elements) <= DENSE_LIMIT and math.isfinite(bearable := buckling_load(structure, name)):
            channels.append(Channel(f"{where}.buckling_use", "1", _part(pressed, bearable)))
    return Coupling((), tuple(forces), tuple(channels))


def _part(value: Observable, whole: float) -> Observable:
    return lambda seen: value(seen) / whole


def _compression(law: Bowing, part: slice) -> Observable:
    stretches = slice(part.start, part.stop, SCALARS)

    def largest(seen: Observed) -> FloatArray:
        # What acts on a stretch is the axial force beyond that of the straight bar.
        return -(law.arch.axial * seen.gaps[:, stretches] + seen.forces[:, stretches]).min(axis=-1)

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
