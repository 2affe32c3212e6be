"""What springs of a rigid train do beside their mean stiffness: coils that touch, and a stiffness that pulsates."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from flexcam.linalg import FloatArray
from flexcam.system import AngleFunction, Evaluated, Storing
from flexcam.train.coils import coils
from flexcam.train.structure import Structure


@dataclass(frozen=True, eq=False)
class SpringLaw:
    """A law of a spring's parts along the motions of a train.

    Parameters
    ----------
    name
        Such as ``springs.valve.clash``.
    law
        Forces from how far the parts are pressed, as in the flexible train.
    rows
        How far the motions press each part, shape (c, b).
    offset
        Prescribed part of that.
    """

    name: str
    law: Storing
    rows: FloatArray
    offset: AngleFunction

    def force(self, moved: FloatArray, cam: Evaluated) -> FloatArray:
        """Return the forces against some motions by virtual work."""
        pressed = self.pressed(moved, cam)
        return self.law.stored(pressed, np.zeros((len(pressed), 0)), cam.angle).by_gap @ self.rows

    def pressed(self, moved: FloatArray, cam: Evaluated) -> FloatArray:
        """Return how far each part is pressed, m, shape (m, c), by what is given to `force`."""
        return moved @ self.rows.T + cam(self.offset, 0)[:, None]


def spring_laws(structure: Structure, motions: FloatArray) -> tuple[SpringLaw, ...]:
    """Return the laws of the springs that a train moves."""
    found: list[SpringLaw] = []
    for one in coils(structure).forces:
        rows = np.array([sensed.vectors[0] for sensed in one.sense]) @ motions.T
        if rows.any() and isinstance(one.law, Storing):
            found.append(SpringLaw(one.name, one.law, rows, one.offset[0]))
    return tuple(found)
