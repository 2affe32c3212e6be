"""State of a mechanism at one instant, for drawing."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from flexcam.core import FloatArray
from flexcam.valvetrain import Structure


@dataclass(frozen=True, eq=False)
class SceneState:
    """State of a scene at one instant.

    Parameters
    ----------
    structure
        Structure of the model.
    angle
        Cam angle, rad.
    unknowns
        Displacements of the degrees of freedom of the structure as drawn, m and rad, shape (n,).
    values
        Colour values of members at the points of their polylines, member by member, shape (points,); None for no
        colours.
    """

    structure: Structure
    angle: float
    unknowns: FloatArray
    values: FloatArray | None = None

    @cached_property
    def nodal(self) -> FloatArray:
        """Displacements of all nodes, m and rad, shape (nodes, 6)."""
        return self.structure.dofs.nodal(self.unknowns)

    def along(self, row: FloatArray) -> float:
        """Return the motion selected by a row over the degrees of freedom, m."""
        return float(row @ self.unknowns)

    def at(self, point: str, away: FloatArray) -> FloatArray:
        """Return the displacement of a named point, m, shape (3,); the point of a rocker moves along `away`."""
        if self.structure.is_node(point):
            return self.nodal[self.structure.model.mesh.node(point), :3]
        return self.along(self.structure.row(point, np.zeros(6))) * away
