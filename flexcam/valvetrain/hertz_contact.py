"""Hertz's line contact of cam and follower: constants of its force law, and its pressure."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from flexcam.core import FloatArray
from flexcam.dynamics import ONE, AngleFunction, ForceLaw
from flexcam.dynamics.force_laws import LINE_CONTACT

STRAIGHT = 10.0
"""Maximum ratio of relative radius to depth: the logarithm is invalid for conformal contact of cam and roller."""


@dataclass(frozen=True, eq=False)
class HertzLine:
    """Line contact of cam and follower with a relative radius of curvature that depends on the cam angle.

    A cylinder of radius R pressed by p per length approaches its middle by ``(1 - nu^2) p/(pi E) (2 ln(4 R/a) - 1)``
    and sinks into a flat body of depth d by ``(1 - nu^2) p/(pi E) (2 ln(2 d/a) - nu/(1 - nu))``, with the half width
    ``a^2 = 4 p R/(pi E*)`` of the relative radius: K. L. Johnson, Contact Mechanics (1985), eqs. 4.43, 5.57 and 5.58.
    In the sum the radius cancels: with ``q = (1 - nu^2) p/(pi E)`` the approach is ``q (2 ln(d/q) - 1 - nu/(1 - nu))``,
    and of two cylinders ``q (2 ln(2 (R1 + R2)/q) - 2)``: only the distance of their axes remains. The curvature of the
    cam enters the pressure, but the stiffness at most by a logarithm, which is evaluated for the base circle.

    Parameters
    ----------
    width
        Length of the line, m.
    modulus, poisson
        E and nu of both bodies.
    radius
        Relative radius of curvature over the cam angle, m, above zero; `STRAIGHT` depths at most.
    depth
        Depth of the flat body, or twice the distance of the axes of two cylinders on the base circle, m.
    dissipation
        chi of Hunt and Crossley, s/m.
    rolls
        Whether both bodies are cylinders.
    """

    width: float
    modulus: float
    poisson: float
    radius: AngleFunction
    depth: float
    dissipation: float = 0.0
    rolls: bool = False

    @property
    def plane_strain(self) -> float:
        """E/(1 - nu^2) of one body, Pa."""
        return self.modulus / (1.0 - self.poisson**2)

    def law(self, cosine: AngleFunction = ONE) -> ForceLaw:
        """Return the force law along a direction inclined to the contact normal.

        The law is linear above the load at which the half width is half the radius, ``pi E/(128 (1 - nu^2)) R``.

        Parameters
        ----------
        cosine
            Of the angle between direction and normal, over the cam angle; on a swinging flat face the distance of
            the contact from the pivot by the arm.

        Returns
        -------
        ForceLaw
            `flexcam.dynamics.force_laws.line_contact`.
        """
        give = 1.0 / (math.pi * self.plane_strain)
        rest = 2.0 if self.rolls else 1.0 + self.poisson / (1.0 - self.poisson)
        limit = math.pi * self.plane_strain / 128.0
        shape = (self.width, give, rest, self.depth, self.dissipation, limit)
        return ForceLaw(LINE_CONTACT, shape, (self.radius, cosine))

    def pressure(self, force: FloatArray, radius: FloatArray) -> FloatArray:
        """Return the largest Hertz pressure, ``sqrt(p E*/(pi R))``.

        Parameters
        ----------
        force
            Along the normal, N, shape (n,).
        radius
            Relative radius of curvature, m, shape (n,).

        Returns
        -------
        ndarray
            Pa, shape (n,).
        """
        p = np.maximum(force, 0.0) / self.width
        return np.sqrt(p * 0.5 * self.plane_strain / (math.pi * radius))
