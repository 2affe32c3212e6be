"""Tables of materials, sections, members, masses, springs, bearings, loads and rockers."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise
from typing import Annotated, Literal, Self

from pydantic import AfterValidator, Field, ValidationInfo, field_validator, model_validator

from flexcam import valvetrain
from flexcam.case.curves import LoadDefinition
from flexcam.case.schema.base import (
    DampingValue,
    DirectionValue,
    Force,
    Inertia,
    Length,
    LineValue,
    MassValue,
    Name,
    PartRecord,
    Point,
    Position,
    PositiveNumber,
    PositiveStiffness,
    Ratio,
    Record,
    SecondMoment,
    SignedAngle,
    SignedNumber,
    Stiffness,
    Stress,
    Unit,
    Vector,
    value_error,
)
from flexcam.fem.frames import direction
from flexcam.fem.rigid_bodies import PointMass
from flexcam.fem.sections import Material, Section
from flexcam.valvetrain.springs import Coils, coil_spring, install_spring


def _check_poisson_ratio(nu: float) -> float:
    if not -1.0 < nu <= 0.5:
        raise value_error("above -1 and up to 0.5", "the shear modulus E/(2(1+nu)) must be positive")
    return nu


class MaterialRecord(PartRecord[Material]):
    """Isotropic material."""

    E: Stress = Field(description="Young's modulus")
    nu: Annotated[SignedNumber, AfterValidator(_check_poisson_ratio)] = Field(description="Poisson's ratio")
    density: Annotated[float, Unit("density")] = Field(description="mass per volume")
    ultimate_strength: Stress | None = Field(None, description="for the margin against fatigue")
    endurance_limit: Stress | None = Field(
        None, description="stress amplitude of unlimited life, for the margin against fatigue"
    )

    def build(self) -> Material:
        """Build the material."""
        return Material(self.E, self.nu, self.density, self.ultimate_strength, self.endurance_limit)


class _SectionRecord(PartRecord[Section]):
    J: SecondMoment | None = Field(None, description="torsion constant")
    kappa_y: PositiveNumber | None = Field(None, description="shear factor along local y")
    kappa_z: PositiveNumber | None = Field(None, description="shear factor along local z")

    def default_section(self) -> Section:
        """Return the section with the defaults of its shape."""
        raise NotImplementedError

    def build(self) -> Section:
        """Build the section, with the given torsion constant and shear factors."""
        return self.default_section().given(J=self.J, kappa_y=self.kappa_y, kappa_z=self.kappa_z)


class CircleRecord(_SectionRecord):
    """Solid round section."""

    shape: Literal["circle"]
    diameter: Length

    def default_section(self) -> Section:
        """Return the section with the defaults of its shape."""
        return Section.circle(self.diameter)


class TubeRecord(_SectionRecord):
    """Round tube."""

    shape: Literal["tube"]
    outer_diameter: Length
    inner_diameter: Annotated[float, Unit("length")]

    def default_section(self) -> Section:
        """Return the section with the defaults of its shape."""
        return Section.tube(self.outer_diameter, self.inner_diameter)


class RectangleRecord(_SectionRecord):
    """Rectangle with sides along local y and z."""

    shape: Literal["rectangle"]
    width_y: Length
    width_z: Length

    def default_section(self) -> Section:
        """Return the section with the defaults of its shape."""
        return Section.rectangle(self.width_y, self.width_z)


class CustomRecord(_SectionRecord):
    """Section given by its properties."""

    shape: Literal["custom"]
    A: Annotated[float, Unit("area", above=True)]
    Iy: SecondMoment
    Iz: SecondMoment
    J: SecondMoment  # pyright: ignore[reportIncompatibleVariableOverride, reportGeneralTypeIssues]
    fibre_y: Length | None = Field(
        None,
        description="extreme fibre along local y; twice the radius of gyration by default, too small for open profiles",
    )
    fibre_z: Length | None = Field(None, description="extreme fibre along local z; as fibre_y")
    torsion_arm: Length | None = Field(
        None, description="c of the torsional shear stress T c/J; twice the smaller fibre distance by default"
    )

    def default_section(self) -> Section:
        """Return the section with the defaults of its shape."""
        fibres = (self.fibre_y or 0.0, self.fibre_z or 0.0, self.torsion_arm or 0.0)
        return Section(self.A, self.Iy, self.Iz, self.J, 1.0, 1.0, *fibres)


SectionRecord = Annotated[CircleRecord | TubeRecord | RectangleRecord | CustomRecord, Field(discriminator="shape")]


class MemberRecord(Record):
    """Material, section and elements of a line group of the mesh or of a chain of named nodes."""

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
    geometric_stiffness: bool = Field(
        False, strict=True, description="axial force and bending act on each other within a run"
    )
    bow: Position = Field(0.0, description="initial half wave in the local x-y plane, at mid-length")

    @model_validator(mode="after")
    def _check_bow(self) -> Self:
        if self.bow and not self.geometric_stiffness:
            raise value_error("bow with geometric_stiffness = true", "a bow has no effect without it")
        return self


class MassRecord(PartRecord[valvetrain.MassAt]):
    """Rigid body at a point."""

    at: Name
    mass: MassValue
    inertia: tuple[Inertia, Inertia, Inertia] = Field((0.0, 0.0, 0.0), description="about its centre, global axes")
    offset: Point = Field((0.0, 0.0, 0.0), description="from the node to its centre, global axes")

    def build(self) -> valvetrain.MassAt:
        """Build the body and its position."""
        return valvetrain.MassAt(self.at, PointMass(self.mass, self.inertia, self.offset))


_COIL_CONTACT_RATIO = 50.0
"""Default ratio of the stiffness of touching coils to that of the spring part between them: flexcam's choice."""


_WAHL = "Wahl's factor has no meaning for less"


class WireRecord(Record):
    """Wire of a coil spring, for its stress and its default stiffness."""

    diameter: Length
    coil_diameter: Length | None = Field(None, description="of the coil's mean circle; required without coils")
    active_coils: PositiveNumber | None = Field(None, description="with shear_modulus: the spring's stiffness")
    shear_modulus: Stress | None = Field(None, description="with active_coils, or with coils of the spring")
    density: Annotated[float, Unit("density", above=True)] | None = Field(
        None, description="with coils of the spring: its mass"
    )

    @model_validator(mode="after")
    def _check_coil(self) -> Self:
        if self.coil_diameter is not None and self.coil_diameter < 2.0 * self.diameter:
            raise value_error("a coil_diameter of twice the wire's or more", _WAHL)
        if self.active_coils is not None and self.shear_modulus is None:
            raise value_error("active_coils and shear_modulus together, or neither", "the stiffness takes both")
        return self

    @property
    def coil(self) -> valvetrain.Wire | None:
        """Wire with the diameter of its coil; None if the spring has its coils."""
        return None if self.coil_diameter is None else valvetrain.Wire(self.diameter, self.coil_diameter)

    @property
    def rate(self) -> float | None:
        """Stiffness of the spring, N/m; None without a number of coils."""
        if self.coil is None or self.active_coils is None or self.shear_modulus is None:
            return None
        return self.coil.rate(self.shear_modulus, self.active_coils)


class CoilsRecord(PartRecord[Coils]):
    """Neighbouring active coils of a spring, of equal pitch."""

    turns: PositiveNumber = Field(description="number of coils")
    diameter: Length | tuple[Length, Length] = Field(description="of the mean circle; at both ends where it tapers")
    pitch: Length = Field(description="rise per coil of the free spring")

    def build(self) -> Coils:
        """Build the coils."""
        ends = self.diameter if isinstance(self.diameter, tuple) else (self.diameter, self.diameter)
        return Coils(self.turns, ends, self.pitch)


class PulsationRecord(PartRecord[valvetrain.Pulsation]):
    """Variation of a stiffness with the cam angle."""

    order: PositiveNumber = Field(description="periods per camshaft revolution")
    amplitude: Ratio = Field(description='fraction of the mean stiffness, such as "10 %"; below 1')
    phase: SignedAngle = 0.0

    @model_validator(mode="after")
    def _check_amplitude(self) -> Self:
        if self.amplitude >= 1.0:
            raise value_error("an amplitude below 1", "the stiffness must not change its sign")
        return self

    def build(self) -> valvetrain.Pulsation:
        """Build the pulsation."""
        return valvetrain.Pulsation(self.order, self.amplitude, self.phase)


class SpringRecord(PartRecord[valvetrain.Spring]):
    """Spring and damper along one direction, to ground or to another point."""

    at: Name
    to: Name | None = Field(None, description="the other end; ground where absent")
    direction: DirectionValue
    stiffness: float = Field(0.0, description="N/m, or N m/rad about an axis")
    damping: float = Field(0.0, description="N s/m, or N m s/rad about an axis")
    link: bool = Field(
        False, strict=True, description="represents a part of the train, which is rigid in the rigid model"
    )
    installed_force: Force | None = Field(None, description="preload, against direction")
    installed_compression: Length | None = Field(
        None, description="instead of installed_force: from the free length to the installed one"
    )
    force_table: list[tuple[Annotated[float, Unit("length")], Force]] | None = Field(
        None, min_length=2, description="instead of stiffness: rows of travel from the free length and force"
    )
    coils: list[CoilsRecord] | None = Field(
        None, min_length=1, description="instead of stiffness: active coils from the fixed to the moving end; with wire"
    )
    mass: MassValue = Field(0.0, description="distributed over its length")
    elements: int = Field(
        1, ge=1, le=1000, strict=True,
        description="equal parts, or parts per entry of coils; more than one lets it surge; with mass 4 to 16 by "
        "default, as its waves need",
    )  # fmt: skip
    clash_travel: Length | None = Field(None, description="along direction from installed until all coils touch")
    clash_stiffness: PositiveStiffness | None = Field(
        None, description="of a contact between neighbouring parts; 50 times a part's own by default"
    )
    pulsation: PulsationRecord | None = Field(
        None, description="variation of its stiffness with the cam angle; none by default"
    )
    wire: WireRecord | None = Field(None, description="for the shear stress, and the stiffness where none is given")

    @model_validator(mode="after")
    def _check_parts(self) -> Self:
        if self.wire is not None and not direction(self.direction)[:3].any():
            raise value_error(
                "a wire on a spring along a line", "its stress and stiffness are those of a coil in compression"
            )
        if self.wire is not None and self.wire.active_coils is not None and self.stiffness:
            raise value_error(
                "either stiffness, or active_coils and shear_modulus of the wire", "both define the stiffness"
            )
        if self.installed_force is not None and self.installed_compression is not None:
            raise value_error("either installed_force or installed_compression", "one follows from the other")
        if self.link and (self.to is None or self.installed_force or self.installed_compression):
            raise value_error(
                "a link with an end `to` and no preload", "it joins two points as a part of the train does"
            )
        if self.clash_travel is not None and not self.part.stiffness:
            raise value_error("a stiffness where coils can touch", "a spring without one has no coils")
        return self

    def _check(self) -> None:
        """Check the keys that define the force, then that the spring can be built."""
        if self.force_table is not None or self.coils is not None:
            self._check_force("coils" if self.force_table is None else "force_table")
        if self.force_table is not None:
            self._check_table(self.force_table)
        if self.coils is None:
            self._check_wire()
        else:
            self._check_coils(self.coils)
        super()._check()
        if self.coils is not None and (self.part.clash_travel or 0.0) <= 0.0:
            raise value_error("an installed position before all coils touch", "a solid spring has no travel left")

    def _check_wire(self) -> None:
        wire = self.wire
        if wire is None:
            return
        if wire.coil_diameter is None:
            why, remedy = "the key is required without coils", "add 'coil_diameter'"
            raise value_error("a length", why, remedy, inside="wire.coil_diameter", given="nothing")
        if wire.active_coils is None and wire.shear_modulus is not None:
            raise value_error("no shear_modulus without active_coils or coils", "the stiffness takes both")
        if wire.density is not None:
            raise value_error("a density of the wire beside coils only", "it takes their length", "give the mass")

    def _check_coils(self, entries: list[CoilsRecord]) -> None:
        wire = self.wire
        if wire is None or wire.shear_modulus is None:
            raise value_error("a wire with diameter and shear_modulus beside coils", "the stiffness takes both")
        if wire.coil_diameter is not None or self.clash_travel is not None:
            raise value_error("coils without clash_travel and coil_diameter", "coils have these themselves")
        if wire.density is not None and self.mass:
            raise value_error("either a mass or a density of the wire", "both define the mass")
        for i, coils in enumerate(entry.part for entry in entries):
            if min(coils.ends) < 2.0 * wire.diameter:
                given, allowed = f"{min(coils.ends):g} m", "twice the diameter of the wire or more"
                raise value_error(allowed, _WAHL, inside=f"coils.{i}.diameter", given=given)
            if coils.gap(wire.diameter) <= 0.0:
                allowed = f"above {coils.pitch - coils.gap(wire.diameter):g} m"
                why = "these coils touch each other in the free spring"
                raise value_error(allowed, why, inside=f"coils.{i}.pitch", given=f"{coils.pitch:g} m")

    def _check_table(self, rows: list[tuple[float, float]]) -> None:
        if any(x1 <= x0 or f1 <= f0 for (x0, f0), (x1, f1) in pairwise(rows)):
            allowed, why = "rows of increasing travel and force", "a spring pushes back more the more it is compressed"
            raise value_error(allowed, why, "sort them, and smooth their noise", inside="force_table")
        start, force = self.installed_compression or 0.0, self.installed_force
        (least, weakest), (most, strongest) = rows[0], rows[-1]
        if not (least <= start <= most if force is None else weakest <= force <= strongest):
            allowed = (
                f"rows around the installed position, {start:g} m" if force is None else f"rows around {force:g} N"
            )
            raise value_error(allowed, "the travel counts from there", inside="force_table")

    def _check_force(self, key: str) -> None:
        """Check the keys beside a force table or coils."""
        if self.force_table is not None and self.coils is not None:
            raise value_error("either force_table or coils", "both define the force")
        if not direction(self.direction)[:3].any():
            raise value_error(f"{key} on a spring along a line", "it has travels and forces")
        if self.stiffness or (self.wire is not None and self.wire.active_coils is not None):
            raise value_error(f"either {key} or a stiffness", f"the stiffness follows from {key}")
        if self.installed_force is not None and self.installed_compression is not None:
            raise value_error("either installed_force or installed_compression", "one follows from the other")
        if self.pulsation is not None or self.link:
            raise value_error(f"{key} without pulsation and link", "these take a constant stiffness")

    @field_validator("stiffness", "damping", mode="before")
    @classmethod
    def _convert_unit(cls, value: object, info: ValidationInfo) -> float:
        """Return SI; units depend on whether the spring is translational or rotational."""
        along = info.data.get("direction", "uy")
        turns = not direction(along)[:3].any()
        return Unit(f"rotational {info.field_name}" if turns else str(info.field_name)).validate(value)

    def build(self) -> valvetrain.Spring:
        """Build the spring."""
        along = direction(self.direction)
        stiffness = self.stiffness or (self.wire.rate if self.wire else None) or 0.0
        clash = self.clash_stiffness or _COIL_CONTACT_RATIO * self.elements * stiffness
        wire = self.wire.coil if self.wire else None
        force = self.installed_force
        if self.installed_compression is not None:
            force = stiffness * self.installed_compression
        spring = valvetrain.Spring(
            self.at, along, stiffness, self.damping, self.to, force, self.mass, self.elements,
            self.clash_travel, clash, wire, self.pulsation.part if self.pulsation else None, self.link,
        )  # fmt: skip
        place = self.installed_force, self.installed_compression
        if self.force_table is not None:
            spring = install_spring(replace(spring, table=tuple(self.force_table)), *place)
            clash = self.clash_stiffness or _COIL_CONTACT_RATIO * self.elements * spring.stiffness
            return replace(spring, clash_stiffness=clash)
        if self.coils is not None and self.wire is not None:
            coils, modulus = [entry.part for entry in self.coils], self.wire.shear_modulus or 0.0
            spring = coil_spring(spring, coils, self.wire.diameter, modulus, self.wire.density)
            clash = self.clash_stiffness or _COIL_CONTACT_RATIO * max(part.stiffness for part in spring.parts)
            return install_spring(replace(spring, clash_stiffness=clash), *place)
        return spring


class BearingRecord(Record):
    """Elastic bearing with isotropic stiffness and damping perpendicular to the shaft."""

    at: Name
    stiffness: Stiffness
    damping: DampingValue = 0.0


class FrictionRecord(PartRecord[valvetrain.Friction]):
    """Friction of a guide, a seal or a pivot, to ground or between two points."""

    at: Name
    to: Name | None = Field(None, description="the other side; ground where absent")
    direction: DirectionValue
    force: float = Field(description="Coulomb's force, N, or moment about an axis, N m")
    breakaway_force: float | None = Field(None, description="when sliding begins; as force by default")
    stribeck_speed: float = Field(0.1, description="over which it falls to force, m/s, or rad/s about an axis")
    friction_speed: float = Field(0.01, description="over which it reverses, m/s, or rad/s about an axis")
    damping: float = Field(0.0, description="viscous part, N s/m, or N m s/rad about an axis")

    @field_validator("force", "breakaway_force", "stribeck_speed", "friction_speed", "damping", mode="before")
    @classmethod
    def _convert_unit(cls, value: object, info: ValidationInfo) -> float | None:
        """Return SI; units depend on whether the slide turns."""
        if value is None:
            return None
        turns = not direction(info.data.get("direction", "uy"))[:3].any()
        kind = {"damping": ("damping", "rotational damping")}
        kinds = kind.get(str(info.field_name), ("velocity", "speed") if "speed" in str(info.field_name) else _FORCES)
        return Unit(kinds[turns], above="speed" in str(info.field_name)).validate(value)

    def _check(self) -> None:
        if self.breakaway_force is not None and self.breakaway_force < self.force:
            given = f"{self.breakaway_force:g}"
            raise value_error(f"{self.force:g} or more", "it is the larger one", inside="breakaway_force", given=given)
        super()._check()

    def build(self) -> valvetrain.Friction:
        """Build the friction."""
        breakaway = self.force if self.breakaway_force is None else self.breakaway_force
        speeds = self.stribeck_speed, self.friction_speed
        return valvetrain.Friction(
            self.at, direction(self.direction), self.force, breakaway, *speeds, self.damping, self.to
        )


_FORCES = ("force", "moment")


class LoadRecord(PartRecord[valvetrain.GivenLoad]):
    """Force at a point, constant or from a table, or constant force distributed over a member."""

    at: Name | None = Field(None, description="point of application")
    member: Name | None = Field(None, description="member it is distributed over")
    direction: DirectionValue
    force: float | None = Field(None, description="N at a point, N m about an axis")
    force_per_length: Annotated[float, Unit("stiffness", signed=True)] | None = Field(
        None, description="N/m over a member"
    )
    table: LoadDefinition | None = Field(
        None, description="file with the force, the moment or the pressure over the cam or crank angle or over time"
    )
    area: Annotated[float, Unit("area", above=True)] | None = Field(
        None, description="on which the pressure of a table acts"
    )
    phase: SignedAngle | None = Field(None, description="cam angle at which the zero of a table over an angle lies")
    repeat: bool | None = Field(
        None, strict=True, description="whether a table repeats; by default each revolution, but not over time"
    )

    @field_validator("force", mode="before")
    @classmethod
    def _convert_unit(cls, value: object, info: ValidationInfo) -> float | None:
        """Return SI; a force about an axis is a moment."""
        if value is None:
            return None
        turns = not direction(info.data.get("direction", "uy"))[:3].any()
        return Unit("moment" if turns else "force", signed=True).validate(value)

    @model_validator(mode="after")
    def _check_target(self) -> Self:
        given = self.force is not None, self.table is not None, self.force_per_length is not None
        point, spread = (True, False), (False, True)
        if sum(given) != 1 or (self.at is not None, self.member is not None) != (spread if given[2] else point):
            allowed = "either at with force or table, or member with force_per_length"
            raise value_error(allowed, "a load acts at a point or along a member")
        if self.table is None:
            for key in ("area", "phase", "repeat"):
                if getattr(self, key) is not None:
                    raise value_error("table beside it", "it describes a table", "add table", inside=key)
        return self

    def build(self) -> valvetrain.GivenLoad:
        """Build the load."""
        along = direction(self.direction)
        if self.table is not None:
            unit = "N" if along[:3].any() else "N m"
            table = self.table.build(unit, self.area, self.phase, self.repeat)
            return valvetrain.GivenLoad(table, along, self.at)
        size = self.force if self.force is not None else self.force_per_length
        return valvetrain.GivenLoad(size or 0.0, along, self.at, self.member)


_DefinedPoint = Annotated[Name, Field(description="point it defines")]
_Arms = Annotated[tuple[Length, Length], Field(description="arm at `from` and at `to`")]
_DrivenDirection = Annotated[LineValue | None, Field(description="motion at `from`; along the member there by default")]


class LumpedRecord(Record):
    """Rocker without bending: the point `to` moves by the ratio of the arms."""

    model: Literal["lumped"]
    start: Name = Field(alias="from", description="named node it is driven at")
    to: _DefinedPoint
    arms: _Arms
    inertia: Inertia = Field(0.0, description="about the rocker's shaft")
    direction: _DrivenDirection = None


class LeverRecord(Record):
    """Rocker or finger follower with finite rotation: its ratio depends on its angle, its arms are elastic."""

    model: Literal["lever"]
    start: Name = Field(
        alias="from", description="named node it is driven at; a new name for a finger that the cam touches"
    )
    to: _DefinedPoint
    arms: _Arms
    angles: tuple[SignedAngle, SignedAngle] = Field(
        (0.0, 0.0), description="of both arms as installed; 0 where an arm is square to the motion of its end"
    )
    inertia: Annotated[float, Unit("inertia", above=True)] = Field(description="about the lever's axis")
    stiffness: PositiveStiffness = Field(description="of the arm at `to`")
    damping: DampingValue = Field(0.0, description="of the arm at `to`")
    drive_stiffness: PositiveStiffness | None = Field(
        None, description="of the arm at a driven node; as stiffness by default"
    )
    drive_damping: DampingValue = Field(0.0, description="of the arm at a driven node")
    direction: _DrivenDirection = None


RockerRecord = Annotated[LumpedRecord | LeverRecord, Field(discriminator="model")]
