"""Tables of contacts: cam and follower, seats, lashes."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field

from flexcam.case.schema.base import (
    AxisDamping,
    DampingValue,
    Density,
    DirectionValue,
    Flag,
    Force,
    Length,
    LineValue,
    Name,
    PartRecord,
    PositiveDamping,
    PositiveStiffness,
    Pressure,
    Ratio,
    Record,
    Unit,
    Velocity,
    Viscosity,
    value_error,
)
from flexcam.valvetrain import DAMPING_DEPTH, CheckValve, Lubrication, OilChamber, PlungerTravel

_CamName = Annotated[Name, Field(description="name of a cam")]
_FollowerName = Annotated[Name, Field(description="name of the point that the cam moves")]
_LiftDirection = Annotated[
    LineValue | None, Field(description="direction of the lift; by default from cam to follower")
]
_Restitution = Annotated[
    Ratio | None, Field(le=1.0, description="coefficient of restitution: separation speed over approach speed")
]
_DampingDepth = Annotated[
    Length, Field(description="penetration over which the damper becomes active; reduce it for small mechanisms")
]


class PublishedLoadRecord(Record):
    """Published contact model of a cam and its follower: a force drives the follower."""

    model: Literal["published-load"]
    cam: _CamName
    follower: _FollowerName
    direction: _LiftDirection = None
    preload_factor: Ratio = Field(
        2.5, description="preload divided by the force that the rigid train needs for contact"
    )
    cam_deflection: Flag = Field(
        False, description="the force depends on the shaft's deflection: U_c in eq. (21) of Tayeb and Sliman"
    )
    cam_torque: Flag = Field(True, description="the force twists the shaft: T_CF in eq. (24) of Tayeb and Sliman")


class BilateralRecord(Record):
    """Bilateral contact: the cam moves its follower through a stiffness, without separation."""

    model: Literal["bilateral"]
    cam: _CamName
    follower: _FollowerName
    direction: _LiftDirection = None
    stiffness: PositiveStiffness


class LubricationRecord(PartRecord[Lubrication]):
    """Oil and surfaces of a cam contact, for the channels of film, flash temperature and wear."""

    viscosity: Viscosity = Field(description="dynamic viscosity of the oil at the inlet")
    pressure_viscosity: Annotated[float, Unit("pressure-viscosity coefficient", above=True)] = Field(
        description="alpha of Barus: the viscosity grows as exp(alpha p)"
    )
    roughness: Length | None = Field(
        None, description="combined rms roughness of both surfaces (root of the sum of squares), for lambda"
    )
    conductivity: Annotated[float, Unit("thermal conductivity", above=True)] | None = Field(
        None,
        description="thermal conductivity of both bodies, for the flash temperature; needs `friction` of the contact",
    )
    specific_heat: Annotated[float, Unit("specific heat", above=True)] | None = Field(
        None, description="specific heat of both bodies, for the flash temperature"
    )
    wear_coefficient: Annotated[float, Unit("wear coefficient", above=True)] | None = Field(
        None, description="worn volume of the cam per load and sliding distance, for the wear under a flat face"
    )
    kind = Lubrication

    def _check(self) -> None:
        super()._check()
        if (self.conductivity is None) != (self.specific_heat is None):
            raise value_error("conductivity and specific_heat, or none of them", "the flash temperature needs both")


class UnilateralRecord(Record):
    """Unilateral contact: the cam lifts its follower, and the two may separate."""

    model: Literal["unilateral"]
    cam: _CamName
    follower: _FollowerName
    direction: _LiftDirection = None
    stiffness: Literal["hertz"] | PositiveStiffness = Field(
        description="a value, or hertz for Hertz line contact with the curvature of the cam", union_mode="left_to_right"
    )
    dissipation: Annotated[float, Unit("inverse velocity")] = Field(
        0.0,
        description="chi of Hunt and Crossley: the force is the elastic force times (1 + chi times the approach speed)",
    )
    restitution: _Restitution = None
    friction: Annotated[float, Unit("number", most=2.0)] = Field(
        0.0, description="Coulomb friction coefficient along a flat face"
    )
    friction_speed: Velocity = Field(0.01, description="velocity v0 of the regularized friction tanh(v/v0), m/s")
    lubrication: LubricationRecord | None = None

    def _check(self) -> None:
        if "friction" in self.model_fields_set:
            return
        oil, allowed = self.lubrication, "friction together with this key"
        if "friction_speed" in self.model_fields_set:
            given, why = f"{self.friction_speed:g} m/s", "it has no effect without friction"
            raise value_error(allowed, why, "add friction", inside="friction_speed", given=given)
        if oil is not None and oil.conductivity is not None:
            given, why = f"{oil.conductivity:g} W/m/K", "the heat of a flash temperature is that of friction"
            remedy = "add friction, or leave it out"
            raise value_error(allowed, why, remedy, inside="lubrication.conductivity", given=given)


CamContactRecord = PublishedLoadRecord | BilateralRecord | UnilateralRecord


class SeatRecord(Record):
    """A stop, such as a valve seat."""

    model: Literal["seat"]
    at: Name = Field(description="name of a point")
    direction: LineValue | None = Field(
        None, description="direction away from the seat; omitted at a point of a rocker, which has its own"
    )
    stiffness: PositiveStiffness
    damping: DampingValue = 0.0
    damping_depth: _DampingDepth = DAMPING_DEPTH
    restitution: _Restitution = None


class _GapRecord(Record):
    """Connection between a rocker and its point, or between two nodes."""

    at: Name | None = Field(None, description="name of a rocker; the lash is at the point `to` of this rocker")
    start: Name | None = Field(None, alias="from", description="node, or point of a rocker, that pushes")
    to: Name | None = Field(None, description="node that is pushed")
    direction: LineValue | None = Field(None, description="direction in which `from` pushes `to`")

    def _check(self) -> None:
        between = self.start is not None and self.to is not None and self.direction is not None
        nothing = self.start is None and self.to is None and self.direction is None
        if not ((self.at is None and between) or (self.at is not None and nothing)):
            why = "a lash lies at a rocker's point or between two nodes"
            raise value_error("either at = a rocker, or from, to and direction", why)

    @property
    def ends(self) -> tuple[str, str] | None:
        """Names of both nodes; None for a rocker."""
        return (self.start, self.to) if self.start is not None and self.to is not None else None


class LashRecord(_GapRecord):
    """Lash between a rocker and the point it drives, or between two nodes; about an axis, the backlash of a drive."""

    model: Literal["lash"]
    direction: DirectionValue | None = Field(None, description="direction in which `from` pushes or turns `to`")
    gap: Annotated[float, Unit("length", axis="angle")] = Field(description="clearance, m, or rad about an axis")
    stiffness: Annotated[float, Unit("stiffness", above=True, axis="rotational stiffness")] | None = Field(
        None,
        description="stiffness of the closed contact; by default ten times EA/L of the softest member that ends "
        "there; required about an axis, N m/rad",
    )
    damping: AxisDamping = Field(0.0, description="N s/m, or N m s/rad about an axis")
    damping_depth: Annotated[float, Unit("length", above=True, axis="angle")] = Field(
        DAMPING_DEPTH, description="penetration over which the damper becomes active, m, or rad about an axis"
    )


class CheckValveRecord(PartRecord[CheckValve]):
    """Ball check valve through which oil refills the chamber of an adjuster."""

    cracking_pressure: Annotated[float, Unit("pressure")] = Field(
        0.0, description="supply pressure minus chamber pressure at which the ball leaves its seat"
    )
    seat_diameter: Length
    ball_travel: Length = Field(description="travel of the ball from its seat to its cage")
    density: Density = Field(850.0, description="density of the oil")
    discharge: Annotated[float, Unit("number", above=True, most=1.0)] = Field(
        0.62, description="discharge coefficient between ball and seat"
    )
    kind = CheckValve


class OilRecord(PartRecord[OilChamber]):
    """Oil chamber under the plunger of an adjuster, from which stiffness and leak-down follow."""

    viscosity: Viscosity = Field(description="dynamic viscosity of the oil")
    bulk_modulus: Annotated[float, Unit("bulk modulus", above=True)] = Field(
        description="bulk modulus of the oil without air"
    )
    plunger_diameter: Length
    clearance: Length = Field(description="radial clearance between plunger and body")
    land_length: Length = Field(description="length of the plunger in its body")
    chamber_height: Length = Field(
        description="height of the oil under the plunger, including the space of the check valve"
    )
    air: Annotated[float, Unit("number", most=0.5)] = Field(
        0.0, description="volume fraction of air, at `pressure` or `supply_pressure`"
    )
    pressure: Pressure | None = Field(
        None,
        description="typical absolute pressure in the loaded chamber, which determines the stiffness of the air; 1 "
        "MPa by default",
    )
    supply_pressure: Pressure | None = Field(
        None,
        description="absolute oil pressure upstream of the check valve, instead of `pressure`; the stiffness of the "
        "air then follows the chamber pressure",
    )
    check_valve: CheckValveRecord | None = Field(None, description="needs supply_pressure")

    def _check(self) -> None:
        super()._check()
        if self.supply_pressure is None and self.check_valve is not None:
            allowed, why = "supply_pressure together with this key", "the valve opens below this pressure"
            raise value_error(allowed, why, inside="check_valve")
        if self.supply_pressure is not None and self.pressure is not None:
            why = "the stiffness of the air is constant or follows it"
            raise value_error("either pressure or supply_pressure", why)

    def build(self) -> OilChamber:
        """Build the chamber."""
        size = self.model_dump(exclude={"pressure", "supply_pressure", "check_valve"})
        valve = None if self.check_valve is None else self.check_valve.part
        pressure, follows = self.supply_pressure or self.pressure or 1e6, self.supply_pressure is not None
        return OilChamber(**size, pressure=pressure, follows_pressure=follows, valve=valve)


class TravelRecord(PartRecord[PlungerTravel]):
    """Stops of the plunger of an adjuster in its body."""

    compression: Length = Field(description="travel from the installed position to the bottom")
    extension: Length = Field(description="travel from the installed position to the retaining ring")
    stiffness: PositiveStiffness = Field(description="stiffness of both stops")
    damping: DampingValue = Field(0.0, description="damping of both stops")
    kind = PlungerTravel


class AdjusterRecord(_GapRecord):
    """Hydraulic lash adjuster in place of a lash."""

    model: Literal["lash-adjuster"]
    stiffness: PositiveStiffness | None = Field(None, description="stiffness of the oil column; by default from `oil`")
    leak: PositiveDamping | None = Field(None, description="force per velocity of leak-down; by default from `oil`")
    oil: OilRecord | None = None
    refill: PositiveDamping = Field(description="force per velocity while the check valve is open")
    plunger_force: Force = Field(description="force on the plunger at rest, from its spring and the supply pressure")
    travel: TravelRecord | None = Field(
        None, description="stops of the plunger; the plunger then needs its own node with a mass"
    )

    def _check(self) -> None:
        super()._check()
        if self.oil is None and (self.stiffness is None or self.leak is None):
            raise value_error("stiffness and leak, or oil", "they describe the oil column")
        if self.oil is not None and self.stiffness is not None and self.leak is not None:
            raise value_error("either oil, or stiffness and leak", "both define the oil column")
        if self.oil is not None and self.oil.supply_pressure is not None and self.stiffness is not None:
            raise value_error("either oil.supply_pressure or stiffness", "both define the stiffness of the chamber")
        if self.travel is not None and self.at is not None:
            why = "the retaining ring holds the plunger, not the rocker"
            raise value_error("from, to and direction", why, "give the plunger a node and a mass", inside="travel")
        if not self.column[1] > self.refill:
            given = f"leak {self.column[1]:.4g} N s/m, refill {self.refill:g} N s/m"
            why, remedy = "oil flows more easily through the check valve than past the plunger", ""
            if self.oil is not None and self.leak is None:
                why += f"; `leak` follows from `oil`, here with a clearance of {1e3 * self.oil.clearance:g} mm"
                remedy = "check oil.clearance"
            raise value_error("a resistance `leak` above the resistance `refill`", why, remedy, given=given)

    @property
    def column(self) -> tuple[float, float]:
        """Stiffness, N/m, and leak, N s/m, of the oil column; given values replace those of the chamber."""
        stiffness, leak = (self.oil.part.stiffness, self.oil.part.leak) if self.oil else (0.0, 0.0)
        return self.stiffness or stiffness, self.leak or leak


ContactRecord = Annotated[CamContactRecord | SeatRecord | LashRecord | AdjusterRecord, Field(discriminator="model")]
