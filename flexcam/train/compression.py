"""The compression of the members of a train, as of straight bars."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from flexcam.linalg import DENSE_LIMIT, FloatArray, IntArray
from flexcam.system import Observable
from flexcam.train.model import Model
from flexcam.train.structure import Structure


def compressed(model: Model) -> list[str]:
    """Return the members whose compression is told: all that carry no cam, and those with geometric stiffness."""
    shafts = {node for cam in model.cams.values() for node in model.mesh.connected(model.mesh.node(cam.at)).tolist()}
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
        Which of its elements, shape (e,).
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
        """Unknowns that pull on the elements, shape (e,), and the tension of each by one, shape (e,)."""
        beams, dofs = self.structure.beams.part(self.elements), self.structure.dofs
        numbers, along = dofs.numbers[beams.nodes, :3], beams.triads[:, 0]
        pulled = self.stiffness[:, None, None] * np.where(numbers >= 0, np.stack([-along, along], axis=1), 0.0)
        return [(numbers[:, i, j], pulled[:, i, j]) for i, j in np.argwhere(pulled.any(axis=0)).tolist()]


def linear_compression(bars: Bars) -> Observable:
    """Return the largest compression of some elements, N, from the motion of their ends along them."""
    if bars.structure.dofs.size > DENSE_LIMIT:
        return lambda seen: -bars.tension(seen.displacement).min(axis=1)
    rows = bars.rows()
    return lambda seen: -seen.moved.picked(rows).min(axis=1)
