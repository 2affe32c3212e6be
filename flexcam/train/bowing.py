"""Geometric stiffness within a run: the shallow arch of `flexcam.fem.elements.shallow` as a local force.

What is beyond the linear ``EA/L D^2/2`` acts: N g (y + y0) on bending, the axial force of the shortening on the chord.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from flexcam.fem import Beams
from flexcam.fem.elements import shallow
from flexcam.linalg import DENSE_LIMIT, FloatArray, IntArray
from flexcam.system import AngleVector, Channel, LocalForce, Observable, Observed, Reaction, Stored, constant
from flexcam.train.buckling import buckling_load
from flexcam.train.coupling import Coupling
from flexcam.train.structure import Structure

_NONE = np.zeros(0)


@dataclass(frozen=True, eq=False)
class Bowing:
    """Local law of some elements side by side.

    Parameters
    ----------
    axial
        EA/L, N/m, shape (e,).
    shortening
        g over (slope, rotations) of both planes, shape (e, 6, 6), m.
    bow
        y0, shape (e, 6).
    """

    axial: FloatArray
    shortening: FloatArray
    bow: FloatArray

    @property
    def start_state(self) -> FloatArray:
        """Nothing."""
        return _NONE

    def axial_force(self, gap: FloatArray) -> FloatArray:
        """Return the axial force of every element, tension positive, N, shape (..., e)."""
        stretch, moved, pulled = self._shape(gap)
        # y.g.(y + 2 y0): the difference of both squares would leave rounding where nothing is bent.
        start = np.einsum("eij,ej->ei", self.shortening, self.bow)
        return self.axial * (stretch + 0.5 * np.einsum("...ei,...ei->...e", moved, pulled + start))

    def _shape(self, gap: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return the stretch, y and g (y + y0)."""
        values = gap.reshape(*gap.shape[:-1], len(self.axial), shallow.SCALARS)
        bent = values[..., 1:] + self.bow
        return values[..., 0], values[..., 1:], np.einsum("eij,...ej->...ei", self.shortening, bent)

    def _force(self, gap: FloatArray) -> FloatArray:
        """Return the forces, shape (..., e, 7)."""
        stretch, _, pulled = self._shape(gap)
        N = self.axial_force(gap)
        force_of_shortening = N - self.axial * stretch
        return np.concatenate([force_of_shortening[..., None], N[..., None] * pulled], axis=-1)

    def respond(self, gap: FloatArray, rate: FloatArray, state: FloatArray, angle: float) -> Reaction:
        """Return force and tangent."""
        e = len(self.axial)
        pulled = self._shape(gap)[2]
        N = self.axial_force(gap)
        by_gap = np.zeros((e, shallow.SCALARS, e, shallow.SCALARS))
        each = np.arange(e)
        across = self.axial[:, None] * pulled
        by_gap[each, 0, each, 1:] = across
        by_gap[each, 1:, each, 0] = across
        by_gap[each, 1:, each, 1:] = N[:, None, None] * self.shortening + across[:, :, None] * pulled[:, None, :]
        size = e * shallow.SCALARS
        return Reaction(self._force(gap).ravel(), by_gap.reshape(size, size), np.zeros((size, size)), _NONE)

    def stored(self, gap: FloatArray, state: FloatArray, angle: FloatArray) -> Stored:
        """Return the energy beyond that of the linear bar and its derivative, per instant."""
        N, stretch = self.axial_force(gap), self._shape(gap)[0]
        energy = 0.5 * np.sum(N**2 / self.axial - self.axial * stretch**2, axis=-1)
        return Stored(energy, self._force(gap).reshape(gap.shape), np.zeros_like(state))


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
    shafts = {node for cam in model.cams.values() for node in model.mesh.connected(model.mesh.node(cam.at)).tolist()}
    first = 0
    for name, member in model.members.items():
        if not member.geometric_stiffness and not shafts.isdisjoint(model.mesh.lines[name].tolist()):
            continue
        elements = np.arange(len(structure.beams))[model.mesh.element_ranges()[name]]
        where = f"members.{name}"
        if member.geometric_stiffness:
            rows, law = _sensed(structure, elements), _law(structure.beams, elements)
            sense = tuple(AngleVector.constant(row) for row in rows)
            act = tuple(AngleVector.constant(-row) for row in rows)
            forces.append(LocalForce(f"{where}.bending", sense, act, law, (constant(0.0),) * len(rows)))
            pressed = _compression(law, slice(first, first + len(rows)))
            first += len(rows)
        else:
            pressed = _linear_compression(structure, elements)
        channels.append(Channel(f"{where}.compression", "N", pressed))
        if 6 * len(elements) <= DENSE_LIMIT and math.isfinite(bearable := buckling_load(structure, name)):
            channels.append(Channel(f"{where}.buckling_use", "1", _part(pressed, bearable)))
    return Coupling((), tuple(forces), tuple(channels))


def _part(value: Observable, whole: float) -> Observable:
    return lambda seen: value(seen) / whole


def _linear_compression(structure: Structure, elements: IntArray) -> Observable:
    rows = np.array([local[6] - local[0] for local in (_ends(structure, e) for e in elements.tolist())])
    stiffness = structure.beams.EA[elements] / structure.beams.length[elements]
    return lambda seen: -(seen.displacement @ rows.T * stiffness).min(axis=1)


def _compression(law: Bowing, part: slice) -> Observable:
    def largest(seen: Observed) -> FloatArray:
        return -law.axial_force(seen.gaps[:, part]).min(axis=-1)

    return largest


def _law(beams: Beams, elements: IntArray) -> Bowing:
    axial = beams.EA[elements] / beams.length[elements]
    return Bowing(axial, shallow.shortening(beams, elements), beams.bow[elements])


def _sensed(structure: Structure, elements: IntArray) -> FloatArray:
    """Return the rows of all scalars, shape (7 e, n)."""
    deforming = shallow.deforming(structure.beams, elements)
    return np.concatenate([D @ _ends(structure, e) for D, e in zip(deforming, elements.tolist(), strict=True)])


def _ends(structure: Structure, e: int) -> FloatArray:
    """Return the rows of an element's twelve local components, shape (12, n)."""
    beams, dofs = structure.beams, structure.dofs
    local = np.zeros((12, dofs.size))
    for end, node in zip((0, 6), beams.nodes[e].tolist(), strict=True):
        for k, axis in enumerate(beams.triads[e]):
            local[end + k] = dofs.vector(node, np.concatenate([axis, np.zeros(3)]))
            local[end + 3 + k] = dofs.vector(node, np.concatenate([np.zeros(3), axis]))
    return local
