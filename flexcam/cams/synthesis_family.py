"""Families of laws for synthesis, and lower bounds for all laws."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from flexcam.cams.motion_law import Law, linear
from flexcam.cams.polynomial_laws import BSplineLaw, spline_derivatives
from flexcam.cams.standard_laws import Harmonic
from flexcam.core import FloatArray
from flexcam.core.errors import refuse


def universal_bound(weights: Mapping[str, float], limits: Mapping[str, float], *, free_ends: bool) -> float | None:
    """Return a lower bound of the objective over all laws from rest to rest.

    C_v >= 1 (the mean velocity), C_a >= 4 (the parabola), C_j >= 32 (three segments of constant jerk; 12, the 2-3
    polynomial's, where the acceleration may step at the ends), rms of s'' at least sqrt(12) (the 2-3 polynomial), C_m
    >= 9/4 (s'^2 rises and falls linearly). With a bound J on the jerk, C_a is at least that of the law whose
    acceleration is a trapezoid of slopes J, as in bang-bang control; a bound on C_a bounds C_j in the same way. Bounds
    on C_v and C_a raise each other: the limit is the law with a trapezoidal velocity, V - V^2/A = 1.
    """
    minima = {"Cv": 1.0, "Ca": 4.0, "Cj": 12.0 if free_ends else 32.0, "rms": math.sqrt(12.0), "Cm": 2.25}
    if "Cj" in limits:
        minima["Ca"] = least_acceleration(limits["Cj"], free_ends=free_ends)
    if 1.0 < limits.get("Cv", 2.0) < 2.0:
        minima["Ca"] = max(minima["Ca"], limits["Cv"] ** 2 / (limits["Cv"] - 1.0))
    if "Ca" in limits:
        minima["Cv"] = 2.0 / (1.0 + math.sqrt(max(1.0 - 4.0 / limits["Ca"], 0.0)))
        minima["Cj"] = max(minima["Cj"], least_jerk(limits["Ca"], free_ends=free_ends))
    if any(name not in minima for name in weights):
        return None
    return sum(weight * minima[name] for name, weight in weights.items())


def least_jerk(acceleration: float, *, free_ends: bool) -> float:
    """Return the minimum C_j under a bound on C_a."""
    if not 4.0 < acceleration < (6.0 if free_ends else 8.0):
        return 0.0
    excess = acceleration - 4.0
    return math.sqrt(4.0 * acceleration**3 / (3.0 * excess)) if free_ends else 2.0 * acceleration**2 / excess


def least_acceleration(jerk: float, *, free_ends: bool) -> float:
    """Return the minimum C_a under a bound on the jerk."""
    if not free_ends:
        return 4.0 if jerk < 32.0 else 8.0 / (1.0 + math.sqrt(1.0 - 32.0 / jerk))
    acceleration = 4.0
    for _ in range(100):
        acceleration = 4.0 + 4.0 * acceleration**3 / (3.0 * jerk**2)
        if acceleration > 0.5 * jerk:  # the slope fills the whole half: no trapezoid
            return 4.0
    return acceleration


_MAX_DEGREE, _MAX_PIECES = 40, 300


class Family(ABC):
    """Laws s = offset(z) + rows(z) x with free coefficients x."""

    @property
    @abstractmethod
    def size(self) -> int:
        """Number of free coefficients."""

    @property
    @abstractmethod
    def name(self) -> str:
        """Description of the family."""

    @abstractmethod
    def rows(self, z: FloatArray, order: int) -> tuple[FloatArray, FloatArray]:
        """Return rows (m, size) and offset (m,) of a derivative at positions of shape (m,)."""

    def equalities(self) -> tuple[FloatArray, FloatArray]:
        """Return the equality constraints A x = b of the coefficients: none if ends and symmetry are built in."""
        return np.zeros((0, self.size)), np.zeros(0)

    @abstractmethod
    def law(self, x: FloatArray) -> Law:
        """Return the law of given coefficients."""


@dataclass(frozen=True)
class SplineFamily(Family):
    """B-splines on equally spaced knots; with one piece, polynomials of their degree."""

    degree: int = 5  #: 5 or more
    pieces: int = 24  #: intervals between knots
    rest: int = 2  #: derivatives that vanish at both ends: 1 for the velocity, 2 for the acceleration too, and so on
    symmetric: bool = True  #: whether s(z) + s(1 - z) = 1

    def __post_init__(self) -> None:
        ranges = {"degree": (5, _MAX_DEGREE), "pieces": (1, _MAX_PIECES), "rest": (1, _MAX_PIECES)}
        for name, (low, high) in ranges.items():
            if not low <= getattr(self, name) <= high:
                raise refuse(name, getattr(self, name), f"{low} to {high}")
        if self._count < 2 * (self.rest + 1) + 1 or not self.size:
            given = f"{self._count} coefficients with {self.rest + 1} held at each end"
            raise refuse("family", given, "free coefficients", "", "use a higher degree or more pieces")

    @property
    def name(self) -> str:
        """Description of the family."""
        if self.pieces == 1:
            return f"polynomials of degree {self.degree}"
        return f"B-splines of degree {self.degree} on {self.pieces} pieces"

    @property
    def _count(self) -> int:
        return self.degree + self.pieces

    @cached_property
    def _map(self) -> tuple[FloatArray, FloatArray]:
        """Matrix and offset from the free coefficients to all coefficients."""
        n, fixed = self._count, self.rest + 1
        offset = np.repeat([0.0, 1.0], [n - fixed, fixed])
        free = np.arange(fixed, n - fixed)
        independent = free[: len(free) // 2] if self.symmetric else free
        matrix = np.zeros((n, len(independent)))
        matrix[independent, np.arange(len(independent))] = 1.0
        if self.symmetric:
            matrix[n - 1 - independent, np.arange(len(independent))] = -1.0
            offset[n - 1 - independent] = 1.0
            if len(free) % 2:
                offset[n // 2] = 0.5
        return matrix, offset

    @property
    def size(self) -> int:
        """Number of free coefficients."""
        return self._map[0].shape[1]

    @cached_property
    def _basis(self) -> tuple[Any, ...]:
        inner = np.linspace(0.0, 1.0, self.pieces + 1)[1:-1]
        return spline_derivatives(inner, np.eye(self._count), self.degree)

    def rows(self, z: FloatArray, order: int) -> tuple[FloatArray, FloatArray]:
        """Return rows and offset of a derivative."""
        basis: FloatArray = self._basis[order](z)
        matrix, offset = self._map
        return basis @ matrix, basis @ offset

    def law(self, x: FloatArray) -> Law:
        """Return the law of given coefficients."""
        matrix, offset = self._map
        return BSplineLaw(tuple((matrix @ x + offset).tolist()), self.degree)


@dataclass(frozen=True)
class HarmonicFamily(Family):
    """s = z - sum c_n sin(2 pi n z)/(2 pi n), symmetric, with zero velocity and acceleration at the ends."""

    orders: tuple[int, ...] = (1, 2, 3, 4, 5)  #: orders n: two or more distinct positive integers

    def __post_init__(self) -> None:
        if len(set(self.orders)) < max(2, len(self.orders)) or min(self.orders) < 1:
            raise refuse("orders", list(self.orders), "two or more different whole numbers, each at least 1")

    @property
    def name(self) -> str:
        """Description of the family."""
        return f"harmonic laws of orders {', '.join(map(str, self.orders))}"

    @property
    def size(self) -> int:
        """Number of coefficients."""
        return len(self.orders)

    def rows(self, z: FloatArray, order: int) -> tuple[FloatArray, FloatArray]:
        """Return rows and offset of a derivative."""
        w = 2.0 * math.pi * np.array(self.orders)
        return -(w ** (order - 1.0)) * np.sin(np.multiply.outer(z, w) + order * math.pi / 2.0), linear(z, order)

    def equalities(self) -> tuple[FloatArray, FloatArray]:
        """Return the constraint that the coefficients sum to 1, so that the velocity does not step at the ends."""
        return np.ones((1, self.size)), np.ones(1)

    def law(self, x: FloatArray) -> Law:
        """Return the law of given coefficients."""
        return Harmonic(tuple(zip(self.orders, x.tolist(), strict=True)))
