"""Joints of levers: what their turning adds to the linear springs at their ends.

The structure holds the joints as springs at the installed ratio. Here stands the rest: the force of the true depth
``y(p) - x`` less that of the linear one, with its share on the lever by virtual work, ``y'(p)``.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from flexcam.linalg import FloatArray
from flexcam.system import AngleVector, LocalForce, Reaction, Stored, constant
from flexcam.train.coupling import Coupling
from flexcam.train.model import Lever
from flexcam.train.structure import Structure, lever_ends

_NONE = np.zeros(0)


@dataclass(frozen=True, eq=False)
class LeverEnd:
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

    @property
    def start_state(self) -> FloatArray:
        """Nothing."""
        return _NONE

    def _reach(self, path: float) -> tuple[float, float, float]:
        y, slope, bend = self.lever.reach(np.array([path]), self.end)
        return float(y[0]), float(slope[0]), float(bend[0])

    def respond(self, gap: FloatArray, rate: FloatArray, state: FloatArray, angle: float) -> Reaction:
        """Return force and tangent."""
        k, c = self.lever.stiffness[self.end], self.lever.damping[self.end]
        (p, x), (dp, dx) = gap.tolist(), rate.tolist()
        y, slope, bend = self._reach(p)
        arm, at_rest = np.array([slope, -1.0]), np.array([self._reach(0.0)[1], -1.0])
        N = k * (y - x) + c * (slope * dp - dx)
        linear = at_rest * (k * float(at_rest @ gap) + c * float(at_rest @ rate))
        by_gap = np.outer(arm, np.array([k * slope + c * bend * dp, -k])) - k * np.outer(at_rest, at_rest)
        by_gap[0, 0] += N * bend
        by_rate = c * (np.outer(arm, arm) - np.outer(at_rest, at_rest))
        return Reaction(N * arm - linear, by_gap, by_rate, _NONE)

    def stored(self, gap: FloatArray, state: FloatArray, angle: float) -> Stored:
        """Return the energy beyond that of the linear spring, and its derivative."""
        k = self.lever.stiffness[self.end]
        y, slope, _ = self._reach(float(gap[0]))
        at_rest = np.array([self._reach(0.0)[1], -1.0])
        depth, linear = y - float(gap[1]), float(at_rest @ gap)
        force = k * depth * np.array([slope, -1.0]) - k * linear * at_rest
        return Stored(0.5 * k * (depth**2 - linear**2), force, _NONE)


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
    forces: list[LocalForce] = []
    for name, lever in structure.model.levers.items():
        for end, rows in lever_ends(structure, lever).items():
            sense = tuple(AngleVector.constant(row) for row in rows)
            act = tuple(AngleVector.constant(-row) for row in rows)
            where = f"rockers.{name}.{('from', 'to')[end]}"
            forces.append(LocalForce(where, sense, act, LeverEnd(lever, end), (constant(0.0),) * 2))
    return Coupling((), tuple(forces), ())
