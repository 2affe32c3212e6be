"""Beams at rest, vibrating and buckling, against the closed forms of the books."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator

import numpy as np

from flexcam import fem
from flexcam.fem.generate import chain
from flexcam.integrate.statics import static_displacement
from flexcam.linalg import FloatArray
from flexcam.modal import modes
from flexcam.selftest.check import Check

_STEEL = fem.Material(E=207e9, nu=0.29, density=7800.0)
_TUBE = fem.Section.tube(0.020, 0.012)
_LENGTH, _ELEMENTS = 0.9, 16
_SLENDER, _STOUT = fem.Member(_STEEL, _TUBE, rotary_inertia=False), fem.Member(_STEEL, _TUBE, shear=True)
_BENDING = ("uy", "rz")
_FIXED, _PINNED = ("ux", "uy", "uz", "rx", "ry", "rz"), ("ux", "uy", "uz", "rx", "ry")


class _Beam:
    """A straight beam along x, of equal elements, held at its start and perhaps at its end."""

    def __init__(self, member: fem.Member, start: tuple[str, ...], end: tuple[str, ...] = ()) -> None:
        mesh = chain((0.0, 0.0, 0.0), (_LENGTH, 0.0, 0.0), _ELEMENTS)
        self._beams = fem.beams(mesh, {"shaft": member})
        self.dofs = fem.dof_map(mesh, [("start", start), *([("end", end)] if end else [])])
        self.mass, self.stiffness = fem.mass(self._beams, self.dofs), fem.stiffness(self._beams, self.dofs)

    def picked(self, *components: str) -> np.ndarray[tuple[int], np.dtype[np.intp]]:
        """Return the unknowns of some components."""
        return np.array([i for i, name in enumerate(self.dofs.names) if name.rpartition(".")[2] in components], np.intp)

    def pushed(self, component: str, size: float) -> float:
        """Return how far the end gives way to a force or torque."""
        at = self.picked(component)[-1]
        load = np.zeros(len(self.dofs.names))
        load[at] = size
        return float(static_displacement(self.stiffness, load, self.dofs.names)[at])

    def frequencies(self, count: int) -> FloatArray:
        """Return the lowest of bending in x-y, Hz."""
        bends = self.picked(*_BENDING)
        return modes(self.mass.part(bends), self.stiffness.part(bends), count).frequencies

    def buckling(self) -> float:
        """Return the force under which it bends without end, N."""
        bends = self.picked(*_BENDING)
        softened = fem.geometric(self._beams, np.full(len(self._beams), -1.0), self.dofs).part(bends).dense()
        return 1.0 / float(np.linalg.eigvals(np.linalg.solve(self.stiffness.part(bends).dense(), -softened)).real.max())


def structures() -> Iterator[Check]:
    """Yield what beams must do."""
    yield from _pushed()
    yield from _vibrating()
    source = "Timoshenko and Gere, Theory of Elastic Stability, ch. 2"
    euler = math.pi**2 * _STEEL.E * _TUBE.Iz / _LENGTH**2
    found = _Beam(_SLENDER, _PINNED, ("uy", "uz")).buckling()
    yield Check("buckling load of a pinned column", source, euler, found, 1e-5, "N")


def _pushed() -> Iterator[Check]:
    beam, force, torque = _Beam(_SLENDER, _FIXED), 100.0, 10.0
    bent, found = force * _LENGTH**3 / (3.0 * _STEEL.E * _TUBE.Iz), beam.pushed("uy", force)
    yield Check("tip of a cantilever under a force", "Euler-Bernoulli, P L^3/(3 E I)", bent, found, 1e-9, "m")
    twisted, found = torque * _LENGTH / (_STEEL.G * _TUBE.J), beam.pushed("rx", torque)
    yield Check("twist of a tube under a torque", "Saint-Venant, T L/(G J)", twisted, found, 1e-9, "rad")


def _vibrating() -> Iterator[Check]:
    source = "Timoshenko, Vibration Problems in Engineering, sec. 53-58"
    speed = math.sqrt(_STEEL.E * _TUBE.Iz / (_STEEL.density * _TUBE.A))
    found = _Beam(_SLENDER, _FIXED).frequencies(3)
    for n, computed in enumerate(found, start=1):
        near = (n - 0.5) * math.pi
        root = _root(lambda x: math.cos(x) + 1.0 / math.cosh(x), near - 0.6, near + 0.6)
        # Cubic elements: (x/n)^4/1440 in frequency, twice of which passes.
        reference = root**2 / (2.0 * math.pi * _LENGTH**2) * speed
        yield Check(f"bending frequency {n} of a cantilever", source, reference, float(computed),
                    (root / _ELEMENTS) ** 4 / 720.0, "Hz")  # fmt: skip
    found = _Beam(_STOUT, _PINNED, ("uy", "uz")).frequencies(1)
    yield Check(
        "bending frequency of a stout beam, pinned", source, _stout(math.pi / _LENGTH), float(found[0]), 1e-5, "Hz"
    )


def _stout(k: float) -> float:
    """Return the frequency of a pinned Timoshenko beam with waves of k, Hz: the lower root of its quadratic."""
    rho, area, second = _STEEL.density, _TUBE.A, _TUBE.Iz
    shear = _TUBE.kappa_y * _STEEL.G
    a = rho**2 * second / shear  # a w^4 + b w^2 + c = 0
    b = -(rho * area + rho * second * k**2 * (1.0 + _STEEL.E / shear))
    c = _STEEL.E * second * k**4
    square = 2.0 * c / (-b + math.sqrt(b**2 - 4.0 * a * c))
    return math.sqrt(square) / (2.0 * math.pi)


def _root(function: Callable[[float], float], low: float, high: float) -> float:
    """Return a zero between two places of opposite sign, by bisection."""
    rising = function(high) > 0.0
    for _ in range(80):
        middle = 0.5 * (low + high)
        low, high = (low, middle) if (function(middle) > 0.0) == rising else (middle, high)
    return low
