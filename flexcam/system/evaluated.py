"""Functions of the cam angle at the instants of a block, each computed once for all who ask for it."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable
from typing import TypeVar, cast

from flexcam.linalg import FloatArray
from flexcam.system.angle_functions import AngleFunction, Derivative

T = TypeVar("T")


class Following(ABC):
    """A function of the cam angle that follows from others, which are then computed once for all that follow."""

    def __call__(self, angle: FloatArray, order: int) -> FloatArray:
        """Return it, or a derivative of it."""
        return self.of(Evaluated(angle), order)

    @abstractmethod
    def of(self, cam: Evaluated, order: int) -> FloatArray:
        """Return the same at the angles where others are known."""


class Evaluated:
    """Functions of the cam angle at some angles, each computed once however often it is asked for.

    Parameters
    ----------
    angle
        rad, any shape.
    """

    def __init__(self, angle: FloatArray) -> None:
        self.angle = angle
        self._known: dict[tuple[int, int], tuple[AngleFunction, FloatArray]] = {}  # a function keeps its number
        self._made: dict[object, object] = {}

    def __call__(self, function: AngleFunction, order: int) -> FloatArray:
        """Return a function or its derivative."""
        while isinstance(function, Derivative):
            function, order = function.function, order + 1
        found = self._known.get((id(function), order))
        if found is None:
            value = function.of(self, order) if isinstance(function, Following) else function(self.angle, order)
            found = self._known[id(function), order] = function, value
        return found[1]

    def once(self, key: object, make: Callable[[], T]) -> T:
        """Return what was made under a key at these angles, made now if it was not."""
        if key not in self._made:
            self._made[key] = make()
        return cast("T", self._made[key])
