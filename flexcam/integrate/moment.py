"""What a step goes from and to: the motion of an instant, and what is prescribed at one."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from flexcam.integrate.local import Schedule
from flexcam.integrate.settle import Inner
from flexcam.linalg import FloatArray


@dataclass(frozen=True, eq=False)
class Moment:
    """Everything the next step needs to know of an instant.

    Parameters
    ----------
    time
        s.
    d, v, a
        Displacement, velocity, acceleration, shape (n,).
    applied
        Loads and local forces in the unknowns, shape (n,).
    local, gap, rate
        Local forces, what they sense and its rate, shape (c,).
    inner
        Internal states of the local laws.
    pressed
        On which side of zero the switching scalars are counted; None for that of the gap.
    impulse
        Of impacts at this instant, N s, shape (c,); None without.
    iterations
        Newton iterations that led here.
    """

    time: float
    d: FloatArray
    v: FloatArray
    a: FloatArray
    applied: FloatArray
    local: FloatArray
    gap: FloatArray
    rate: FloatArray
    inner: Inner
    pressed: NDArray[np.bool_] | None = None
    impulse: FloatArray | None = None
    iterations: int = 0


@dataclass(frozen=True, eq=False)
class Instant:
    """What is prescribed at an instant.

    Parameters
    ----------
    time
        s.
    load
        Loads in the unknowns, shape (n,).
    schedule
        What follows from the cam motion for the local forces.
    row
        Which row of the schedule is meant.
    """

    time: float
    load: FloatArray
    schedule: Schedule
    row: int = 0

    @property
    def angle(self) -> float:
        """Cam angle, rad."""
        return float(self.schedule.angle[self.row])
