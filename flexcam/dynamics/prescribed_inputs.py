"""Inputs of the local forces that follow from the cam motion alone, for a block of instants."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from flexcam.core import FloatArray, IntArray
from flexcam.dynamics.angle_functions import CamFunctionCache


@dataclass(frozen=True, eq=False)
class PrescribedInputs:
    """Prescribed inputs of the local forces at m instants.

    Parameters
    ----------
    angle
        Cam angle, rad, shape (m,).
    rows
        Side by side: weights of the k sensing vectors, their time derivatives, weights of the a acting vectors, the
        prescribed parts of the c sensed scalars, their time derivatives, and functions of the laws.
    senses, acts
        1 where a sensing vector belongs to a scalar, an acting vector to a force, shape (c, k) and (c, a).
    cam
        Functions of the cam angle at these instants.
    """

    angle: FloatArray
    rows: FloatArray
    senses: FloatArray
    acts: FloatArray
    cam: CamFunctionCache

    @cached_property
    def _cuts(self) -> list[int]:
        (c, k), a = self.senses.shape, self.acts.shape[1]
        return np.cumsum([0, k, k, a, c, c]).tolist()

    def _part(self, i: int) -> FloatArray:
        return self.rows[:, self._cuts[i] : self._cuts[i + 1]]

    @property
    def sensing_weights(self) -> FloatArray:
        """Weights of the sensing vectors, shape (m, k)."""
        return self._part(0)

    @property
    def sensing_rates(self) -> FloatArray:
        """Their time derivatives, shape (m, k)."""
        return self._part(1)

    @property
    def acting_weights(self) -> FloatArray:
        """Weights of the acting vectors, shape (m, a)."""
        return self._part(2)

    @property
    def offset(self) -> FloatArray:
        """Prescribed parts of the sensed scalars, shape (m, c)."""
        return self._part(3)

    @property
    def offset_rate(self) -> FloatArray:
        """Their time derivatives, shape (m, c)."""
        return self._part(4)

    @property
    def functions(self) -> int:
        """Column of the first function of the laws."""
        return self._cuts[5]

    def at(self, instants: IntArray | slice) -> PrescribedInputs:
        """Return some of the instants."""
        angle = self.angle[instants]
        return PrescribedInputs(angle, self.rows[instants], self.senses, self.acts, CamFunctionCache(angle))

    def row(self, i: int) -> PrescribedInputs:
        """Return one of the instants."""
        return self.at(slice(i, i + 1))

    def sensing_matrix(self, i: int) -> FloatArray:
        """Return the weights of the sensing vectors in every scalar at an instant, shape (c, k)."""
        return self.senses * self.sensing_weights[i]

    def sensing_rate_matrix(self, i: int) -> FloatArray:
        """Return their time derivatives, shape (c, k)."""
        return self.senses * self.sensing_rates[i]

    def acting_matrix(self, i: int) -> FloatArray:
        """Return the weights of the acting vectors in every force at an instant, shape (c, a)."""
        return self.acts * self.acting_weights[i]
