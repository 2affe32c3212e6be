"""An instant of a mechanism as drawn, and where its points then are."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from flexcam.core import FloatArray
from flexcam.valvetrain import Structure


@dataclass(frozen=True, eq=False)
class Instant:
    """What moves a scene.

    Parameters
    ----------
    structure
        Of the model.
    angle
        Cam angle, rad.
    unknowns
        Displacements of the structure's unknowns as drawn, m and rad, shape (n,).
    values
        What members are coloured by at the points of their polylines, one member's after the other's, shape (points,);
        None for no colours.
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
        """Return the motion that a row over the unknowns picks, m."""
        return float(row @ self.unknowns)

    def at(self, point: str, away: FloatArray) -> FloatArray:
        """Return the displacement of a named point, m, shape (3,); a rocker's moves along `away`."""
        if self.structure.is_node(point):
            return self.nodal[self.structure.model.mesh.node(point), :3]
        return self.along(self.structure.row(point, np.zeros(6))) * away
