"""Parts of a valve train: masses, springs, loads, cams, contacts and rockers."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from flexcam.cams import Event, Follower, Turn
from flexcam.core import FloatArray
from flexcam.core.errors import refuse
from flexcam.core.units import IN_RADIANS
from flexcam.dynamics import AngleFunction, CamMotion, ForceLaw, Phaser, ShiftedFunction
from flexcam.dynamics.force_laws import OIL_CHAMBER, PULSATING, SHORT_BEARING
from flexcam.fem.rigid_bodies import PointMass


@dataclass(frozen=True)
class MassAt:
    """A rigid body at a point: a named node, or the point a rocker defines (then only its mass counts)."""

    at: str
    body: PointMass


@dataclass(frozen=True)
class Wire:
    """Wire of a coil spring, for its stress."""

    #: `diameter`, `coil_diameter`: of the wire and of the coil's mean circle, m
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
    """Fluctuation of a stiffness with the cam angle, k (1 + amplitude cos(order theta + phase))."""

    order: float  #: periods per camshaft revolution
    amplitude: float  #: fraction of the mean stiffness
    phase: float = 0.0  #: rad

    def part(self, angle: FloatArray) -> FloatArray:
        """Return the relative fluctuation at cam angles, rad."""
        return self.amplitude * np.cos(self.order * angle + self.phase)

    def law(self, stiffness: float) -> ForceLaw:
        """Return the law of the fluctuating part of a stiffness, N/m."""
        return ForceLaw(PULSATING, (stiffness,), (lambda angle, order: self.part(angle),))


@dataclass(frozen=True)
class SpringPart:
    """Part of a spring, of uniform stiffness and mass."""

    #: `stiffness`, `damping`: N/m and N s/m, or N m/rad and N m s/rad for a rotation
    stiffness: float
    damping: float = 0.0
    mass: float = 0.0  #: kg
    travel: float | None = None  #: from the installed length to where its coils touch, m; None without
    wire: Wire | None = None  #: wire, for the stress; None if unknown
    length: float = 0.0  #: as installed, m, of unequal parts

    @property
    def stress_factor(self) -> float:
        """Shear stress of the wire per force, 1/m^2; zero without a wire."""
        wire = self.wire
        return 0.0 if wire is None else wire.wahl * 8.0 * wire.coil_diameter / (math.pi * wire.diameter**3)


@dataclass(frozen=True, eq=False)
class Spring:
    """A spring and damper along one direction, to ground or between two points."""

    at: str  #: a named node, or the point a rocker defines
    #: weights of the six components, shape (6,), global axes; at a rocker's point its share along the rocker's
    direction: FloatArray
    #: `stiffness`, `damping`: N/m and N s/m, or N m/rad and N m s/rad for a rotation
    stiffness: float
    damping: float = 0.0
    to: str | None = None  #: the other end; None for ground
    #: installed force, N, or N m about an axis, acting against `direction`; None if not given
    installed_force: float | None = None
    mass: float = 0.0  #: kg, distributed uniformly over its length
    elements: int = 1  #: number of parts, equal unless `coils` has them; with more than one, surge is modelled
    #: travel along `direction` from the installed length to where all coils touch, m; None without
    clash_travel: float | None = None
    clash_stiffness: float = 0.0  #: of one contact between neighbouring parts, N/m
    wire: Wire | None = None  #: wire, for the stress; None if unknown
    #: fluctuation of the stiffness, acting on the deflection from the installed length; None for a constant one
    pulsation: Pulsation | None = None
    link: bool = False  #: whether it represents an elastic part of the train, which is rigid in the rigid model
    #: rows of travel from the installed length, m, and force, N, if it is not linear; `stiffness` is that as installed
    table: tuple[tuple[float, float], ...] = ()
    #: unequal parts, from the fixed to the moving end; `stiffness` is that of all in series
    coils: tuple[SpringPart, ...] = ()

    @property
    def turns(self) -> bool:
        """True if the spring is rotational: moment and angle instead of force and elongation."""
        return not self.direction[:3].any()

    @property
    def parts(self) -> tuple[SpringPart, ...]:
        """Parts in series, from the fixed to the moving end."""
        n = self.elements
        travel = None if self.clash_travel is None else self.clash_travel / n
        equal = SpringPart(n * self.stiffness, n * self.damping, self.mass / n, travel, self.wire)
        return self.coils or (equal,) * n

    @property
    def compliances(self) -> FloatArray:
        """Compliance of each part relative to the others, shape (parts,)."""
        return np.array([self.stiffness / part.stiffness for part in self.coils] or [1.0] * self.elements)

    @property
    def heights(self) -> FloatArray:
        """Heights of the ends of the parts as installed over that of the moving end, shape (parts + 1,)."""
        ends = np.cumsum([0.0, *([part.length for part in self.coils] or [1.0] * self.elements)])
        return ends / ends[-1]


@dataclass(frozen=True, eq=False)
class FilmBearing:
    """Journal bearing with an oil film, by the theory of the short bearing."""

    at: str  #: named node of the shaft
    #: across the shaft, the second a quarter turn after the first in the sense of rotation, shape (2, 6)
    directions: FloatArray
    #: `diameter`, `length`, `radial_clearance`: m
    diameter: float
    length: float
    radial_clearance: float
    viscosity: float  #: dynamic, Pa s

    def law(self, speed: float) -> ForceLaw:
        """Return the law of the film at a speed of the shaft, rad/s."""
        ratio = self.length / self.radial_clearance
        factor = 0.25 * self.viscosity * self.diameter * ratio**3
        return ForceLaw(SHORT_BEARING, (factor, self.radial_clearance, speed))


@dataclass(frozen=True, eq=False)
class Friction:
    """Friction along one direction, in a guide or a seal, or about a pivot, to ground or between two points.

    In a nest it acts between the coils of two springs at equal heights; point and direction are those of the springs.
    """

    at: str  #: a named node, or the point a rocker defines
    direction: FloatArray  #: as of `Spring`
    #: `force`, `breakaway_force`: at high velocity and when sliding begins, N, or N m about an axis
    force: float
    breakaway_force: float
    #: `stribeck_speed`, `friction_speed`: of the decrease to `force`, and over which friction reverses, m/s or rad/s
    stribeck_speed: float
    friction_speed: float
    damping: float = 0.0  #: viscous part, N s/m or N m s/rad
    to: str | None = None  #: the other side; None for ground
    springs: tuple[str, str] | None = None  #: names of the inner and the outer spring of a nest; None at a point


@dataclass(frozen=True, eq=False)
class LoadTable:
    """Load over the cam angle or over time, linear between its points."""

    at: FloatArray  #: cam angles, rad, or times, s, ascending, shape (m,)
    size: FloatArray  #: N, or N m for a moment, shape (m,)
    over_time: bool = False  #: whether `at` are times
    period: float | None = None  #: rad or s; None for a table that keeps its end values before and after

    def __call__(self, motion: CamMotion) -> FloatArray:
        """Return the load at some instants."""
        x = motion.time if self.over_time else motion.angle
        return np.asarray(np.interp(x, self.at, self.size, period=self.period), dtype=float)


@dataclass(frozen=True, eq=False)
class GivenLoad:
    """Force or moment at a point, or distributed constant force on a member."""

    size: float | LoadTable  #: N at a point (N m for a moment), N/m over a member
    direction: FloatArray  #: shape (6,), global axes; translation only over a member
    at: str | None = None  #: a named node, or the point of a rocker; None for a force over a member
    member: str | None = None  #: name of the member; None for a force at a point


@dataclass(frozen=True, eq=False)
class Cam:
    """A cam on the camshaft."""

    at: str  #: named node of the camshaft
    event: Event  #: lift over the angle of its shaft
    follower: Follower | None = None  #: follower; None if not given
    turn: Turn = 1  #: sense of rotation in the plane of the profile: 1 counterclockwise, -1 clockwise
    width: float | None = None  #: along the shaft, m
    phaser: Phaser | None = None  #: between its shaft and the drive; None without
    #: without a follower: keys of a case that are missing for one
    missing: tuple[str, ...] = ("base_radius", "follower")

    def angle(self, drive: FloatArray) -> FloatArray:
        """Return the angle of its shaft at angles of the drive, rad."""
        return drive if self.phaser is None else self.phaser(drive)

    @property
    def lift(self) -> AngleFunction:
        """Lift over the angle of the drive, m, with two derivatives."""
        return self.event if self.phaser is None else ShiftedFunction(self.event, self.phaser)

    def drive_angle(self, angle: float) -> float:
        """Return the angle of the drive at an angle of its shaft, rad."""
        return angle if self.phaser is None else self.phaser.drive_angle(angle)


@dataclass(frozen=True, eq=False)
class CamPair:
    """A cam and the follower that it lifts."""

    cam: str  #: name of the cam
    follower: str  #: named node of the follower
    direction: FloatArray  #: direction of the lift, shape (6,), translation only
    shaft_axis: FloatArray  #: unit vector along the camshaft in the sense of rotation, shape (3,)

    @property
    def rotation(self) -> FloatArray:
        """Direction of a rotation about the camshaft, shape (6,)."""
        return np.concatenate([np.zeros(3), self.shaft_axis])

    @property
    def across(self) -> FloatArray:
        """Direction normal to lift and camshaft, to the right of a cam that turns counterclockwise, shape (6,)."""
        return np.concatenate([np.cross(self.direction[:3], self.shaft_axis), np.zeros(3)])


@dataclass(frozen=True, eq=False)
class PublishedLoad(CamPair):
    """The published coupling: the cam drives the follower by a force (Tayeb and Sliman, eqs. 21-26)."""

    preload_factor: float = 2.5  #: preload as a multiple of the force the rigid train needs for contact
    cam_deflection: bool = False  #: whether the force depends on the shaft's deflection, U_c of (21)
    cam_torque: bool = True  #: whether the force twists the shaft, T_CF of (24)


@dataclass(frozen=True)
class Lubrication:
    """Oil and surfaces of a cam contact, for film, flash temperature and wear."""

    #: `viscosity`, `pressure_viscosity`: of the oil at the inlet, Pa s, and Barus' coefficient, 1/Pa
    viscosity: float
    pressure_viscosity: float
    roughness: float | None = None  #: rms roughness of both surfaces together, m
    #: `conductivity`, `specific_heat`: of both bodies, W/(m K) and J/(kg K)
    conductivity: float | None = None
    specific_heat: float | None = None
    wear_coefficient: float | None = None  #: volume worn off the cam per load and sliding path, m^2/N


@dataclass(frozen=True, eq=False)
class CamContact(CamPair):
    """Contact of a cam and its follower with a contact stiffness."""

    stiffness: float | None  #: N/m; None for that of Hertz' line contact
    unilateral: bool  #: whether the contact can open; if not, it is bilateral
    #: chi of Hunt and Crossley, s/m: the force is that of the stiffness times 1 + chi times the rate of approach
    dissipation: float = 0.0
    restitution: float | None = None  #: coefficient of restitution; None for contact without impact
    #: `friction`, `friction_speed`: Coulomb's coefficient, and the sliding velocity of the regularization, m/s
    friction: float = 0.0
    friction_speed: float = 0.01
    lubrication: Lubrication | None = None  #: oil and surfaces; None without channels of film and wear


DAMPING_DEPTH = 1e-5
"""Default penetration over which a stop's damping increases, m: typical of engine valve seats."""


@dataclass(frozen=True, eq=False)
class Seat:
    """A stop at a point, such as a valve seat: it resists motion against the point's positive direction."""

    at: str  #: a named node, or the point of a rocker
    direction: FloatArray  #: opening direction, shape (6,); zeros for that of a rocker
    #: `stiffness`, `damping`: N/m and N s/m
    stiffness: float
    damping: float = 0.0
    restitution: float | None = None  #: coefficient of restitution; None for contact without impact
    damping_depth: float = DAMPING_DEPTH  #: penetration over which the damping increases, m


@dataclass(frozen=True, eq=False)
class Lash:
    """Lash between a rocker and its point, or between two nodes."""

    rocker: str | None  #: name of the rocker; None between nodes
    gap: float  #: m, at the point; rad about an axis, as the following ones
    #: `stiffness`, `damping`: of the contact between both, at the point, N/m and N s/m
    stiffness: float
    damping: float = 0.0
    ends: tuple[str, str] | None = None  #: names of the pushing and the pushed node; None at a rocker
    direction: FloatArray | None = None  #: in which the first pushes the second, shape (6,); None at a rocker
    damping_depth: float = DAMPING_DEPTH  #: penetration over which the damping increases, m

    @property
    def turns(self) -> bool:
        """True if the lash is about an axis: moment and angle instead of force and gap."""
        return self.direction is not None and not self.direction[:3].any()


@dataclass(frozen=True)
class PlungerTravel:
    """Stops of a plunger in its body."""

    #: `compression`, `extension`: travel from the installed position to the bottom and to the retaining ring, m
    compression: float
    extension: float
    #: `stiffness`, `damping`: of both stops, N/m and N s/m
    stiffness: float
    damping: float = 0.0


@dataclass(frozen=True, eq=False)
class Adjuster:
    """Hydraulic lash adjuster: oil column with leakage past the plunger and refill through a check valve."""

    rocker: str | None  #: name of its rocker; None between nodes
    stiffness: float  #: of the oil column, N/m
    leak: float  #: force per velocity of leak-down, N s/m
    refill: float  #: leak coefficient while the check valve is open, N s/m
    plunger_force: float  #: of the spring that keeps it extended, N
    #: `ends`, `direction`: as of `Lash`
    ends: tuple[str, str] | None = None
    direction: FloatArray | None = None
    #: chamber whose air follows the pressure and whose check valve has its own law; None for a linear oil column
    chamber: OilChamber | None = None
    travel: PlungerTravel | None = None  #: stops of the plunger; None without


@dataclass(frozen=True)
class CheckValve:
    """Ball check valve through which an oil chamber is refilled."""

    cracking_pressure: float  #: by which the chamber is below the supply as the ball leaves its seat, Pa
    #: `seat_diameter`, `ball_travel`: of the seat, and of the ball to its cage, m
    seat_diameter: float
    ball_travel: float
    density: float  #: of the oil, kg/m^3
    discharge: float  #: coefficient of the orifice

    @property
    def area(self) -> float:
        """Open area between seat and ball, at most that of the seat, m^2."""
        return math.pi * self.seat_diameter * min(self.ball_travel, 0.25 * self.seat_diameter)


_NO_VALVE = CheckValve(0.0, 1.0, 1.0, 0.0, 1.0)

# smallest part of air in an oil chamber: oil below the supply pressure opens a cavity instead of pulling
_MIN_AIR = 1e-6


@dataclass(frozen=True)
class OilChamber:
    """Oil under the plunger of an adjuster, which leaks through the annular gap around it.

    H. E. Merritt, Hydraulic Control Systems (1967): sec. 1-4 (oil with entrained air, adiabatic, in series) and 2-3
    (laminar flow through a concentric annulus, Q = pi d c^3 p/(12 mu L)); an eccentric plunger leaks up to 2.5 times
    as much.
    """

    viscosity: float  #: dynamic, Pa s
    bulk_modulus: float  #: of the oil without air, Pa
    #: `plunger_diameter`, `clearance` (radial), `land_length`, `chamber_height`: m
    plunger_diameter: float
    clearance: float
    land_length: float
    chamber_height: float
    air: float = 0.0  #: part of the volume at the pressure
    pressure: float = 1e6  #: absolute, typical of the loaded chamber, or of the supply if the air follows it, Pa
    follows_pressure: bool = False  #: whether the stiffness of the air depends on the pressure in the chamber
    valve: CheckValve | None = None  #: check valve; None for one that opens at once

    @property
    def area(self) -> float:
        """Area of the plunger, m^2."""
        return 0.25 * math.pi * self.plunger_diameter**2

    @property
    def stiffness(self) -> float:
        """Stiffness ``K A/h`` of the column, N/m."""
        compliance = (1.0 - self.air) / self.bulk_modulus + self.air / (1.4 * self.pressure)
        return self.area / (compliance * self.chamber_height)

    @property
    def leak(self) -> float:
        """Force per velocity of leak-down, ``12 mu L A^2/(pi d c^3)``, N s/m."""
        flow = math.pi * self.plunger_diameter * self.clearance**3 / (12.0 * self.viscosity * self.land_length)
        return self.area**2 / flow

    def law(self, leak: float, refill: float, plunger_force: float) -> ForceLaw:
        """Return the law of the chamber; leak and refill in N s/m, force of the plunger at the supply pressure in N.

        The flow through the open valve is ``Q = C_d A_v sqrt(2 dp/rho)`` (M. G. Rabie, Fluid Power Engineering (2009),
        p. 27, eq. 2.36), hence the force ``rho A^3/2 (w/(C_d A_v))^2`` for the velocity w of the plunger.
        """
        valve = self.valve or _NO_VALVE
        loss = 0.5 * valve.density * self.area**3 / (valve.discharge * valve.area) ** 2
        size = self.area, self.chamber_height, self.bulk_modulus, max(self.air, _MIN_AIR), self.pressure
        flow = leak, self.area * valve.cracking_pressure, refill, loss
        return ForceLaw(OIL_CHAMBER, (*size, *flow, plunger_force))


@dataclass(frozen=True, eq=False)
class NodeLash:
    """Lash or adjuster between two nodes, the first of which pushes the second."""

    ends: tuple[str, str]  #: names of the pushing and the pushed node
    direction: FloatArray  #: in which it pushes, shape (6,)
    gap: float  #: clearance along a line, m; zero of an adjuster and about an axis


Contact = PublishedLoad | CamContact | Seat | Lash | Adjuster
"""Types of contacts of a model."""


_MAX_ANGLE = math.radians(75.0)  # largest angle between an arm and the normal to the motion of its end

_MAX_SINE = math.sin(_MAX_ANGLE)


@dataclass(frozen=True, eq=False)
class Rocker:
    """A rigid rocker without bending: the valve motion is given by the ratio of the arms."""

    start: str  #: named node at which it is driven
    point: str  #: name of the point it defines (the valve)
    arms: tuple[float, float]  #: arm at the driven node and at the valve, m
    inertia: float  #: about the rocker's shaft, kg m^2
    #: direction of the motion at the driven node, shape (6,); the point's motion is positive with it
    direction: FloatArray
    finger: bool = False  #: whether it also defines the point at which it is driven

    @property
    def ratio(self) -> float:
        """Motion of the point per motion of the driven node."""
        return self.arms[1] / self.arms[0]


@dataclass(frozen=True, eq=False)
class Lever(Rocker):
    """Rocker with large rotation and elastic arms: its ratio depends on its angle.

    With p the path of its driven end, the other end moves by ``a2 (sin(b2 + p/a1) - sin b2)``. A
    finger follower has the lift of its cam along the path p.
    """

    #: of both arms as installed, rad: 0 if the arm is normal to the motion of its end
    angles: tuple[float, float] = (0.0, 0.0)
    #: `stiffness`, `damping`: of the arm at the driven node (counts only at a node) and at the point, N/m and N s/m
    stiffness: tuple[float, float] = (0.0, 0.0)
    damping: tuple[float, float] = (0.0, 0.0)

    def __post_init__(self) -> None:
        excess = [angle for angle in self.angles if abs(angle) > _MAX_ANGLE]
        if excess:
            given = " and ".join(f"{math.degrees(angle):g} deg" for angle in excess)
            allowed = f"at most {math.degrees(_MAX_ANGLE):g} deg from the perpendicular to the motion"
            why = "an arm nearly parallel to the motion of its end cannot move it"
            worst = max(excess, key=abs)
            remedy = IN_RADIANS.format(worst) if abs(worst) > 2.0 * math.pi else ""
            raise refuse("angles", given, allowed, why, remedy)

    @property
    def ratio(self) -> float:
        """Motion of the point per motion of the driven end, as installed."""
        cosine = 1.0 if self.finger else math.cos(self.angles[0])
        return self.arms[1] / self.arms[0] * math.cos(self.angles[1]) / cosine

    def path_at(self, lift: FloatArray, where: str = "arms") -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return the path of the driven end for a driving motion, m, and its first two derivatives."""
        if self.finger:
            return lift, np.ones_like(lift), np.zeros_like(lift)
        arm, start = self.arms[0], self.angles[0]
        sine = math.sin(start) + lift / arm
        if float(np.abs(sine).max(initial=0.0)) >= _MAX_SINE:
            given = f"a motion of {1e3 * float(np.abs(lift).max()):.4g} mm at an arm of {1e3 * arm:.4g} mm"
            why = "the lever would turn until its arm points along the motion"
            remedy = "use a longer arm, or other angles"
            raise refuse(where, given, f"up to {math.degrees(_MAX_ANGLE):g} deg", why, remedy)
        cosine = np.sqrt(1.0 - sine**2)
        return arm * (np.arcsin(sine) - start), 1.0 / cosine, sine / (arm * cosine**3)

    def reach(self, path: FloatArray, end: int) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return the motion of an end for a path of the driven end, m, and its first two derivatives."""
        arm, start, turn = self.arms[end], self.angles[end], path / self.arms[0]
        angle = start + turn
        ratio = arm / self.arms[0]
        return arm * (np.sin(angle) - math.sin(start)), ratio * np.cos(angle), -ratio / self.arms[0] * np.sin(angle)


def path_name(lever: str) -> str:
    """Return the name of the unknown for the path of a lever's driven end."""
    return f"rockers.{lever}"


def tip_name(lever: str) -> str:
    """Return the name of the unknown for the tip of a lever with lash at its point."""
    return f"rockers.{lever}.tip"
