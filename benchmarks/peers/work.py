"""What every solver is given: a driven shaft as numbers and as matrices, in numpy alone.

B1 is one run at 1500 rpm, B5 the same shaft at 100 speeds. The elements are written out here once more, independently
of flexcam: solvers with elements of their own build the shaft from the numbers, the others take the matrices.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]


@dataclass(frozen=True)
class Work:
    """A steel shaft between bearings, a mass at its middle, a force and a torque that turn there; undamped, from rest.

    ``Fy = force (1 - cos w t)``, ``Tx = torque sin w t``; Newmark's method with beta = 1/4, gamma = 1/2. The first
    node is held in ux, uy, uz, rx, the last one in uy, uz. A longer shaft is the same one again, span by span, with
    a bearing (uy, uz) between spans; mass and loads stay in the first. Lengths and elements are those of a span. SI.
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
        """Of the section, m^2."""
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
        """Number of the last node, which is that of elements in all spans."""
        return self.spans * self.elements

    @property
    def held(self) -> dict[int, tuple[int, ...]]:
        """Held components (0 to 5: ux, uy, uz, rx, ry, rz) by node."""
        bearings = range(self.elements, self.last + 1, self.elements)
        return {0: (0, 1, 2, 3), **dict.fromkeys(bearings, (1, 2))}

    def step(self, frequency: float) -> float:
        """Return the step at a speed, s: all speeds take as many steps per revolution."""
        return 1.0 / (frequency * self.steps_per_revolution)

    def loads(self, frequency: float) -> FloatArray:
        """Return force and torque at all instants, shape (steps + 1, 2)."""
        angle = 2.0 * math.pi * np.arange(self.steps + 1) / self.steps_per_revolution
        return np.column_stack([self.force * (1.0 - np.cos(angle)), self.torque * np.sin(angle)])


@dataclass(frozen=True, eq=False)
class Result:
    """What every solver gives back.

    Parameters
    ----------
    displacement
        uy and rx of the middle node at all instants, shape (speeds, steps + 1, 2).
    loop_seconds
        Spent in the call that integrates, factorization and first acceleration included.
    whole_seconds
        Spent in all, from numbers to displacements, without imports.
    """

    displacement: FloatArray
    loop_seconds: float
    whole_seconds: float


B1 = Work()
B5 = Work(frequencies=tuple(np.linspace(500.0, 5000.0, 100) / 60.0))


def matrices(work: Work) -> tuple[FloatArray, FloatArray, NDArray[np.intp]]:
    """Return mass and stiffness of the free unknowns, dense, and the places of the middle node's uy and rx in them."""
    count = 6 * (work.last + 1)
    M, K = np.zeros((count, count)), np.zeros((count, count))
    m, k = _element(work)
    for i in range(work.last):
        at = slice(6 * i, 6 * i + 12)
        M[at, at] += m
        K[at, at] += k
    for i in range(3):
        M[6 * work.middle + i, 6 * work.middle + i] += work.mass
    held = [6 * node + i for node, components in work.held.items() for i in components]
    free = np.setdiff1d(np.arange(count), held)
    watched = np.searchsorted(free, [6 * work.middle + 1, 6 * work.middle + 3])
    return M[np.ix_(free, free)], K[np.ix_(free, free)], watched


def _element(work: Work) -> tuple[FloatArray, FloatArray]:
    """Return consistent mass (without rotary inertia) and stiffness of an Euler-Bernoulli beam along x, 12 x 12."""
    length = work.length / work.elements
    M, K = np.zeros((12, 12)), np.zeros((12, 12))
    mass, polar = work.density * work.area * length, 2.0 * work.density * work.inertia * length
    for at, inertia, rigidity in (([0, 6], mass, work.E * work.area), ([3, 9], polar, 2.0 * work.G * work.inertia)):
        M[np.ix_(at, at)] = inertia / 6.0 * np.array([[2.0, 1.0], [1.0, 2.0]])
        K[np.ix_(at, at)] = rigidity / length * np.array([[1.0, -1.0], [-1.0, 1.0]])
    for at, sign in (([1, 5, 7, 11], 1.0), ([2, 4, 8, 10], -1.0)):  # a rotation about y lifts against z
        M[np.ix_(at, at)], K[np.ix_(at, at)] = _bending(mass, work.E * work.inertia, length, sign)
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
