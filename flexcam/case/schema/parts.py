"""Tables of parts attached to the structure: masses, springs, bearings, loads, rockers."""

from __future__ import annotations

from typing import Annotated, Literal, Self

from pydantic import Field, ValidationInfo, field_validator, model_validator

from flexcam import valvetrain
from flexcam.case import quantities as q
from flexcam.case.schema.base import Name, PartRecord, Point, Record
from flexcam.fem.frames import direction
from flexcam.fem.rigid_bodies import PointMass


class MassRecord(PartRecord[valvetrain.MassAt]):
    """Rigid body at a point."""

    at: Name
    mass: q.MassValue
    inertia: tuple[q.Inertia, q.Inertia, q.Inertia] = Field(
        (0.0, 0.0, 0.0), description="about its centre, global axes"
    )
    offset: Point = Field((0.0, 0.0, 0.0), description="from the node to its centre, global axes")

    def build(self) -> valvetrain.MassAt:
        """Build the body and its position."""
        return valvetrain.MassAt(self.at, PointMass(self.mass, self.inertia, self.offset))


_COIL_CONTACT_RATIO = 50.0
"""Default ratio of the stiffness of touching coils to that of the spring part between them: flexcam's choice."""


class WireRecord(PartRecord[valvetrain.Wire]):
    """Wire of a coil spring, for its stress and its default stiffness."""

    diameter: q.Length
    coil_diameter: q.Length = Field(description="of the coil's mean circle")
    active_coils: q.PositiveNumber | None = Field(None, description="with shear_modulus: the spring's stiffness")
    shear_modulus: q.Stress | None = None

    @model_validator(mode="after")
    def _check_coil(self) -> Self:
        if self.coil_diameter < 2.0 * self.diameter:
            raise q.value_error("a coil_diameter of twice the wire's or more", "Wahl's factor has no meaning for less")
        if (self.active_coils is None) != (self.shear_modulus is None):
            raise q.value_error("active_coils and shear_modulus together, or neither", "the stiffness takes both")
        return self

    def build(self) -> valvetrain.Wire:
        """Build the wire."""
        return valvetrain.Wire(self.diameter, self.coil_diameter)

    @property
    def rate(self) -> float | None:
        """Stiffness of the spring, N/m; None without a number of coils."""
        if self.active_coils is None or self.shear_modulus is None:
            return None
        return self.build().rate(self.shear_modulus, self.active_coils)


class PulsationRecord(PartRecord[valvetrain.Pulsation]):
    """Variation of a stiffness with the cam angle."""

    order: q.PositiveNumber = Field(description="swings per camshaft revolution")
    amplitude: q.Ratio = Field(description='part of the mean stiffness, such as "10 %"; below 1')
    phase: q.SignedAngle = 0.0

    @model_validator(mode="after")
    def _check_amplitude(self) -> Self:
        if self.amplitude >= 1.0:
            raise q.value_error("an amplitude below 1", "the stiffness must not change its sign")
        return self

    def build(self) -> valvetrain.Pulsation:
        """Build the pulsation."""
        return valvetrain.Pulsation(self.order, self.amplitude, self.phase)


class SpringRecord(PartRecord[valvetrain.Spring]):
    """Spring and damper along one direction, to ground or to another point."""

    at: Name
    to: Name | None = Field(None, description="the other end; ground where absent")
    direction: q.DirectionValue
    stiffness: float = Field(0.0, description="N/m, or N m/rad about an axis")
    damping: float = Field(0.0, description="N s/m, or N m s/rad about an axis")
    link: bool = Field(
        False, strict=True, description="stands for a part of the train, which is rigid in the rigid mechanism"
    )
    installed_force: q.Force | None = Field(None, description="force it is installed with, against direction")
    installed_compression: q.Length | None = Field(None, description="instead of the force: times the stiffness")
    mass: q.MassValue = Field(0.0, description="spread over its length")
    elements: int = Field(
        1, ge=1, le=1000, strict=True,
        description="equal parts; more than one lets it surge; with mass 4 to 16 by default, as its waves need",
    )  # fmt: skip
    clash_travel: q.Length | None = Field(None, description="along direction from installed until all coils touch")
    clash_stiffness: Annotated[float, q.Unit("stiffness", above=True)] | None = Field(
        None, description="of a contact between neighbouring parts; 50 times a part's own by default"
    )
    pulsation: PulsationRecord | None = Field(None, description="swing of its stiffness; the mean alone by default")
    wire: WireRecord | None = Field(None, description="for the shear stress, and the stiffness where none is given")

    @model_validator(mode="after")
    def _check_parts(self) -> Self:
        if self.wire is not None and not direction(self.direction)[:3].any():
            raise q.value_error(
                "a wire on a spring along a line", "its stress and stiffness are those of a coil in compression"
            )
        if self.wire is not None and self.wire.rate is not None and self.stiffness:
            raise q.value_error("either stiffness, or active_coils and shear_modulus of the wire", "both say the same")
        if self.installed_force is not None and self.installed_compression is not None:
            raise q.value_error("either installed_force or installed_compression", "one follows from the other")
        if self.link and (self.to is None or self.installed_force or self.installed_compression):
            raise q.value_error(
                "a link with an end `to` and no preload", "it joins two points as a part of the train does"
            )
        if self.clash_travel is not None and not self.build().stiffness:
            raise q.value_error("a stiffness where coils can touch", "a spring without one has no coils")
        return self

    @field_validator("stiffness", "damping", mode="before")
    @classmethod
    def _convert_unit(cls, value: object, info: ValidationInfo) -> float:
        """Return SI; units depend on whether the spring is translational or rotational."""
        along = info.data.get("direction", "uy")
        turns = not direction(along)[:3].any()
        return q.Unit(f"rotational {info.field_name}" if turns else str(info.field_name)).validate(value)

    def build(self) -> valvetrain.Spring:
        """Build the spring."""
        along = direction(self.direction)
        stiffness = self.stiffness or (self.wire.rate if self.wire else None) or 0.0
        clash = self.clash_stiffness or _COIL_CONTACT_RATIO * self.elements * stiffness
        wire = self.wire.build() if self.wire else None
        force = self.installed_force
        if self.installed_compression is not None:
            force = stiffness * self.installed_compression
        return valvetrain.Spring(
            self.at, along, stiffness, self.damping, self.to, force, self.mass, self.elements,
            self.clash_travel, clash, wire, self.pulsation.build() if self.pulsation else None, self.link,
        )  # fmt: skip


class BearingRecord(PartRecord[tuple[float, float]]):
    """Elastic bearing with isotropic stiffness and damping perpendicular to the shaft."""

    at: Name
    stiffness: q.Stiffness
    damping: q.DampingValue = 0.0

    def build(self) -> tuple[float, float]:
        """Return stiffness and damping; the directions follow from the mesh."""
        return self.stiffness, self.damping


class LoadRecord(Record):
    """Constant force at a point or distributed over a member."""

    at: Name | None = Field(None, description="point it acts at")
    member: Name | None = Field(None, description="member it is spread over")
    direction: q.DirectionValue
    force: float | None = Field(None, description="N at a point, N m about an axis")
    force_per_length: Annotated[float, q.Unit("stiffness", signed=True)] | None = Field(
        None, description="N/m over a member"
    )

    @field_validator("force", mode="before")
    @classmethod
    def _convert_unit(cls, value: object, info: ValidationInfo) -> float | None:
        """Return SI; a force about an axis is a moment."""
        if value is None:
            return None
        turns = not direction(info.data.get("direction", "uy"))[:3].any()
        return q.Unit("moment" if turns else "force", signed=True).validate(value)

    @model_validator(mode="after")
    def _check_target(self) -> Self:
        point, spread = (
            self.at is not None and self.force is not None,
            self.member is not None and self.force_per_length is not None,
        )
        if point == spread or (self.at is not None) == (self.member is not None):
            raise q.value_error("either at with force, or member with force_per_length", "a load acts in one way")
        return self

    def build(self) -> valvetrain.GivenLoad:
        """Build the load."""
        size = self.force if self.force is not None else self.force_per_length
        return valvetrain.GivenLoad(size or 0.0, direction(self.direction), self.at, self.member)


class LumpedRecord(Record):
    """Rocker without bending: the point `to` moves by the ratio of the arms."""

    model: Literal["lumped"]
    start: Name = Field(alias="from", description="named node it is driven at")
    to: Name = Field(description="point it defines")
    arms: tuple[q.Length, q.Length] = Field(description="arm at `from` and at `to`")
    inertia: q.Inertia = Field(0.0, description="about the rocker's shaft")
    direction: q.LineValue | None = Field(None, description="motion at `from`; along the member there by default")


class LeverRecord(Record):
    """Rocker or finger follower with finite rotation: its ratio depends on its angle, its arms are elastic."""

    model: Literal["lever"]
    start: Name = Field(
        alias="from", description="named node it is driven at; a new name for a finger that the cam touches"
    )
    to: Name = Field(description="point it defines")
    arms: tuple[q.Length, q.Length] = Field(description="arm at `from` and at `to`")
    angles: tuple[q.SignedAngle, q.SignedAngle] = Field(
        (0.0, 0.0), description="of both arms as installed; 0 where an arm is square to the motion of its end"
    )
    inertia: Annotated[float, q.Unit("inertia", above=True)] = Field(description="about the lever's axis")
    stiffness: Annotated[float, q.Unit("stiffness", above=True)] = Field(description="of the arm at `to`")
    damping: q.DampingValue = Field(0.0, description="of the arm at `to`")
    drive_stiffness: Annotated[float, q.Unit("stiffness", above=True)] | None = Field(
        None, description="of the arm at a driven node; as stiffness by default"
    )
    drive_damping: q.DampingValue = Field(0.0, description="of the arm at a driven node")
    direction: q.LineValue | None = Field(None, description="motion at `from`; along the member there by default")


RockerRecord = Annotated[LumpedRecord | LeverRecord, Field(discriminator="model")]
