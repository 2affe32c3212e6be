"""The case file as checked records in SI: every key, its type and its default.

The field's description is what `flexcam schema` hands to editors. A key that nothing acts on does not exist here.
"""

from __future__ import annotations

from typing import Annotated, Generic, Literal, Self, TypeVar, cast

from pydantic import BaseModel, ConfigDict, Field, ValidationInfo, field_validator, model_validator

from flexcam import integrate, train
from flexcam.cam import FlatFollower, Follower, RollerFollower, SwingFlatFollower, SwingRollerFollower
from flexcam.case import quantity as q
from flexcam.case.motions import GivenLaw, GivenLift
from flexcam.checks import InputError, refuse
from flexcam.fem import Damping, Material, PointMass, Section, direction
from flexcam.motion import LAWS, Event, LiftEvent, Ramp, Shifted
from flexcam.units import parse

Part = TypeVar("Part")
Name = Annotated[str, Field(min_length=1, pattern=r"^[A-Za-z0-9_][A-Za-z0-9_ -]*$")]
Vector = tuple[q.SignedNumber, q.SignedNumber, q.SignedNumber]
Point = tuple[q.Position, q.Position, q.Position]
_Acceleration = Annotated[float, q.Unit("acceleration", signed=True)]
Gravity = tuple[_Acceleration, _Acceleration, _Acceleration]


class Record(BaseModel):
    """A table of the case file: no unknown keys, no changes after reading."""

    model_config = ConfigDict(extra="forbid", frozen=True)


class PartRecord(Record, Generic[Part]):
    """A table that describes one part: reading it makes the part, so that its faults join the one report."""

    def made(self) -> Part:
        """Return the part, SI."""
        raise NotImplementedError

    @model_validator(mode="after")
    def _is_possible(self) -> Self:
        try:
            self.made()
        except InputError as refusal:
            raise q.passed_on(refusal, inside=True) from None
        return self


class MaterialRecord(PartRecord[Material]):
    """Isotropic material."""

    E: q.Stress = Field(description="Young's modulus")
    nu: q.SignedNumber = Field(description="Poisson's ratio", gt=-1.0, le=0.5)
    density: Annotated[float, q.Unit("density")] = Field(description="mass per volume")
    ultimate_strength: q.Stress | None = Field(None, description="for the margin against fatigue")
    endurance_limit: q.Stress | None = Field(
        None, description="amplitude borne for ever, for the margin against fatigue"
    )

    def made(self) -> Material:
        """Return the material."""
        return Material(self.E, self.nu, self.density, self.ultimate_strength, self.endurance_limit)


class _SectionRecord(PartRecord[Section]):
    J: Annotated[float, q.Unit("second moment", above=True)] | None = Field(None, description="torsion constant")
    kappa_y: q.PositiveNumber | None = Field(None, description="shear factor along local y")
    kappa_z: q.PositiveNumber | None = Field(None, description="shear factor along local z")

    def bare(self) -> Section:
        """Return the section with the defaults of its shape."""
        raise NotImplementedError

    def made(self) -> Section:
        """Return the section, with the torsion constant and shear factors given here."""
        return self.bare().given(J=self.J, kappa_y=self.kappa_y, kappa_z=self.kappa_z)


class CircleRecord(_SectionRecord):
    """Solid round section."""

    shape: Literal["circle"]
    diameter: q.Length

    def bare(self) -> Section:
        """Return the section with the defaults of its shape."""
        return Section.circle(self.diameter)


class TubeRecord(_SectionRecord):
    """Round tube."""

    shape: Literal["tube"]
    outer_diameter: q.Length
    inner_diameter: Annotated[float, q.Unit("length")]

    def bare(self) -> Section:
        """Return the section with the defaults of its shape."""
        return Section.tube(self.outer_diameter, self.inner_diameter)


class RectangleRecord(_SectionRecord):
    """Rectangle with sides along local y and z."""

    shape: Literal["rectangle"]
    width_y: q.Length
    width_z: q.Length

    def bare(self) -> Section:
        """Return the section with the defaults of its shape."""
        return Section.rectangle(self.width_y, self.width_z)


class CustomRecord(_SectionRecord):
    """Section given by its properties."""

    shape: Literal["custom"]
    A: Annotated[float, q.Unit("area", above=True)]
    Iy: Annotated[float, q.Unit("second moment", above=True)]
    Iz: Annotated[float, q.Unit("second moment", above=True)]
    J: Annotated[float, q.Unit("second moment", above=True)]  # pyright: ignore[reportIncompatibleVariableOverride, reportGeneralTypeIssues]
    fibre_y: q.Length | None = Field(
        None,
        description="extreme fibre along local y; twice the radius of gyration by default, too small for open profiles",
    )
    fibre_z: q.Length | None = Field(None, description="extreme fibre along local z; as fibre_y")
    torsion_arm: q.Length | None = Field(
        None, description="c of the torsional shear stress T c/J; twice the smaller fibre distance by default"
    )

    def bare(self) -> Section:
        """Return the section with the defaults of its shape."""
        fibres = (self.fibre_y or 0.0, self.fibre_z or 0.0, self.torsion_arm or 0.0)
        return Section(self.A, self.Iy, self.Iz, self.J, 1.0, 1.0, *fibres)


SectionRecord = Annotated[CircleRecord | TubeRecord | RectangleRecord | CustomRecord, Field(discriminator="shape")]


class MemberRecord(Record):
    """What a line group of the mesh, or a chain of named nodes, is made of."""

    material: Name
    section: Name
    nodes: list[Name] | None = Field(
        None, min_length=2, description="named nodes along the member (without a mesh file)"
    )
    elements: int = Field(1, ge=1, le=1_000_000, strict=True, description="equal parts of each of its segments")
    orientation: Vector | None = Field(None, description="vector in the local x-y plane, global axes")
    shear: bool = Field(False, strict=True, description="shear deformation (Timoshenko)")
    rotary_inertia: bool = Field(True, strict=True, description="rotary inertia of the sections in bending")
    mass: Literal["consistent", "lumped"] = "consistent"


class MassRecord(PartRecord[train.MassAt]):
    """Rigid body at a point."""

    at: Name
    mass: q.MassValue
    inertia: tuple[q.Inertia, q.Inertia, q.Inertia] = Field(
        (0.0, 0.0, 0.0), description="about its centre, global axes"
    )
    offset: Point = Field((0.0, 0.0, 0.0), description="from the node to its centre, global axes")

    def made(self) -> train.MassAt:
        """Return the body and its place."""
        return train.MassAt(self.at, PointMass(self.mass, self.inertia, self.offset))


_CLASH = 50.0
"""Stiffness of touching coils over that of the part between them, where none is given: flexcam's choice."""


class SpringRecord(PartRecord[train.Spring]):
    """Spring and damper along one direction, to ground or to another point."""

    at: Name
    to: Name | None = Field(None, description="the other end; ground where absent")
    direction: q.DirectionValue
    stiffness: float = Field(0.0, description="N/m, or N m/rad about an axis")
    damping: float = Field(0.0, description="N s/m, or N m s/rad about an axis")
    installed_force: q.Force | None = Field(None, description="force it is installed with, against direction")
    mass: q.MassValue = Field(0.0, description="spread over its length")
    elements: int = Field(1, ge=1, le=1000, strict=True, description="equal parts; more than one lets it surge")
    clash_travel: q.Length | None = Field(None, description="along direction from installed until all coils touch")
    clash_stiffness: Annotated[float, q.Unit("stiffness", above=True)] | None = Field(
        None, description="of a contact between neighbouring parts; 50 times a part's own by default"
    )

    @field_validator("stiffness", "damping", mode="before")
    @classmethod
    def _in_its_unit(cls, value: object, info: ValidationInfo) -> float:
        """Return SI; a rotation has other units than a translation."""
        along = info.data.get("direction", "uy")
        turns = not direction(along)[:3].any()
        return q.Unit(f"rotational {info.field_name}" if turns else str(info.field_name)).validate(value)

    def made(self) -> train.Spring:
        """Return the spring."""
        along = direction(self.direction)
        clash = self.clash_stiffness or _CLASH * self.elements * self.stiffness
        return train.Spring(
            self.at, along, self.stiffness, self.damping, self.to, self.installed_force, self.mass, self.elements,
            self.clash_travel, clash,
        )  # fmt: skip


class BearingRecord(PartRecord[tuple[float, float]]):
    """Elastic bearing: the same stiffness and damping in every direction square to the shaft."""

    at: Name
    stiffness: q.Stiffness
    damping: q.DampingValue = 0.0

    def made(self) -> tuple[float, float]:
        """Return stiffness and damping; the directions follow from the mesh."""
        return self.stiffness, self.damping


class LoadRecord(Record):
    """Constant force at a point or spread over a member."""

    at: Name | None = Field(None, description="point it acts at")
    member: Name | None = Field(None, description="member it is spread over")
    direction: q.DirectionValue
    force: float | None = Field(None, description="N at a point, N m about an axis")
    force_per_length: Annotated[float, q.Unit("stiffness", signed=True)] | None = Field(
        None, description="N/m over a member"
    )

    @field_validator("force", mode="before")
    @classmethod
    def _in_its_unit(cls, value: object, info: ValidationInfo) -> float | None:
        """Return SI; about an axis it is a moment."""
        if value is None:
            return None
        turns = not direction(info.data.get("direction", "uy"))[:3].any()
        return q.Unit("moment" if turns else "force", signed=True).validate(value)

    @model_validator(mode="after")
    def _one_of_two(self) -> Self:
        point, spread = (
            self.at is not None and self.force is not None,
            self.member is not None and self.force_per_length is not None,
        )
        if point == spread or (self.at is not None) == (self.member is not None):
            raise q.refused("either at with force, or member with force_per_length", "a load acts in one way")
        return self

    def made(self) -> train.GivenLoad:
        """Return the load."""
        size = self.force if self.force is not None else self.force_per_length
        return train.GivenLoad(size or 0.0, direction(self.direction), self.at, self.member)


class RockerRecord(Record):
    """Rocker without bending: the point `to` moves by the ratio of the arms."""

    model: Literal["lumped"]
    start: Name = Field(alias="from", description="named node it is driven at")
    to: Name = Field(description="point it defines")
    arms: tuple[q.Length, q.Length] = Field(description="arm at `from` and at `to`")
    inertia: q.Inertia = Field(0.0, description="about the rocker's shaft")
    direction: q.DirectionValue | None = Field(None, description="motion at `from`; along the member there by default")


class RampsRecord(Record):
    """Ramps before the rise and after the return."""

    height: q.Length
    duration: q.PositiveAngle
    take_off: q.Ratio = Field(0.25, le=1.0, description="part of the duration over which the velocity rises")
    closing_height: q.Length | None = Field(None, description="as height by default")
    closing_duration: q.PositiveAngle | None = Field(None, description="as duration by default")

    def made(self) -> tuple[Ramp, Ramp]:
        """Return the opening and the closing ramp."""
        closing = (self.closing_height or self.height, self.closing_duration or self.duration)
        return Ramp(self.height, self.duration, self.take_off), Ramp(*closing, self.take_off)


class FlatRecord(Record):
    """Translating follower with a flat face."""

    type: Literal["flat"]

    def made(self, base_radius: float | None) -> Follower | None:
        """Return the follower."""
        return FlatFollower(base_radius) if base_radius else None


class RollerRecord(Record):
    """Translating follower with a roller."""

    type: Literal["roller"]
    radius: q.Length
    offset: q.Position = Field(0.0, description="of the follower's axis from the cam's")

    def made(self, base_radius: float | None) -> Follower | None:
        """Return the follower."""
        return RollerFollower(base_radius, self.radius, self.offset) if base_radius else None


class SwingRecord(Record):
    """Swinging follower, with a roller where `radius` is given and else with a flat face."""

    type: Literal["swing"]
    arm: q.Length = Field(description="pivot to roller centre, or where the lift of a flat face is measured")
    distance: q.Length = Field(description="pivot to the cam's centre")
    radius: q.Length | None = Field(None, description="of the roller")
    angle: q.PositiveAngle | None = Field(
        None, description="arm to line of centres on the base circle, instead of base_radius"
    )
    face: q.Position = Field(0.0, description="distance of the flat face from the pivot, positive away from the cam")
    rotation: Literal["clockwise", "counterclockwise"] = Field("clockwise", description="of the follower on the rise")

    def made(self, base_radius: float | None) -> Follower | None:
        """Return the follower."""
        side = 1 if self.rotation == "clockwise" else -1
        if self.angle is not None and self.radius is not None and base_radius is None:
            return SwingRollerFollower.from_angle(self.radius, self.arm, self.distance, self.angle, side)
        if self.angle is not None and self.radius is None:
            why = "a flat face is placed by its base circle"
            raise refuse("follower.angle", "an angle", "base_radius of the cam in its place", why, "give base_radius")
        if self.angle is not None:
            why = "for a roller, either this or base_radius says where the base circle is"
            raise refuse("follower.angle", "an angle", "no angle", why, "leave one of them out")
        if base_radius is None:
            return None
        if self.radius is None:
            return SwingFlatFollower(base_radius, self.arm, self.distance, self.face, side)
        return SwingRollerFollower(base_radius, self.radius, self.arm, self.distance, side)


FollowerRecord = Annotated[FlatRecord | RollerRecord | SwingRecord, Field(discriminator="type")]


class FreeCamRecord(PartRecord[train.Cam]):
    """A cam by itself: its lift over one revolution, and the follower that makes a profile of it."""

    at: Name | None = Field(None, description="named node of the camshaft")
    follower: FollowerRecord | None = Field(None, description="what touches the cam")
    law: GivenLaw | None = Field(None, description="motion law: a name, { id = ..., ... }, or a law file (.toml)")
    return_law: GivenLaw | None = Field(None, description="run backwards on the return; that of the rise by default")
    lift: float | None = Field(None, gt=0.0, description="above the ramps; an angle where the follower swings")
    lift_table: GivenLift | None = Field(None, description="file of the whole lift, instead of a law")
    rise: q.PositiveAngle | None = None
    dwell: q.Angle = Field(0.0, description="upper dwell")
    fall: q.PositiveAngle | None = Field(None, alias="return")
    phase: q.SignedAngle = Field(0.0, description="cam angle at which the rise (or the table's zero) lies")
    ramps: RampsRecord | None = None
    single_dwell: Literal["high", "low"] | None = Field(
        None, description="where the only dwell lies, for laws that begin under acceleration"
    )
    base_radius: q.Length | None = Field(None, description="of the base circle")
    width: q.Length | None = Field(None, description="of the cam along its shaft")
    rotation: Literal["clockwise", "counterclockwise"] = Field(
        "counterclockwise", description="of the cam in its drawing; the sense in space is that of axis"
    )

    @field_validator("lift", mode="before")
    @classmethod
    def _in_its_unit(cls, value: object, info: ValidationInfo) -> object:
        """Return metres; where the follower swings an angle is the path at its arm's length."""
        follower = info.data.get("follower")
        if value is None:
            return None
        if isinstance(follower, SwingRecord) and isinstance(value, str):
            try:
                angle = parse(value, "angle")
            except InputError:
                pass  # then it is a length
            else:
                return follower.arm * q.Unit("angle", above=True).validate(angle)
        return q.Unit("length", above=True).validate(value)

    def made(self) -> train.Cam:
        """Return the cam; what is missing is reported where all keys are."""
        follower = self.follower.made(self.base_radius) if self.follower else None
        turn = 1 if self.rotation == "counterclockwise" else -1
        return train.Cam(self.at or "", self._event(), follower, turn, self.width)

    def _event(self) -> Event:
        if self.lift_table is not None:
            return Shifted(self.lift_table.event, self.phase) if self.phase else self.lift_table.event
        if self.law is None or self.lift is None or self.rise is None or self.fall is None:
            return LiftEvent(LAWS["shm"], 1.0, 1.0, 1.0)
        opening, closing = self.ramps.made() if self.ramps else (None, None)
        return LiftEvent(
            self.law.law, self.lift, self.rise, self.fall, self.dwell, self.phase,
            self.return_law.law if self.return_law else None, opening, closing, self.single_dwell,
        )  # fmt: skip


class CamRecord(FreeCamRecord):
    """A cam on its shaft."""

    at: Name = Field(description="named node of the camshaft")  # pyright: ignore[reportIncompatibleVariableOverride, reportGeneralTypeIssues]
    axis: Vector | None = Field(
        None, description="sense of rotation; along the shaft to positive coordinates by default"
    )


class PublishedLoadRecord(Record):
    """The published coupling of a cam and its follower: a force drives the follower."""

    model: Literal["published-load"]
    cam: Name
    follower: Name
    direction: q.DirectionValue | None = Field(None, description="of the lift; from cam to follower by default")
    preload_factor: q.Ratio = Field(2.5, description="preload by the force that the rigid train needs for contact")
    cam_deflection: bool = Field(False, strict=True, description="the force feels the shaft's deflection, U_c of (21)")
    cam_torque: bool = Field(True, strict=True, description="the force twists the shaft, T_CF of (24)")


class BilateralRecord(Record):
    """A cam that lifts its follower through a stiffness, and cannot part from it."""

    model: Literal["bilateral"]
    cam: Name
    follower: Name
    direction: q.DirectionValue | None = Field(None, description="of the lift; from cam to follower by default")
    stiffness: Annotated[float, q.Unit("stiffness", above=True)]


class UnilateralRecord(Record):
    """A cam that lifts its follower and may part from it."""

    model: Literal["unilateral"]
    cam: Name
    follower: Name
    direction: q.DirectionValue | None = Field(None, description="of the lift; from cam to follower by default")
    stiffness: Literal["hertz"] | Annotated[float, q.Unit("stiffness", above=True)] = Field(
        description="a number, or hertz for line contact with the cam's own curvature", union_mode="left_to_right"
    )
    dissipation: Annotated[float, q.Unit("inverse velocity")] = Field(
        0.0, description="chi of Hunt and Crossley: force times 1 + chi times the rate of approach"
    )


CamContactRecord = PublishedLoadRecord | BilateralRecord | UnilateralRecord


class SeatRecord(Record):
    """A stop, such as a valve seat."""

    model: Literal["seat"]
    at: Name
    direction: q.DirectionValue | None = Field(None, description="the way off it; a rocker's point has its own")
    stiffness: Annotated[float, q.Unit("stiffness", above=True)]
    damping: q.DampingValue = 0.0


class LashRecord(Record):
    """Play between a rocker and the point it drives."""

    model: Literal["lash"]
    at: Name = Field(description="name of a rocker")
    gap: Annotated[float, q.Unit("length")] = Field(description="at the rocker's point")
    stiffness: Annotated[float, q.Unit("stiffness", above=True)] = Field(description="of rocker and tip, at the point")
    damping: q.DampingValue = 0.0


ContactRecord = Annotated[CamContactRecord | SeatRecord | LashRecord, Field(discriminator="model")]


class DampingRecord(PartRecord[Damping]):
    """Damping of the whole structure."""

    alpha: Annotated[float, q.Unit("rate")] = Field(0.0, description="Rayleigh factor of the mass")
    beta: Annotated[float, q.Unit("time")] = Field(0.0, description="Rayleigh factor of the stiffness")
    modal: q.Ratio = Field(0.0, description="damping ratio of every mode")

    def made(self) -> Damping:
        """Return the damping."""
        return Damping(self.alpha, self.beta, self.modal)


class NewmarkRecord(PartRecord[integrate.Scheme]):
    """Newmark's scheme; the default is the average acceleration."""

    method: Literal["newmark"] = "newmark"
    beta: q.PositiveNumber = 0.25
    gamma: q.PositiveNumber = 0.5

    def made(self) -> integrate.Scheme:
        """Return the scheme."""
        return integrate.newmark(beta=self.beta, gamma=self.gamma)


class HhtRecord(PartRecord[integrate.Scheme]):
    """Scheme of Hilber, Hughes and Taylor."""

    method: Literal["hht"]
    alpha: q.SignedNumber = -0.05

    def made(self) -> integrate.Scheme:
        """Return the scheme."""
        return integrate.hht(alpha=self.alpha)


class GeneralizedAlphaRecord(PartRecord[integrate.Scheme]):
    """Generalized-alpha scheme."""

    method: Literal["generalized-alpha"]
    rho_inf: q.Ratio = 0.9

    def made(self) -> integrate.Scheme:
        """Return the scheme."""
        return integrate.generalized_alpha(rho_inf=self.rho_inf)


IntegratorRecord = Annotated[NewmarkRecord | HhtRecord | GeneralizedAlphaRecord, Field(discriminator="method")]


class ResultStartRecord(Record):
    """Start from the last state of an earlier run of the same model."""

    result: str = Field(description="result file, relative to the case file")


class GivenStartRecord(Record):
    """Start from given displacements and velocities; what is not named is zero."""

    displacement: dict[str, float] = Field(default={}, description='"point.component" to length or angle')
    velocity: dict[str, float] = Field(default={}, description='"point.component" to velocity or angular speed')

    @field_validator("displacement", "velocity", mode="before")
    @classmethod
    def _in_their_units(cls, value: object, info: ValidationInfo) -> object:
        """Return SI by component; what is no table is left to pydantic."""
        if not isinstance(value, dict):
            return value
        table = cast("dict[str, object]", value)
        units = {"displacement": ("length", "angle"), "velocity": ("velocity", "speed")}[info.field_name or ""]
        return {
            name: q.Unit(units[name.rpartition(".")[2].startswith("r")], signed=True).validate(one)
            for name, one in table.items()
        }


class RunRecord(Record):
    """How the mechanism is run."""

    speed: q.Speed | None = Field(None, description="camshaft speed")
    crank_speed: q.Speed | None = Field(None, description="crankshaft speed, twice the camshaft's")
    revolutions: q.PositiveNumber = Field(2.0, description="of the camshaft")
    steps_per_revolution: int | None = Field(
        None, ge=1, le=100_000_000, strict=True, description="3600 where no step is given"
    )
    step: q.Time | None = Field(None, description="instead of steps_per_revolution")
    start: Literal["rest", "equilibrium"] | ResultStartRecord | GivenStartRecord = Field(
        "rest",
        description="at rest as installed, in static equilibrium, or from a given state",
        union_mode="left_to_right",
    )
    gravity: Gravity = Field(
        (0.0, 0.0, 0.0), description="acceleration, global axes; masses at a rocker's point are left out"
    )
    integrator: IntegratorRecord = Field(default_factory=NewmarkRecord)
    damping: DampingRecord = Field(default_factory=lambda: DampingRecord.model_validate({}))


def _without_doubles(names: list[str]) -> list[str]:
    twice = [name for name in names if names.count(name) > 1]
    if twice:
        raise q.refused("every point once", f"{twice[0]!r} is listed {names.count(twice[0])} times", "remove it")
    return names


class OutputRecord(Record):
    """What is saved."""

    probes: list[Name] = Field(default=[], description="points kept at every step")
    _listed_once = field_validator("probes")(_without_doubles)
    field_every: int = Field(20, ge=1, le=1_000_000_000, strict=True, description="steps between saved fields")


class CaseRecord(Record):
    """A whole case file."""

    format: int = Field(ge=1, le=1, strict=True, description="version of the case format: 1")
    title: str = ""
    paper: Literal["tayeb-sliman"] | None = Field(None, description="published system whose claims `compare` checks")
    mesh: str | None = Field(None, description="Gmsh file, relative to the case file")
    nodes: dict[Name, Point] = Field(default={}, description="named nodes, instead of a mesh file")
    materials: dict[Name, MaterialRecord]
    sections: dict[Name, SectionRecord]
    members: dict[Name, MemberRecord]
    supports: dict[Name, list[q.Component]] = Field(default={}, description="components held at a point")
    masses: dict[Name, MassRecord] = {}
    springs: dict[Name, SpringRecord] = {}
    bearings: dict[Name, BearingRecord] = {}
    loads: dict[Name, LoadRecord] = {}
    rockers: dict[Name, RockerRecord] = {}
    cams: dict[Name, CamRecord] = {}
    contacts: dict[Name, ContactRecord] = {}
    run: RunRecord
    output: OutputRecord = Field(default_factory=lambda: OutputRecord.model_validate({}))


class CamsRecord(Record):
    """A file that holds cams alone, to be designed without a mechanism around them."""

    format: int = Field(ge=1, le=1, strict=True, description="version of the case format: 1")
    title: str = ""
    cams: dict[Name, FreeCamRecord]
    speed: q.Speed | None = Field(None, description="camshaft speed")
