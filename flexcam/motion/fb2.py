"""The FB2 law: half a sine of acceleration, then a quarter of a cosine whose peak lies at the nose."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from flexcam.checks import refuse
from flexcam.linalg import FloatArray


@dataclass(frozen=True)
class CompoundCycloid:
    """Rise of a valve cam without dwell: s'' = A sin(pi z/p) up to z = p, then -B sin(pi (z - p)/(2 (1 - p))).

    Lift and velocity are continuous at the split p; the deceleration is greatest at the nose, z = 1, and goes on
    smoothly in the mirrored return. C. Li, Cam motion simulation and optimization (2014), names a cam "FB2" (compound
    cycloid II) without defining it; this form and its default split are flexcam's choice.

    Parameters
    ----------
    split
        Part of the rise that accelerates, between 0 and 1.

    Raises
    ------
    InputError
        If the split is not between 0 and 1.

    Examples
    --------
    >>> CompoundCycloid()(np.array([0.0, 1.0])).round(12)
    array([0., 1.])
    """

    split: float = 0.3

    def __post_init__(self) -> None:
        if not 0.0 < self.split < 1.0:
            raise refuse("split", self.split, "a number between 0 and 1", "it divides acceleration from deceleration")

    @property
    def breaks(self) -> tuple[float, ...]:
        """Positions of inner jumps: the jerk's at the split."""
        return (self.split,)

    def __call__(self, z: FloatArray, order: int = 0) -> FloatArray:
        """Return the derivative of the given order at z."""
        return np.where(z < self.split, self._sine(z, order), self._cosine(z, order))

    @property
    def _peak(self) -> float:
        """A, from s(1) = 1."""
        p, pi = self.split, math.pi
        return 1.0 / (p**2 / pi + 4.0 * p * (1.0 - p) / pi**2)

    def _sine(self, z: FloatArray, order: int) -> FloatArray:
        w = math.pi / self.split
        line = (z / w, np.full_like(z, 1.0 / w))[order] if order < 2 else np.zeros_like(z)
        return self._peak * (line - w ** (order - 2) * np.sin(w * z + order * math.pi / 2.0))

    def _cosine(self, z: FloatArray, order: int) -> FloatArray:
        p, q = self.split, 1.0 - self.split
        w = math.pi / (2.0 * q)
        speed, height = 2.0 * self._peak * p / math.pi, self._peak * p**2 / math.pi
        return (height if order == 0 else 0.0) + speed * w ** (order - 1) * np.sin(w * (z - p) + order * math.pi / 2.0)
