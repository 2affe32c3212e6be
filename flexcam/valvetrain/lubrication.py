"""Oil film, flash temperature and wear of a line contact, from its load and the motion of both surfaces.

The contact point moves along the cam and along the follower. The velocities of both surfaces relative to the contact
point carry oil into it: their mean is the entrainment velocity, their difference the sliding velocity. These are
evaluations of a run; they do not act on the motion.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from flexcam.cams import CamProfile
from flexcam.core import FloatArray

LOAD_LIMIT = 1e-6
"""Minimum dimensionless load W of the film formulas. A lighter load has the film of this one, thinner than its own."""

BLOK = 0.786
"""Blok's factor for the half width of the contact: the maximum of ``2/pi^1.5 int_-1^s sqrt((1 - t^2)/(s - t)) dt``."""


def cam_surface_velocity(profile: CamProfile) -> FloatArray:
    """Return the velocity of the cam's surface relative to the contact point, per angular velocity of the cam.

    With the radius of curvature R and the rotation psi of the normal, the contact moves along the cam by
    R (1 - turn psi') per angle. The centre of a roller of radius r passes the surface of the cam with v, and the
    contact point passes the centre with r psi': the velocity v - r psi' is finite on a straight flank, too. The result,
    m/rad, shape (n,), is positive along the tangent (normal turned by -90 deg).
    """
    touch, roller = profile.touch, profile.follower.roller_radius
    if math.isfinite(roller):
        return touch.sliding - roller * touch.turning
    return touch.radius * (touch.turning - profile.turn)


def entrainment_velocity(profile: CamProfile) -> FloatArray:
    """Return the mean velocity of both surfaces relative to the contact point, per angular velocity of the cam.

    A translating flat face has the magnitude (r_0 + s + 2 s'')/2, which changes its sign on both sides of the nose:
    J. J. Williams, Introduction to Analytical Methods for Internal Combustion Engine Cam Mechanisms (2013), ch. 4.
    A roller rolls: its surface has the velocity of the cam's. Unit and sign are those of `cam_surface_velocity`.
    """
    cam = cam_surface_velocity(profile)
    return cam if math.isfinite(profile.follower.roller_radius) else cam - 0.5 * profile.touch.sliding


@dataclass(frozen=True)
class Film:
    """Film thickness of an elastohydrodynamic line contact: isothermal, fully flooded, steady.

    The groups are ``U = eta u/(E' R)``, ``G = alpha E'`` and ``W = p/(E' R)`` with the entrainment velocity u, the load
    per length p and the relative radius R. E' is ``2/((1 - nu1^2)/E1 + (1 - nu2^2)/E2)``, for equal materials
    E/(1 - nu^2). Solutions of Reynolds' equation agree within 8 % for U of 3e-12 to 5e-11, G of 2500 to 5000 and W of
    1e-5 to 5e-5 (`tests/verification/test_lubrication.py`).
    """

    modulus: float  #: E', Pa
    viscosity: float  #: eta, of the oil at the inlet, Pa s
    pressure_viscosity: float  #: alpha, 1/Pa

    def minimum(self, velocity: FloatArray, load: FloatArray, radius: FloatArray) -> FloatArray:
        """Return the minimum film thickness, ``2.65 U^0.7 G^0.54 W^-0.13 R``, m.

        The arguments are entrainment velocity, m/s, load per length, N/m, and relative radius of curvature, m.
        D. Dowson, Elastohydrodynamics, Proc. Inst. Mech. Eng. 182 (3A), 1967-68, pp. 151-167.
        """
        U, G, W = self._groups(velocity, load, radius)
        return 2.65 * U**0.7 * G**0.54 * W**-0.13 * radius

    def central(self, velocity: FloatArray, load: FloatArray, radius: FloatArray) -> FloatArray:
        """Return the central film thickness, ``3.06 U^0.69 G^0.56 W^-0.10 R``, m, of the arguments of `minimum`.

        D. Dowson and S. Toyoda, A central film thickness formula for elastohydrodynamic line contacts, Proc. 5th
        Leeds-Lyon Symp. on Tribology (1978), pp. 60-65.
        """
        U, G, W = self._groups(velocity, load, radius)
        return 3.06 * U**0.69 * G**0.56 * W**-0.10 * radius

    def _groups(
        self, velocity: FloatArray, load: FloatArray, radius: FloatArray
    ) -> tuple[FloatArray, float, FloatArray]:
        stiffness = self.modulus * radius
        U, W = self.viscosity * np.abs(velocity) / stiffness, load / stiffness
        return U, self.pressure_viscosity * self.modulus, np.maximum(W, LOAD_LIMIT)


def half_width(load: FloatArray, radius: FloatArray, modulus: float) -> FloatArray:
    """Return the half width of Hertz's line contact, ``sqrt(8 p R/(pi E'))``, m (Johnson, 1985, eq. 4.43)."""
    return np.sqrt(8.0 * load * radius / (math.pi * modulus))


def flash_temperature(
    heat: FloatArray, half_width: FloatArray, effusivity: float, first: FloatArray, second: FloatArray
) -> FloatArray:
    """Return the maximum flash temperature of a line contact of equal materials, K; zero for an open contact.

    ``0.786 q/(beta sqrt(b) (sqrt(|u1|) + sqrt(|u2|)))``, or 1.11 with the full width 2 b: H. Blok, Proc. General
    Discussion on Lubrication, Inst. Mech. Eng. 2 (1937), pp. 222-235. The heat has Hertz's distribution; its division
    gives both surfaces the same maximum. It neglects conduction along the motion: it is too high by 6 % at a Peclet
    number u b density specific_heat/(2 conductivity) of 1, by 31 % at 0.2. The arguments are the friction power per
    length q, W/m, the half width b, m, the effusivity beta, the root of conductivity times density times specific heat,
    W s^0.5/(m^2 K), and the velocities u1, u2 of the surfaces relative to the contact point, m/s, of any sign.
    """
    conduction = effusivity * np.sqrt(half_width) * (np.sqrt(np.abs(first)) + np.sqrt(np.abs(second)))
    return np.divide(BLOK * heat, conduction, out=np.zeros_like(conduction), where=conduction > 0.0)


def wear_depth(coefficient: float, load: FloatArray, sliding: FloatArray, velocity: FloatArray) -> FloatArray:
    """Return the depth worn off the cam per revolution, m, at the points that are in contact.

    Archard's law, depth = k int pressure |sliding| dt, over the passage of the contact: a point of the cam crosses it
    with the velocity u1, so the integral is p |sliding|/|u1| with the load per length p, N/m, and k in m^2/N.
    J. F. Archard, J. Appl. Phys. 24 (1953), pp. 981-988.
    """
    return coefficient * load * np.abs(sliding / velocity)
