"""Linear benchmarks B1 and B5: a driven shaft as numbers and as matrices, in numpy alone.

B1 is one run at 1500 rpm, B5 the same shaft at 100 speeds. The elements are implemented here independently of flexcam:
solvers with their own elements build the shaft from the numbers, the others get the matrices.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]


@dataclass(frozen=True)
class Shaft:
    """A steel shaft between bearings with a mass, a force and a torque at its middle; undamped, from rest.

    ``Fy = force (1 - cos w t)``, ``Tx = torque sin w t``; Newmark's method with beta = 1/4, gamma = 1/2. The first
    node is fixed in ux, uy, uz, rx, the last one in uy, uz. A longer shaft has several equal spans with a bearing
    (uy, uz) between them, and mass and loads in the first span. Length and elements are those of a span. SI units.
    """

    frequencies: tuple[float, ...] = (25.0,)
    revolutions: int = 2
    steps_per_revolution: int = 3600
    spans: int = 1
    elements: int = 10
    length: float = 0.5
    diameter: float = 0.025
    E: float = 2.06e11
    G: float = 7.9e10
    density: float = 7850.0
    mass: float = 0.2
    force: float = 500.0
    torque: float = 3.0

    @property
    def steps(self) -> int:
        """Steps of one run."""
        return self.revolutions * self.steps_per_revolution

    @property
    def area(self) -> float:
        """Area of the section, m^2."""
        return math.pi * self.diameter**2 / 4.0

    @property
    def inertia(self) -> float:
        """Second moment of the area, m^4; the polar one is twice that."""
        return math.pi * self.diameter**4 / 64.0

    @property
    def middle(self) -> int:
        """Number of the loaded node."""
        return self.elements // 2

    @property
    def last(self) -> int:
        """Number of the last node, equal to the number of elements of all spans."""
        return self.spans * self.elements

    @property
    def fixed(self) -> dict[int, tuple[int, ...]]:
        """Fixed components (0 to 5: ux, uy, uz, rx, ry, rz) by node."""
        bearings = range(self.elements, self.last + 1, self.elements)
        return {0: (0, 1, 2, 3), **dict.fromkeys(bearings, (1, 2))}

    def step(self, frequency: float) -> float:
        """Return the time step at a speed, s; all speeds have the same number of steps per revolution."""
        return 1.0 / (frequency * self.steps_per_revolution)

    def loads(self, frequency: float) -> FloatArray:
        """Return force and torque at all instants, shape (steps + 1, 2)."""
        angle = 2.0 * math.pi * np.arange(self.steps + 1) / self.steps_per_revolution
        return np.column_stack([self.force * (1.0 - np.cos(angle)), self.torque * np.sin(angle)])


@dataclass(frozen=True, eq=False)
class ShaftResult:
    """Displacements and times of a solver.

    Parameters
    ----------
    displacement
        uy and rx of the middle node at all instants, shape (speeds, steps + 1, 2).
    loop_seconds
        Time of the integration, with factorization and initial acceleration.
    total_seconds
        Time from numbers to displacements, without imports.
    """

    displacement: FloatArray
    loop_seconds: float
    total_seconds: float


B1 = Shaft()
B5 = Shaft(frequencies=tuple(np.linspace(500.0, 5000.0, 100) / 60.0))


def matrices(shaft: Shaft) -> tuple[FloatArray, FloatArray, NDArray[np.intp]]:
    """Return mass and stiffness of the free unknowns, dense, and the indices of the middle node's uy and rx."""
    count = 6 * (shaft.last + 1)
    M, K = np.zeros((count, count)), np.zeros((count, count))
    m, k = _element(shaft)
    for i in range(shaft.last):
        at = slice(6 * i, 6 * i + 12)
        M[at, at] += m
        K[at, at] += k
    for i in range(3):
        M[6 * shaft.middle + i, 6 * shaft.middle + i] += shaft.mass
    fixed = [6 * node + i for node, components in shaft.fixed.items() for i in components]
    free = np.setdiff1d(np.arange(count), fixed)
    observed = np.searchsorted(free, [6 * shaft.middle + 1, 6 * shaft.middle + 3])
    return M[np.ix_(free, free)], K[np.ix_(free, free)], observed


def _element(shaft: Shaft) -> tuple[FloatArray, FloatArray]:
    """Return consistent mass (without rotary inertia) and stiffness of an Euler-Bernoulli beam along x, 12 x 12."""
    length = shaft.length / shaft.elements
    M, K = np.zeros((12, 12)), np.zeros((12, 12))
    mass, polar = shaft.density * shaft.area * length, 2.0 * shaft.density * shaft.inertia * length
    for at, inertia, rigidity in (([0, 6], mass, shaft.E * shaft.area), ([3, 9], polar, 2.0 * shaft.G * shaft.inertia)):
        M[np.ix_(at, at)] = inertia / 6.0 * np.array([[2.0, 1.0], [1.0, 2.0]])
        K[np.ix_(at, at)] = rigidity / length * np.array([[1.0, -1.0], [-1.0, 1.0]])
    for at, sign in (
        ([1, 5, 7, 11], 1.0),
        ([2, 4, 8, 10], -1.0),
    ):  # a rotation about y is a negative slope in z
        M[np.ix_(at, at)], K[np.ix_(at, at)] = _bending(mass, shaft.E * shaft.inertia, length, sign)
    return M, K


def _bending(mass: float, rigidity: float, length: float, sign: float) -> tuple[FloatArray, FloatArray]:
    a, b = sign * length, length**2
    M = [[156, 22 * a, 54, -13 * a], [22 * a, 4 * b, 13 * a, -3 * b], [54, 13 * a, 156, -22 * a],
         [-13 * a, -3 * b, -22 * a, 4 * b]]  # fmt: skip
    K = [
        [12, 6 * a, -12, 6 * a],
        [6 * a, 4 * b, -6 * a, 2 * b],
        [-12, -6 * a, 12, -6 * a],
        [6 * a, 2 * b, -6 * a, 4 * b],
    ]
    return mass / 420.0 * np.array(M), rigidity / length**3 * np.array(K)
