"""What springs of a rigid train do beside their mean stiffness: coils that touch, and a stiffness that pulsates."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from flexcam.integrate.local import LocalForces
from flexcam.linalg import FloatArray, Triplets
from flexcam.system import AngleFunction, Evaluated, ForceLaw, System
from flexcam.system.force_laws import STOP
from flexcam.train.coils import coils
from flexcam.train.coupling import opposed
from flexcam.train.structure import Structure


@dataclass(frozen=True, eq=False)
class SpringLaw:
    """A law of a spring's parts along the motions of a train.

    Parameters
    ----------
    name
        Such as ``springs.valve.clash``.
    law
        Forces of the parts, stacked, as in the flexible train.
    rows
        How far the motions press each part, shape (c, b).
    offset
        Prescribed part of that.
    stops
        Whether it is the law of coils that touch.
    """

    name: str
    law: LocalForces
    rows: FloatArray
    offset: AngleFunction
    stops: bool

    def force(self, moved: FloatArray, cam: Evaluated) -> FloatArray:
        """Return the forces against some motions by virtual work."""
        pressed = self.pressed(moved, cam)
        functions = self.law.function_values(cam.angle)
        return self.law.energies(pressed, np.zeros((len(pressed), 0)), functions)[1] @ self.rows

    def pressed(self, moved: FloatArray, cam: Evaluated) -> FloatArray:
        """Return how far each part is pressed, m, shape (m, c), by what is given to `force`."""
        return moved @ self.rows.T + cam(self.offset, 0)[:, None]


def spring_laws(structure: Structure, motions: FloatArray) -> tuple[SpringLaw, ...]:
    """Return the laws of the springs that a train moves."""
    found: list[SpringLaw] = []
    for force in coils(structure).forces:
        rows = np.array([sensed.vectors[0] for sensed in force.sense]) @ motions.T
        if rows.any() and isinstance(force.law, ForceLaw):
            offset, stops = force.offset[0], force.law.kind == STOP
            found.append(SpringLaw(force.name, _alone(force.name, force.law, len(rows)), rows, offset, stops))
    return tuple(found)


def _alone(name: str, law: ForceLaw, count: int) -> LocalForces:
    """Return the law on some scalars that are unknowns by themselves."""
    none = Triplets.zeros(count)
    force = opposed(name, np.eye(count), law)
    return LocalForces(System(none, none, none, ("",) * count, local_forces=(force,)))
