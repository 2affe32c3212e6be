"""Parts of a train that hang on it: masses, springs and their wire, loads."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from flexcam.fem import PointMass
from flexcam.linalg import FloatArray


@dataclass(frozen=True)
class MassAt:
    """A rigid body at a point: a named node, or the point a rocker defines (then only its mass counts)."""

    at: str
    body: PointMass


@dataclass(frozen=True)
class Wire:
    """Wire of a coil spring, for its stress.

    Parameters
    ----------
    diameter, coil_diameter
        Of the wire and of the coil's mean circle, m.
    """

    diameter: float
    coil_diameter: float

    @property
    def wahl(self) -> float:
        """Wahl's factor for curvature and direct shear, ``(4C - 1)/(4C - 4) + 0.615/C`` with C = D/d."""
        C = self.coil_diameter / self.diameter
        return (4.0 * C - 1.0) / (4.0 * C - 4.0) + 0.615 / C

    def rate(self, shear_modulus: float, active_coils: float) -> float:
        """Return the stiffness ``G d^4/(8 D^3 n)``, N/m, by shear modulus (Pa) and active coils."""
        return shear_modulus * self.diameter**4 / (8.0 * self.coil_diameter**3 * active_coils)


@dataclass(frozen=True)
class Pulsation:
    """Swing of a stiffness with the cam angle, k (1 + amplitude cos(order theta + phase)).

    Parameters
    ----------
    order
        Swings per camshaft revolution.
    amplitude
        Part of the mean stiffness.
    phase
        rad.
    """

    order: float
    amplitude: float
    phase: float = 0.0

    def part(self, angle: FloatArray) -> FloatArray:
        """Return the swing at cam angles, rad, as a part of the mean stiffness."""
        return self.amplitude * np.cos(self.order * angle + self.phase)


@dataclass(frozen=True, eq=False)
class Spring:
    """A spring and damper along one direction, to ground or between two points.

    Parameters
    ----------
    at
        A named node, or the point a rocker defines.
    direction
        Weights of the six components, shape (6,), global axes; at a rocker's point its share along the rocker's.
    stiffness, damping
        N/m and N s/m, or N m/rad and N m s/rad for a rotation.
    to
        The other end; None for ground.
    installed_force
        Force it is installed with, N, or N m about an axis: it pushes against `direction`; None where none is stated.
    mass
        kg, spread evenly over its length.
    elements
        Equal parts, each with its share of stiffness and mass: more than one lets it surge.
    clash_travel
        Travel along `direction` from the installed length to where all coils touch, m; None without.
    clash_stiffness
        Of one contact between neighbouring parts, N/m.
    wire
        For its stress; None where it is not known.
    pulsation
        Swing of its stiffness, on the stretch from where it is installed; None for a constant one.
    link
        Whether it stands for an elastic part of the train between two points, which is rigid in the rigid mechanism.
    """

    at: str
    direction: FloatArray
    stiffness: float
    damping: float = 0.0
    to: str | None = None
    installed_force: float | None = None
    mass: float = 0.0
    elements: int = 1
    clash_travel: float | None = None
    clash_stiffness: float = 0.0
    wire: Wire | None = None
    pulsation: Pulsation | None = None
    link: bool = False

    @property
    def turns(self) -> bool:
        """Whether it resists a rotation: its force is a moment then, its stretch an angle."""
        return not self.direction[:3].any()


@dataclass(frozen=True, eq=False)
class GivenLoad:
    """A constant force or moment at a point, or a force spread over a member.

    Parameters
    ----------
    size
        N at a point (N m for a moment), N/m over a member.
    direction
        Shape (6,), global axes; translation only over a member.
    at
        A named node, or the point of a rocker; None for a force over a member.
    member
        Name of the member; None for a force at a point.
    """

    size: float
    direction: FloatArray
    at: str | None = None
    member: str | None = None
