"""Cams, and what stands between bodies that may part: contacts, seats, plays, adjusters."""

from __future__ import annotations

from dataclasses import dataclass

from flexcam.cam import Follower, Turn
from flexcam.linalg import FloatArray
from flexcam.motion import Event


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


DAMPING_DEPTH = 1e-5
"""Depth over which a stop's damper takes hold where none is given, m: of the size of seats of engines."""


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
    damping_depth
        Depth over which the damper takes hold, m.
    """

    at: str
    direction: FloatArray
    stiffness: float
    damping: float = 0.0
    restitution: float | None = None
    damping_depth: float = DAMPING_DEPTH


@dataclass(frozen=True, eq=False)
class Lash:
    """Play between a rocker and its point, or between two nodes, which push each other through it.

    Parameters
    ----------
    rocker
        Name of the rocker; None between nodes.
    gap
        m, at the point.
    stiffness, damping
        Of the contact between both, at the point, N/m and N s/m.
    ends
        Names of the pushing and the pushed node; None at a rocker.
    direction
        In which the first pushes the second, shape (6,); None at a rocker.
    damping_depth
        Depth over which the damper takes hold, m.
    """

    rocker: str | None
    gap: float
    stiffness: float
    damping: float = 0.0
    ends: tuple[str, str] | None = None
    direction: FloatArray | None = None
    damping_depth: float = DAMPING_DEPTH


@dataclass(frozen=True, eq=False)
class Adjuster:
    """A hydraulic lash adjuster: oil that carries, leaks past the plunger, and is made up for through a check valve.

    Parameters
    ----------
    rocker
        Name of the rocker it stands on, at its point; None between nodes.
    stiffness
        Of the oil column, N/m.
    leak
        Force per velocity of leak-down, N s/m.
    refill
        The same while the check valve is open, N s/m.
    plunger_force
        Of the spring that keeps it extended, N.
    ends, direction
        As for `Lash`.
    """

    rocker: str | None
    stiffness: float
    leak: float
    refill: float
    plunger_force: float
    ends: tuple[str, str] | None = None
    direction: FloatArray | None = None


@dataclass(frozen=True, eq=False)
class Play:
    """What stands between two nodes, one pushing the other.

    Parameters
    ----------
    ends
        Names of the pushing and the pushed node.
    direction
        In which it pushes, shape (6,).
    gap
        m.
    plunger_force
        With which an adjuster pushes both apart, N.
    """

    ends: tuple[str, str]
    direction: FloatArray
    gap: float
    plunger_force: float


Contact = PublishedLoad | CamContact | Seat | Lash | Adjuster
"""What may stand under the contacts of a model."""
