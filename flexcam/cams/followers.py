"""Followers: contact point on the cam and geometry of the cam profile.

Plane geometry in complex numbers, the cam's centre at the origin. Followers are defined in the fixed frame: a
translating one moves up, along the imaginary axis; the pivot of a swinging one lies on the positive real axis. The cam
turns by the angle theta, counterclockwise where ``turn`` is 1 and clockwise where it is -1; in the frame of the cam a
fixed point c is ``c exp(-i turn theta)``. Curvature is taken from the profile's derivatives, which follow from lift,
velocity and acceleration; nothing is differentiated numerically.

Sources: F. Y. Chen, Mechanics and Design of Cam Mechanisms (1982), ch. 4-5; R. L. Norton, Cam Design and Manufacturing
Handbook, 2nd ed. (2009), ch. 7. The equations for the swinging follower with a flat face are derived in the code.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from dataclasses import dataclass, field, replace
from typing import Any, Literal, Self

import numpy as np
from numpy.typing import NDArray

from flexcam.core import ComplexArray, FloatArray
from flexcam.core.errors import positive, refuse

Turn = Literal[1, -1]
"""Sense of rotation of the cam: 1 counterclockwise, -1 clockwise."""


@dataclass(frozen=True, eq=False)
class FollowerContact:
    """Contact of a follower with its cam as a function of the cam angle, fixed frame."""

    point: ComplexArray  #: contact point, m, shape (n,), complex
    normal: ComplexArray  #: unit normal of the cam there, outward
    radius: FloatArray  #: radius of curvature of the cam, m: positive where it is convex, negative where hollow
    motion: ComplexArray  #: unit direction in which the follower's touching point moves on the rise
    trace: ComplexArray  #: centre of the roller, m; the contact point itself for a flat face
    #: velocity of the cam's surface relative to the follower along the tangent (normal turned by -90 deg), m/rad
    sliding: FloatArray
    sliding_rate: FloatArray  #: its derivative by the cam angle, m/rad^2
    pressure_rate: FloatArray  #: derivative by the cam angle of the angle from the normal to the motion, 1
    #: displacement along the normal per lift; for a swinging flat face the distance contact to pivot, by the arm
    reach: FloatArray
    reach_rate: FloatArray  #: its derivative by the cam angle, 1
    turning: FloatArray  #: angle by which the normal turns per cam angle, counterclockwise, 1


@dataclass(frozen=True)
class Follower(ABC):
    """Base class of followers.

    `lift` is in metres along the path of the part that follows the cam: of the roller's centre where it swings, of a
    point at the arm's length for a swinging flat face.
    """

    base_radius: float  #: of the cam, m
    roller_radius: float  #: m; infinite for a flat face

    @property
    def lift_direction(self) -> complex:
        """Unit direction in which the lift begins, fixed frame: upwards, or normal to the arm on the base circle."""
        return 1j

    @abstractmethod
    def contact(self, lift: FloatArray, velocity: FloatArray, acceleration: FloatArray, turn: Turn) -> FollowerContact:
        """Return the contact at given lift (m), velocity (m/rad) and acceleration (m/rad^2), shape (n,) each."""

    @abstractmethod
    def lift_at(self, point: ComplexArray) -> FloatArray:
        """Return the lift at which the follower would contact points in the fixed frame, m; -inf if unreachable."""

    def with_base(self, base_radius: float) -> Self:
        """Return the same follower on another base circle."""
        return replace(self, base_radius=base_radius)


@dataclass(frozen=True)
class FlatFollower(Follower):
    """Translating follower with a flat face normal to its motion."""

    roller_radius: float = field(default=math.inf, init=False, repr=False)
    face_diameter: float | None = None  #: of a round face, m
    #: distance from the follower's axis to the middle of the cam, along the shaft, m: it rotates a round face
    axial_offset: float = 0.0
    crown_radius: float | None = None  #: of a spherical face, m
    taper: float = 0.0  #: of the lobe to the shaft, rad: it moves the contact of a crowned face toward its thick end

    def __post_init__(self) -> None:
        positive("base_radius", self.base_radius, "m")
        for key, size in (("face_diameter", self.face_diameter), ("crown_radius", self.crown_radius)):
            if size is not None:
                positive(f"follower.{key}", size, "m")

    @property
    def rotation_arm(self) -> float:
        """Distance along the shaft from the follower's axis to its contact, m: friction there rotates the follower."""
        return self.axial_offset if self.crown_radius is None else self.crown_radius * math.tan(self.taper)

    @property
    def lobe_contact(self) -> float:
        """Distance along the shaft from the middle of the lobe to the contact, m; infinite for a tapered edge."""
        return self.rotation_arm - self.axial_offset if self.crown_radius or not self.taper else math.inf

    def face_radius(self, contact_offset: float, width: float | None) -> float:
        """Return the radius of a round face, m, that contains the contact of a cam: a line of its width, or a point."""
        half = 0.5 * (width or 0.0) if self.crown_radius is None else 0.0
        return math.hypot(contact_offset, half + abs(self.rotation_arm))

    def contact(self, lift: FloatArray, velocity: FloatArray, acceleration: FloatArray, turn: Turn) -> FollowerContact:
        """Return the contact, at the distance s' from the axis, where the velocities along the normal agree."""
        height = self.base_radius + lift
        point = _complex(turn * velocity + 1j * height)
        up = _complex(np.full(point.shape, 1j))
        zeros = np.zeros(point.shape)
        rates = -turn * height, -turn * velocity, zeros, 1.0 + zeros, zeros, zeros
        return FollowerContact(point, up, height + acceleration, up, point, *rates)

    def lift_at(self, point: ComplexArray) -> FloatArray:
        """Return the height of the face above the base circle."""
        return point.imag - self.base_radius


def _complex(values: NDArray[Any]) -> ComplexArray:
    return np.asarray(values, dtype=np.complex128)


def _roller_contact(
    trace: ComplexArray, first: ComplexArray, second: ComplexArray, motion: ComplexArray, swing: FloatArray | float,
    radius: float, turn: Turn,
) -> FollowerContact:  # fmt: skip
    """Return the contact of a roller from its centre path in the fixed frame, two derivatives, and its direction.

    `swing` is the rotation of the direction per cam angle.
    """
    # In the frame of the cam, c exp(-i turn theta): its derivatives, without the common factor.
    speed = first - 1j * turn * trace
    bend = second - 2j * turn * first - trace
    norm, curved = np.abs(speed), np.conj(speed) * bend
    tangent = speed / norm
    normal = 1j * turn * tangent
    pitch = -turn * norm**3 / curved.imag
    point = trace - radius * normal
    # The material velocity of the cam at the contact minus that of the roller's centre, along the tangent.
    sliding = (np.conj(-1j * normal) * (1j * turn * point - first)).real
    # The normal follows the path velocity, which rotates in the frame of the cam and with the frame.
    pressure_rate = swing - turn - curved.imag / norm**2
    lean = motion * np.conj(normal)
    return FollowerContact(
        point, normal, pitch - radius, motion, trace, sliding, -turn * curved.real / norm, pressure_rate,
        lean.real, -lean.imag * pressure_rate, swing - pressure_rate,
    )  # fmt: skip


@dataclass(frozen=True)
class RollerFollower(Follower):
    """Translating follower with a roller."""

    #: distance of the follower's axis from the cam's, m; positive to the right of the upward motion
    offset: float = 0.0

    def __post_init__(self) -> None:
        positive("base_radius", self.base_radius, "m")
        positive("follower.radius", self.roller_radius, "m")
        if not abs(self.offset) < self.base_radius + self.roller_radius:
            given = f"{1e3 * self.offset:g} mm"
            allowed = f"less than base circle and roller together, {1e3 * (self.base_radius + self.roller_radius):g} mm"
            raise refuse("follower.offset", given, allowed, "the roller would not touch the cam")

    @property
    def _start(self) -> float:
        """Height of the roller's centre on the base circle."""
        return math.sqrt((self.base_radius + self.roller_radius) ** 2 - self.offset**2)

    def contact(self, lift: FloatArray, velocity: FloatArray, acceleration: FloatArray, turn: Turn) -> FollowerContact:
        """Return the contact where the normal of the centre's path meets the roller."""
        trace = _complex(self.offset + 1j * (self._start + lift))
        up = _complex(np.full(trace.shape, 1j))
        return _roller_contact(
            trace, _complex(1j * velocity), _complex(1j * acceleration), up, 0.0, self.roller_radius, turn
        )

    def lift_at(self, point: ComplexArray) -> FloatArray:
        """Return the lift at which the roller would contact a point."""
        square = self.roller_radius**2 - (point.real - self.offset) ** 2
        height = point.imag + np.sqrt(np.where(square >= 0.0, square, 0.0))
        return np.where(square >= 0.0, height - self._start, -math.inf)


@dataclass(frozen=True)
class SwingRollerFollower(Follower):
    """Swinging follower with a roller at the end of its arm."""

    #: `arm`, `distance`: pivot to roller centre, pivot to cam centre, m
    arm: float
    distance: float
    side: Turn = 1  #: 1 where the arm turns clockwise on the rise (roller above the line of centres), else -1

    def __post_init__(self) -> None:
        positive("base_radius", self.base_radius, "m")
        positive("follower.radius", self.roller_radius, "m")
        positive("follower.arm", self.arm, "m")
        positive("follower.distance", self.distance, "m")
        pitch = self.base_radius + self.roller_radius
        if not abs(self.arm - self.distance) < pitch < self.arm + self.distance:
            given = f"base_radius + radius = {1e3 * pitch:g} mm"
            ends = 1e3 * abs(self.arm - self.distance), 1e3 * (self.arm + self.distance)
            allowed = f"{ends[0]:g} to {ends[1]:g} mm for this arm and distance"
            why = "arm, distance and prime circle (base_radius + radius) must form a triangle"
            raise refuse("follower", given, allowed, why, "change distance or base_radius")

    @classmethod
    def from_angle(
        cls, roller_radius: float, arm: float, distance: float, angle: float, side: Turn = 1
    ) -> SwingRollerFollower:
        """Return the follower from the angle (rad) of its arm to the line of centres on the base circle."""
        pitch = math.sqrt(arm**2 + distance**2 - 2.0 * arm * distance * math.cos(angle))
        if pitch <= roller_radius:
            given = f"{math.degrees(angle):g} deg, where the roller's centre is {pitch:g} m from the cam's"
            raise refuse("follower.angle", given, "an angle with a base circle above zero", "", "use a larger angle")
        return cls(pitch - roller_radius, roller_radius, arm, distance, side)

    @property
    def start_angle(self) -> float:
        """Angle of the arm to the line of centres on the base circle, rad."""
        pitch = self.base_radius + self.roller_radius
        return math.acos((self.arm**2 + self.distance**2 - pitch**2) / (2.0 * self.arm * self.distance))

    @property
    def lift_direction(self) -> complex:
        """Unit vector normal to the arm on the base circle."""
        return complex(1j * self.side * np.exp(-1j * self.side * self.start_angle))

    def contact(self, lift: FloatArray, velocity: FloatArray, acceleration: FloatArray, turn: Turn) -> FollowerContact:
        """Return the contact where the normal of the centre's path meets the roller."""
        angle = self.start_angle + lift / self.arm
        rate, bend = velocity / self.arm, acceleration / self.arm
        reach = _complex(-self.arm * np.exp(-1j * self.side * angle))
        first = _complex(-1j * self.side * rate * reach)
        second = _complex(-1j * self.side * bend * reach - rate**2 * reach)
        motion = _complex(-1j * self.side * reach / self.arm)
        swing = -self.side * rate
        return _roller_contact(_complex(self.distance + reach), first, second, motion, swing, self.roller_radius, turn)

    def lift_at(self, point: ComplexArray) -> FloatArray:
        """Return the lift at which the roller would contact a point: the larger of two triangle solutions."""
        span = np.abs(point - self.distance)
        direction = np.angle(-(point - self.distance)) * -self.side
        cosine = (self.arm**2 + span**2 - self.roller_radius**2) / (2.0 * self.arm * np.maximum(span, 1e-300))
        angle = direction + np.arccos(np.clip(cosine, -1.0, 1.0))
        return np.where(np.abs(cosine) <= 1.0, self.arm * (angle - self.start_angle), -math.inf)


@dataclass(frozen=True)
class SwingFlatFollower(Follower):
    """Swinging follower with a flat face."""

    roller_radius: float = field(default=math.inf, init=False, repr=False)
    #: `arm`, `distance`: length at which the lift is measured, and pivot to cam centre, m
    arm: float
    distance: float
    face: float = 0.0  #: distance of the face from the pivot, m; positive where the pivot lies on the cam's side of it
    side: Turn = 1  #: 1 where it turns clockwise on the rise, -1 where counterclockwise

    def __post_init__(self) -> None:
        positive("base_radius", self.base_radius, "m")
        positive("follower.arm", self.arm, "m")
        positive("follower.distance", self.distance, "m")
        if not abs(self.base_radius - self.face) < self.distance:
            allowed = f"within {self.distance:g} m (the distance) of the base radius"
            raise refuse("follower.face", f"{self.face:g} m", allowed, "the face must touch the base circle")

    @property
    def start_angle(self) -> float:
        """Angle of the face to the line of centres on the base circle, rad."""
        return math.asin((self.base_radius - self.face) / self.distance)

    @property
    def lift_direction(self) -> complex:
        """Unit vector normal to the face on the base circle."""
        return complex(1j * self.side * np.exp(-1j * self.side * self.start_angle))

    def contact(self, lift: FloatArray, velocity: FloatArray, acceleration: FloatArray, turn: Turn) -> FollowerContact:
        """Return the contact at the distance q along the face where the normal velocities of cam and face agree.

        With the face's direction t = -exp(-i psi), its normal m = -i t and the cam's velocity i turn z, equal normal
        velocities at z = a + q t + e m give q = a cos(psi)/(1 + turn psi'). The lower side is the mirror image.
        """
        sense = turn * self.side
        psi = self.start_angle + lift / self.arm
        rate, bend = velocity / self.arm, acceleration / self.arm
        a, e, slip = self.distance, self.face, 1.0 + sense * velocity / self.arm
        q = a * np.cos(psi) / slip
        q_rate = -a * np.sin(psi) * rate / slip - sense * bend * q / slip
        tangent = -np.exp(-1j * psi)
        normal = -1j * tangent
        point = a + q * tangent + e * normal
        path = q_rate - (rate + sense) * e - sense * a * np.sin(psi)
        sliding = (np.conj(tangent) * (1j * sense * point + 1j * rate * (point - a))).real
        motion = -1j * (point - a) / np.abs(point - a)
        fixed = [vector if self.side > 0 else np.conj(vector) for vector in (point, normal, motion)]
        # In full the sliding is sense a sin(psi) + (sense + psi') e, and the motion is inclined like q - i e.
        sliding_rate = sense * a * np.cos(psi) * rate + e * bend
        pressure_rate = self.side * e * q_rate / (q**2 + e**2)
        # The tangent is the normal turned by -90 deg: along the face in the mirror image, against it otherwise.
        return FollowerContact(
            fixed[0], fixed[1], -sense * path / slip, fixed[2], fixed[0], -self.side * sliding,
            -self.side * sliding_rate, pressure_rate, q / self.arm, q_rate / self.arm, -self.side * rate,
        )  # fmt: skip

    def lift_at(self, point: ComplexArray) -> FloatArray:
        """Return the lift at which the face would contact a point."""
        mirrored = point if self.side > 0 else np.conj(point)
        span = np.abs(mirrored - self.distance)
        direction = -np.angle(-(mirrored - self.distance))
        sine = self.face / np.maximum(span, 1e-300)
        angle = direction - np.arcsin(np.clip(sine, -1.0, 1.0))
        return np.where(np.abs(sine) <= 1.0, self.arm * (angle - self.start_angle), -math.inf)
