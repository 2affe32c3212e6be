"""Functions of the cam angle at the instants of a block, each computed once for all who ask for it."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import dataclass
from typing import TypeVar, cast

import numpy as np

from flexcam.linalg import FloatArray, IntArray
from flexcam.system.local import AngleFunction, Derivative

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
    known
        What is known at some of them, in order; None for nothing.
    at
        Their places, shape (len(known.angle),).
    """

    def __init__(self, angle: FloatArray, known: Evaluated | None = None, at: IntArray | None = None) -> None:
        self.angle = angle
        self._earlier = None if known is None or at is None else _Earlier.of(angle, known, at)
        self._known: dict[tuple[int, int], tuple[AngleFunction, FloatArray]] = {}  # a function keeps its number
        self._made: dict[object, object] = {}

    def __call__(self, function: AngleFunction, order: int) -> FloatArray:
        """Return a function or its derivative."""
        while isinstance(function, Derivative):
            function, order = function.function, order + 1
        found = self._known.get((id(function), order))
        if found is None:
            found = self._known[id(function), order] = function, self._found(function, order)
        return found[1]

    def once(self, key: object, make: Callable[[], T]) -> T:
        """Return what was made under a key at these angles, made now if it was not."""
        if key not in self._made:
            self._made[key] = make()
        return cast("T", self._made[key])

    def _found(self, function: AngleFunction, order: int) -> FloatArray:
        earlier = self._earlier
        if earlier is None or (id(function), order) not in earlier.known._known:
            return function.of(self, order) if isinstance(function, Following) else function(self.angle, order)
        values = np.empty_like(self.angle)
        values[earlier.at], values[earlier.rest] = earlier.known(function, order), earlier.fresh(function, order)
        return values


@dataclass(frozen=True, eq=False)
class _Earlier:
    """What is known at some angles, with their places, and what is not, with theirs."""

    known: Evaluated
    at: IntArray
    fresh: Evaluated
    rest: IntArray

    @classmethod
    def of(cls, angle: FloatArray, known: Evaluated, at: IntArray) -> _Earlier:
        rest = np.setdiff1d(np.arange(len(angle)), at)
        return cls(known, at, Evaluated(angle[rest]), rest)
