"""Functions of the cam angle, and vectors that depend on it."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import dataclass
from typing import TypeVar, cast

import numpy as np

from flexcam.core import FloatArray

AngleFunction = Callable[[FloatArray, int], FloatArray]
"""A scalar function of the cam angle (rad) and of the order of its derivative."""


@dataclass(frozen=True)
class Constant:
    """Constant function of the cam angle, distinguishable from other functions."""

    value: float

    def __call__(self, angle: FloatArray, order: int) -> FloatArray:
        """Return the value at every angle; derivatives are zero."""
        return np.full_like(angle, self.value if order == 0 else 0.0)


@dataclass(frozen=True)
class Derivative:
    """The derivative of a function of the cam angle."""

    function: AngleFunction

    def __call__(self, angle: FloatArray, order: int) -> FloatArray:
        """Return it, or a derivative of it."""
        return self.function(angle, order + 1)


@dataclass(frozen=True, eq=False)
class AngleVector:
    """Vector that depends on the cam angle: constant vectors times scalar functions.

    Parameters
    ----------
    vectors
        Shape (k, n).
    functions
        One function of the angle per vector; none for a single vector that does not depend on it.
    """

    vectors: FloatArray
    functions: tuple[AngleFunction, ...]

    @classmethod
    def constant(cls, vector: FloatArray) -> AngleVector:
        """Return a vector that does not depend on the angle, shape (n,)."""
        return cls(vector[None, :], ())

    def weights(self, angle: FloatArray, order: int = 0) -> FloatArray:
        """Return the weights of the vectors, shape (len(angle), k), or their derivatives by the angle."""
        if not self.functions:
            return np.full((*angle.shape, 1), 0.0 if order else 1.0)
        return np.stack([function(angle, order) for function in self.functions], axis=-1)


def constant(value: float) -> AngleFunction:
    """Return the function of the cam angle that is `value` everywhere."""
    return Constant(value)


def derivative(function: AngleFunction) -> AngleFunction:
    """Return the derivative of a function of the cam angle."""
    return Derivative(function)


ONE = Constant(1.0)
"""Constant function 1, such as the cosine of a contact without inclination."""


T = TypeVar("T")


class DerivedCamFunction(ABC):
    """Function of the cam angle derived from others, evaluated once for all derived functions."""

    def __call__(self, angle: FloatArray, order: int) -> FloatArray:
        """Return the function or its derivative."""
        return self.of(CamFunctionCache(angle), order)

    @abstractmethod
    def of(self, cam: CamFunctionCache, order: int) -> FloatArray:
        """Return the function at angles where other functions are cached."""


class CamFunctionCache:
    """Cache of functions of the cam angle at given angles.

    Parameters
    ----------
    angle
        rad, any shape.
    """

    def __init__(self, angle: FloatArray) -> None:
        self.angle = angle
        self._known: dict[tuple[int, int], tuple[AngleFunction, FloatArray]] = {}  # keeps the ids valid
        self._made: dict[object, object] = {}

    def __call__(self, function: AngleFunction, order: int) -> FloatArray:
        """Return a function or its derivative."""
        while isinstance(function, Derivative):
            function, order = function.function, order + 1
        found = self._known.get((id(function), order))
        if found is None:
            value = (
                function.of(self, order) if isinstance(function, DerivedCamFunction) else function(self.angle, order)
            )
            found = self._known[id(function), order] = function, value
        return found[1]

    def cached(self, key: object, make: Callable[[], T]) -> T:
        """Return the cached value of a key at these angles, computed if missing."""
        if key not in self._made:
            self._made[key] = make()
        return cast("T", self._made[key])
