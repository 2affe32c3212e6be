"""Whether the steps of a run see the lift of its cams."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from flexcam.train.model import Model

SEEN = 1e-3
"""Part of the lift that may lie between two steps: a choice; the published model then is right to 1 % at 3000 rpm."""

_ANGLES = np.linspace(0.0, 2.0 * math.pi, 7201)


@dataclass(frozen=True)
class CoarseCam:
    """A cam whose lift the steps do not see.

    Parameters
    ----------
    cam
        Its name.
    missed
        By how much the lift departs from a straight line between two steps, as a part of it; at most 1.
    enough
        Steps per camshaft revolution that see it.
    """

    cam: str
    missed: float
    enough: int


def coarse_cams(model: Model, turn: float) -> list[CoarseCam]:
    """Return the cams whose lift the steps of a run do not see.

    A lift between two steps departs from a straight line by up to ``max |s''| turn^2/8``.
    """
    found: list[CoarseCam] = []
    for name, cam in model.cams.items():
        curved = float(np.abs(cam.event(_ANGLES, 2)).max()) / (8.0 * cam.event.height)
        if curved * turn**2 > SEEN:
            enough = math.ceil(2.0 * math.pi * math.sqrt(curved / SEEN))
            found.append(CoarseCam(name, min(curved * turn**2, 1.0), enough))
    return found
