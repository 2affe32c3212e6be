"""Rockers: a constant ratio, or a lever that turns."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from flexcam.checks import refuse
from flexcam.linalg import FloatArray

_MOST = math.radians(75.0)
"""Angle between an arm and the square to its end's motion, up to which a lever makes sense."""

_STEEP = math.sin(_MOST)


@dataclass(frozen=True, eq=False)
class Rocker:
    """A rigid rocker without bending: the valve moves by the ratio of the arms.

    Parameters
    ----------
    start
        Named node it is driven at.
    point
        Name of the point it defines (the valve).
    arms
        Arm at the driven node and at the valve, m.
    inertia
        About the rocker's shaft, kg m^2.
    direction
        Direction of the motion at the driven node, shape (6,); the point's motion is positive with it.
    finger
        Whether it defines the point it is driven at as well.
    """

    start: str
    point: str
    arms: tuple[float, float]
    inertia: float
    direction: FloatArray
    finger: bool = False

    @property
    def ratio(self) -> float:
        """Motion of the point per motion of the driven node."""
        return self.arms[1] / self.arms[0]


@dataclass(frozen=True, eq=False)
class Lever(Rocker):
    """A rocker as a lever that turns: its ratio changes with its angle, its arms give way.

    With p the path of its driven end, the other end moves by ``a2 (sin(b2 + p/a1) - sin b2)``. A
    finger follower has the lift of its cam along the path p.

    Parameters
    ----------
    angles
        Of both arms as installed, rad: 0 where the arm is square to the motion of its end.
    stiffness, damping
        Of the arm at the driven node and at the point, N/m and N s/m; the first counts only at a node.
    """

    angles: tuple[float, float] = (0.0, 0.0)
    stiffness: tuple[float, float] = (0.0, 0.0)
    damping: tuple[float, float] = (0.0, 0.0)

    def __post_init__(self) -> None:
        beyond = [f"{math.degrees(angle):g} deg" for angle in self.angles if abs(angle) > _MOST]
        if beyond:
            why, remedy = "an arm nearly along the motion of its end moves it no more", "count it from square"
            raise refuse("angles", " and ".join(beyond), f"within {math.degrees(_MOST):g} deg of square", why, remedy)

    @property
    def ratio(self) -> float:
        """Motion of the point per motion of the driven end, as installed."""
        driven = 1.0 if self.finger else math.cos(self.angles[0])
        return self.arms[1] / self.arms[0] * math.cos(self.angles[1]) / driven

    def path_at(self, lift: FloatArray, where: str = "arms") -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return the path of the driven end at a motion of what drives it, m, and its first two derivatives."""
        if self.finger:
            return lift, np.ones_like(lift), np.zeros_like(lift)
        arm, start = self.arms[0], self.angles[0]
        sine = math.sin(start) + lift / arm
        if float(np.abs(sine).max(initial=0.0)) >= _STEEP:
            given = f"a motion of {1e3 * float(np.abs(lift).max()):.4g} mm at an arm of {1e3 * arm:.4g} mm"
            why, remedy = "the lever would turn until its arm points along the motion", "a longer arm, or other angles"
            raise refuse(where, given, f"up to {math.degrees(_MOST):g} deg", why, remedy)
        cosine = np.sqrt(1.0 - sine**2)
        return arm * (np.arcsin(sine) - start), 1.0 / cosine, sine / (arm * cosine**3)

    def reach(self, path: FloatArray, end: int) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return the motion of an end at a path of the driven end, m, and its first two derivatives."""
        arm, start, turn = self.arms[end], self.angles[end], path / self.arms[0]
        there = start + turn
        share = arm / self.arms[0]
        return arm * (np.sin(there) - math.sin(start)), share * np.cos(there), -share / self.arms[0] * np.sin(there)


def path_name(lever: str) -> str:
    """Return the name of the unknown that is the path of a lever's driven end."""
    return f"rockers.{lever}"


def tip_name(lever: str) -> str:
    """Return the name of the unknown that is the tip of a lever, where play is between it and its point."""
    return f"rockers.{lever}.tip"
