"""Functions of the cam angle, and vectors that depend on it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from flexcam.linalg import FloatArray

AngleFunction = Callable[[FloatArray, int], FloatArray]
"""A scalar function of the cam angle (rad) and of the order of its derivative."""


@dataclass(frozen=True)
class Constant:
    """A function of the cam angle that is `value` everywhere, and can be told from others."""

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
    """A vector that depends on the cam angle: a few constant vectors times scalar functions.

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
"""The function that is 1 everywhere, such as the cosine of a contact that is not inclined."""
