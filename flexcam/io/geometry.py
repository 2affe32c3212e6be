"""The drawn geometry of a model: every member a polyline with points of its own, every other node that moves a vertex.

A joint can so carry the section forces of each member that meets there.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from flexcam.fem import Beams, Damping, DofMap, Mesh, Section
from flexcam.fem.recovery import Fibres, fibres, section_forces
from flexcam.linalg import FloatArray, IntArray

RECOVERED = {
    "section_force": ("N", 3),
    "section_moment": ("N m", 3),
    "stress_axial": ("Pa", 1),
    "stress_bending": ("Pa", 1),
    "stress_torsion": ("Pa", 1),
    "stress_von_mises": ("Pa", 1),
}
"""Point data that follow from the displacements: unit and width. Forces are N, Vy, Vz and T, My, Mz in local axes."""


@dataclass(frozen=True, eq=False)
class Geometry:
    """Points, polylines and what is drawn on them.

    Parameters
    ----------
    mesh
        The mesh.
    dofs, beams
        Numbering and elements, to spread and recover fields.
    sections
        Member name to its section.
    spread
        Loads spread over the elements, shape (e, 12), local axes, N and N m.
    damping
        Damping of the structure, of which the elements bear Rayleigh's.
    """

    mesh: Mesh
    dofs: DofMap
    beams: Beams
    sections: Mapping[str, Section]
    spread: FloatArray
    damping: Damping

    @cached_property
    def node(self) -> IntArray:
        """Mesh node of every point, shape (points,): the members' chains one after the other, then `single`."""
        return np.concatenate([*self.mesh.lines.values(), self.single])

    @cached_property
    def single(self) -> IntArray:
        """Nodes on no member that move, shape (k,)."""
        return np.flatnonzero((self.dofs.numbers >= 0).any(axis=1) & ~self.mesh.on_members())

    @cached_property
    def ends(self) -> IntArray:
        """First point of every member and, last, the number of their points, shape (members + 1,)."""
        return np.cumsum([0, *(len(line) for line in self.mesh.lines.values())])

    def cells(self) -> IntArray:
        """Return the number of the member of every cell, vertices first, for which it is -1."""
        return np.concatenate([np.full(len(self.single), -1), np.arange(len(self.mesh.lines))])

    def radius(self) -> FloatArray:
        """Return the drawn radius at every point, m, shape (points,); zero at a vertex."""
        radii = [np.full(len(line), self.sections[name].radius) for name, line in self.mesh.lines.items()]
        return np.concatenate([*radii, np.zeros(len(self.single))])

    def axes(self) -> FloatArray:
        """Return the local axes at every point, those of the element that begins there, shape (points, 3, 3).

        Those of a vertex are the global ones.
        """
        along = [
            self.beams.triads[part][np.minimum(np.arange(len(line)), len(line) - 2)]
            for line, part in zip(self.mesh.lines.values(), self.mesh.element_ranges().values(), strict=True)
        ]
        return np.concatenate([*along, np.tile(np.eye(3), (len(self.single), 1, 1))])

    @cached_property
    def fibres(self) -> Fibres:
        """Return the fibres of all elements."""
        counts = [len(line) - 1 for line in self.mesh.lines.values()]
        return fibres([s for name, n in zip(self.mesh.lines, counts, strict=True) for s in [self.sections[name]] * n])

    def recovered(self, nodal: FloatArray, velocity: FloatArray, acceleration: FloatArray) -> dict[str, FloatArray]:
        """Return section forces and stresses at the points."""
        forces = section_forces(
            self.beams, nodal, velocity=velocity, acceleration=acceleration, damping=self.damping, spread=self.spread
        )
        fibre = self.fibres
        return {
            "section_force": self._at_points(forces[..., :3]),
            "section_moment": self._at_points(forces[..., 3:]),
            "stress_axial": self._at_points(fibre.axial(forces)),
            "stress_bending": self._at_points(fibre.bending(forces)),
            "stress_torsion": self._at_points(fibre.shear(forces)),
            "stress_von_mises": self._at_points(fibre.von_mises(forces)),
        }

    def _at_points(self, values: FloatArray) -> FloatArray:
        """Return the larger of the element ends that meet at a point, from values of shape (times, e, 2, ...)."""
        out = np.zeros((len(values), len(self.node), *values.shape[3:]))
        for first, part in zip(self.ends[:-1].tolist(), self.mesh.element_ranges().values(), strict=True):
            count = part.stop - part.start
            for end in (0, 1):
                points = slice(first + end, first + end + count)
                there = values[:, part, end]
                out[:, points] = np.where(np.abs(there) > np.abs(out[:, points]), there, out[:, points])
        return out
