"""Joints of levers: what their turning adds to the linear springs at their ends.

The structure holds the joints as springs at the installed ratio. Here stands the rest: the force of the true depth
``y(p) - x`` less that of the linear one, with its share on the lever by virtual work, ``y'(p)``.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from flexcam.linalg import FloatArray
from flexcam.system import Formula, Kind, LocalForce, Reaction, Stored
from flexcam.system.pointwise import turning
from flexcam.train.coupling import Coupling, opposed
from flexcam.train.model import Lever
from flexcam.train.penalty import Stateless
from flexcam.train.published import follower_train
from flexcam.train.structure import Structure, lever_ends


@dataclass(frozen=True, eq=False)
class LeverEnd(Stateless):
    """Local law of one end, beyond its linear spring: it senses the path p and what moves there, x.

    Parameters
    ----------
    lever
        The lever.
    end
        0 for the driven one, 1 for the point.
    """

    lever: Lever
    end: int

    def _at_rest(self) -> FloatArray:
        """Return the derivative of the depth by path and motion, as installed."""
        return np.array([float(self.lever.reach(np.zeros(1), self.end)[1][0]), -1.0])

    def respond(self, gap: FloatArray, rate: FloatArray, state: FloatArray, angle: float) -> Reaction:
        """Return force and tangent."""
        lever, end = self.lever, self.end
        k, c = lever.stiffness[end], lever.damping[end]
        beyond, more, slope, bend = turning(float(gap[0]), lever.arms[end], lever.arms[0], lever.angles[end])
        at_rest, (path, moved), (p, x) = slope - more, gap.tolist(), rate.tolist()
        linear = k * (at_rest * path - moved) + c * (at_rest * p - x)
        N, turned = k * beyond + c * more * p, c * bend * p  # beyond the linear one
        own = more * (slope + at_rest)  # by which the square of the slope has changed
        by_gap = np.array([[k * own + slope * turned + (linear + N) * bend, -k * more], [-k * more - turned, 0.0]])
        by_rate = np.array([[c * own, -c * more], [-c * more, 0.0]])
        return Reaction(np.array([N * slope + linear * more, -N]), by_gap, by_rate)

    def formulas(self, count: int) -> tuple[Formula, ...]:
        """Return the law as data."""
        lever, end = self.lever, self.end
        shape = (lever.arms[end], lever.arms[0], lever.angles[end])
        return (Formula(Kind.LEVER, (lever.stiffness[end], lever.damping[end], *shape), scalars=count),)

    def stored(self, gap: FloatArray, state: FloatArray, angle: FloatArray) -> Stored:
        """Return the energy beyond that of the linear spring and its derivative, per instant."""
        k, at_rest = self.lever.stiffness[self.end], self._at_rest()
        y, slope, _ = self.lever.reach(gap[..., 0], self.end)
        depth, linear = y - gap[..., 1], gap @ at_rest
        force = np.stack([depth * slope, -depth], axis=-1) - linear[..., None] * at_rest
        energy = 0.5 * k * (y - at_rest[0] * gap[..., 0]) * (depth + linear)
        return Stored(energy, k * force, np.zeros_like(state))


def lever_joints(structure: Structure) -> Coupling:
    """Return what the turning of all levers adds.

    Parameters
    ----------
    structure
        The structure.

    Returns
    -------
    Coupling
        A local force per elastic end.
    """
    refuse_far_turns(structure)
    forces: list[LocalForce] = []
    for name, lever in structure.model.levers.items():
        for end, rows in lever_ends(structure, lever).items():
            where = f"rockers.{name}.{('from', 'to')[end]}"
            forces.append(opposed(where, np.array(rows), LeverEnd(lever, end)))
    return Coupling((), tuple(forces), ())


def refuse_far_turns(structure: Structure) -> None:
    """Refuse a lift that would turn a lever until its arm points along the motion.

    Parameters
    ----------
    structure
        The structure.

    Raises
    ------
    InputError
        Naming the lever.
    """
    model = structure.model
    for name, contact in model.driven.items():
        train = follower_train(structure, contact, f"contacts.{name}.follower")
        event = model.cams[contact.cam].event
        for rocker, lever in model.levers.items():
            driven = float(structure.row(lever.start, lever.direction) @ train.motion)
            lever.path_at(np.array([driven * event.height]), f"rockers.{rocker}.arms")
