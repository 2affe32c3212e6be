"""Where the lift or a derivative of it steps, and by how much."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from flexcam.motion.event import Event

_BESIDE = 1e-8
"""Distance from a joint at which the other side is read, rad: an angle closer counts as on it."""

_NONE = 1e-6
"""A step below this part of the largest value of its curve is none."""

_GRID = np.linspace(0.0, 2.0 * np.pi, 3601)


@dataclass(frozen=True)
class Joint:
    """A place where two stretches meet.

    Parameters
    ----------
    angle
        Cam angle, rad.
    steps
        Right minus left of lift, velocity, acceleration and jerk: m, m/rad, m/rad^2, m/rad^3; zero where continuous.
    """

    angle: float
    steps: tuple[float, float, float, float]

    @property
    def smooth(self) -> bool:
        """Whether nothing steps."""
        return not any(self.steps)


def joints(event: Event) -> list[Joint]:
    """Return every joint of an event, with the steps there."""
    angles = np.array(event.joints)
    rows = list[list[float]]()
    for order in range(4):
        step = event(angles, order) - event(angles - _BESIDE, order)
        # What the curve itself does between the two places is no step.
        step -= _BESIDE * event(angles - _BESIDE, order + 1)
        size = float(np.abs(event(_GRID, order)).max(initial=0.0))
        rows.append(np.where(np.abs(step) > _NONE * size, step, 0.0).tolist())
    return [Joint(float(a), (s[0], s[1], s[2], s[3])) for a, s in zip(angles, np.array(rows).T.tolist(), strict=True)]
