"""The valve train as a value: what it consists of, no matrices yet."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from types import MappingProxyType

from flexcam.cam import Follower, Turn
from flexcam.fem import Damping, Member, Mesh, PointMass
from flexcam.linalg import FloatArray
from flexcam.motion import Event


@dataclass(frozen=True)
class MassAt:
    """A rigid body at a point: a named node, or the point a rocker defines (then only its mass counts)."""

    at: str
    body: PointMass


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
        Force it is installed with, N: it pushes against `direction`; None where nothing is stated.
    mass
        kg, spread evenly over its length.
    elements
        Equal parts, each with its share of stiffness and mass: more than one lets it surge.
    clash_travel
        Travel along `direction` from the installed length to where all coils touch, m; None without.
    clash_stiffness
        Of one contact between neighbouring parts, N/m.
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


@dataclass(frozen=True, eq=False)
class Rocker:
    """A rigid rocker without bending: the valve moves by the ratio of the arms.

    Parameters
    ----------
    start
        Named node it is driven at.
    point
        Name of the point it defines (the valve).
    arms
        Arm at the driven node and at the valve, m.
    inertia
        About the rocker's shaft, kg m^2.
    direction
        Direction of the motion at the driven node, shape (6,); the point's motion is positive with it.
    """

    start: str
    point: str
    arms: tuple[float, float]
    inertia: float
    direction: FloatArray

    @property
    def ratio(self) -> float:
        """Motion of the point per motion of the driven node."""
        return self.arms[1] / self.arms[0]


@dataclass(frozen=True, eq=False)
class Cam:
    """A cam on the camshaft.

    Parameters
    ----------
    at
        Named node of the camshaft.
    event
        Lift over the cam angle.
    follower
        What touches it; None where nothing is said of it.
    turn
        Sense of rotation in the plane of the profile: 1 counterclockwise, -1 clockwise.
    width
        Along the shaft, m.
    """

    at: str
    event: Event
    follower: Follower | None = None
    turn: Turn = 1
    width: float | None = None


@dataclass(frozen=True, eq=False)
class PublishedLoad:
    """The published coupling: the cam drives the follower by a force (Tayeb and Sliman, eqs. 21-26).

    Parameters
    ----------
    cam
        Name of the cam.
    follower
        Named node of the follower (tappet).
    direction
        Direction of the lift, shape (6,), translation only.
    shaft_axis
        Unit vector along the camshaft in the sense of rotation, shape (3,).
    preload_factor
        Preload as a multiple of the force the rigid train needs for contact.
    cam_deflection
        Whether the force feels the shaft's deflection, U_c of (21).
    cam_torque
        Whether the force twists the shaft, T_CF of (24).
    """

    cam: str
    follower: str
    direction: FloatArray
    shaft_axis: FloatArray
    preload_factor: float = 2.5
    cam_deflection: bool = False
    cam_torque: bool = True


@dataclass(frozen=True, eq=False)
class CamContact:
    """A cam that lifts its follower through the stiffness of their contact.

    Parameters
    ----------
    cam
        Name of the cam.
    follower
        Named node of the follower.
    direction
        Direction of the lift, shape (6,), translation only.
    shaft_axis
        Unit vector along the camshaft in the sense of rotation, shape (3,).
    stiffness
        N/m; None for that of Hertz' line contact.
    unilateral
        Whether it can part; if not, it pulls as well.
    dissipation
        chi of Hunt and Crossley, s/m: the force is that of the stiffness times 1 + chi times the rate of approach.
    restitution
        Rate of parting per rate of approach of an impact; None where they meet without one.
    friction, friction_speed
        Coulomb's coefficient, and the velocity of sliding over which friction turns over, m/s.
    """

    cam: str
    follower: str
    direction: FloatArray
    shaft_axis: FloatArray
    stiffness: float | None
    unilateral: bool
    dissipation: float = 0.0
    restitution: float | None = None
    friction: float = 0.0
    friction_speed: float = 0.01


@dataclass(frozen=True, eq=False)
class Seat:
    """A stop at a point, such as a valve seat: it resists motion against the point's positive direction.

    Parameters
    ----------
    at
        A named node, or the point of a rocker.
    direction
        Shape (6,): the way off the seat; zeros for a rocker's own.
    stiffness, damping
        N/m and N s/m.
    restitution
        Rate of parting per rate of approach of an impact; None where they meet without one.
    """

    at: str
    direction: FloatArray
    stiffness: float
    damping: float = 0.0
    restitution: float | None = None


@dataclass(frozen=True, eq=False)
class Lash:
    """Play between a rocker and its point, which then moves by itself.

    Parameters
    ----------
    rocker
        Name of the rocker.
    gap
        m, at the point.
    stiffness, damping
        Of the contact between both, at the point, N/m and N s/m.
    """

    rocker: str
    gap: float
    stiffness: float
    damping: float = 0.0


Contact = PublishedLoad | CamContact | Seat | Lash


@dataclass(frozen=True, eq=False)
class Model:
    """A flexible mechanism: mesh, members, supports and everything attached to them.

    Parameters
    ----------
    mesh
        Nodes, members as chains, named points.
    members
        Member name to its data.
    supports
        Point name to the components held.
    masses, springs, rockers, cams, contacts, loads
        Attached parts by name.
    gravity
        Acceleration, m/s^2, global axes.
    damping
        Of the whole structure.
    probes
        Points to watch: named nodes or points of rockers.

    Examples
    --------
    `flexcam.case.build_model` makes one from a case; `flexcam.train.build_system` turns it into equations.
    """

    mesh: Mesh
    members: Mapping[str, Member]
    supports: Mapping[str, tuple[str, ...]] = field(default_factory=dict[str, tuple[str, ...]])
    masses: Mapping[str, MassAt] = field(default_factory=dict[str, MassAt])
    springs: Mapping[str, Spring] = field(default_factory=dict[str, Spring])
    rockers: Mapping[str, Rocker] = field(default_factory=dict[str, Rocker])
    cams: Mapping[str, Cam] = field(default_factory=dict[str, Cam])
    contacts: Mapping[str, Contact] = field(default_factory=dict[str, Contact])
    loads: Mapping[str, GivenLoad] = field(default_factory=dict[str, GivenLoad])
    gravity: tuple[float, float, float] = (0.0, 0.0, 0.0)
    damping: Damping = field(default_factory=Damping)
    probes: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        for name in ("members", "supports", "masses", "springs", "rockers", "cams", "contacts", "loads"):
            object.__setattr__(self, name, MappingProxyType(dict(getattr(self, name))))

    @property
    def driven(self) -> dict[str, PublishedLoad | CamContact]:
        """Contacts of a cam with its follower, by name."""
        return {n: one for n, one in self.contacts.items() if isinstance(one, PublishedLoad | CamContact)}

    def lash_of(self, rocker: str) -> Lash | None:
        """Return the play of a rocker, or None where its point is one with it."""
        plays = (one for one in self.contacts.values() if isinstance(one, Lash))
        return next((one for one in plays if one.rocker == rocker), None)

    @property
    def loose_points(self) -> dict[str, Rocker]:
        """Points that move by themselves because their rocker has play, by name."""
        return {rocker.point: rocker for name, rocker in self.rockers.items() if self.lash_of(name)}

    def rocker_at(self, point: str) -> Rocker | None:
        """Return the rocker that defines a point, or None."""
        return next((r for r in self.rockers.values() if r.point == point), None)
