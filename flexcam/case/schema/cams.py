"""Tables of cams, motion laws, ramps and followers."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field, ValidationInfo, WithJsonSchema, field_validator

from flexcam import valvetrain
from flexcam.cams import (
    DelayedEvent,
    Event,
    FlatFollower,
    Follower,
    LiftEvent,
    Ramp,
    RollerFollower,
    SwingFlatFollower,
    SwingRollerFollower,
    centreline,
    event_extremes,
    valve_event,
)
from flexcam.case.curves import LawValue, LiftValue
from flexcam.case.schema.base import (
    Angle,
    Length,
    Name,
    PartRecord,
    Position,
    PositiveAngle,
    Record,
    SignedAngle,
    Unit,
    Vector,
    value_error,
)
from flexcam.core.errors import InputError, refuse
from flexcam.core.units import parse

LAW_KEYS = {
    "law": "a motion law", "lift": "a length such as '6 mm'", "rise": "an angle such as '65 deg'",
    "return": "an angle such as '65 deg'",
}  # fmt: skip
"""Keys of a cam without a lift table, and their allowed values."""

LIFT_TABLE_CONFLICTS = (*LAW_KEYS, "dwell", "return_law", "ramps", "single_dwell")
"""Keys of a cam that its lift table replaces."""


class RampsRecord(Record):
    """Ramps before the rise and after the return."""

    height: Length
    duration: PositiveAngle
    take_off: Annotated[float, Unit("number", most=1.0)] = Field(
        0.25, description="fraction of the duration over which the velocity rises"
    )
    closing_height: Length | None = Field(None, description="equal to `height` by default")
    closing_duration: PositiveAngle | None = Field(None, description="equal to `duration` by default")

    def build(self) -> tuple[Ramp, Ramp]:
        """Build the opening and the closing ramp."""
        closing = (self.closing_height or self.height, self.closing_duration or self.duration)
        return Ramp(self.height, self.duration, self.take_off), Ramp(*closing, self.take_off)


class TimingRecord(Record):
    """Position of a cam on its shaft, by the angle at which its follower reaches a checking lift."""

    lift: Length = Field(description="checking lift of the follower, such as 0.050 in")
    opening: SignedAngle | None = Field(None, description="cam angle at which the follower rises through this lift")
    closing: SignedAngle | None = Field(
        None, description="cam angle at which the follower falls through this lift, instead of opening"
    )
    centre: SignedAngle | None = Field(
        None, description="cam angle halfway between opening and closing, instead of either"
    )

    def _check(self) -> None:
        keys = [key for key in ("opening", "closing", "centre") if getattr(self, key) is not None]
        if len(keys) != 1:
            raise value_error("one of opening, closing, centre", given=" and ".join(keys) or "none of them")

    def phase_of(self, event: Event) -> float:
        """Return the phase, rad, that places a lift event of phase zero."""
        valve = valve_event(event, self.lift)
        if valve is None:
            allowed = f"a lift below the maximum, {1e3 * event_extremes(event)[1].value:g} mm"
            raise refuse("timing.lift", f"{1e3 * self.lift:g} mm", allowed, "the follower never passes it")
        if self.centre is not None:
            return self.centre - 0.5 * valve.centre
        return (self.opening or 0.0) - 0.5 * valve.opens if self.closing is None else self.closing - 0.5 * valve.closes


class FlatRecord(Record):
    """Translating follower with a flat face."""

    type: Literal["flat"]
    face_diameter: Length | None = Field(None, description="diameter of a round face, to check for contact at its edge")
    axial_offset: Position = Field(
        0.0,
        description="distance along the shaft from the follower's axis to the middle of the cam; an offset spins a "
        "tappet with a round face",
    )
    crown_radius: Length | None = Field(
        None,
        description="radius of a spherical face, to check where it touches the lobe; the forces remain those of a "
        "flat face",
    )
    taper: SignedAngle = Field(
        0.0,
        description="angle between lobe surface and shaft, positive if the lobe is thicker on the side of a positive "
        "axial_offset; a taper spins a tappet with a crowned face",
    )

    def build(self, base_radius: float | None) -> Follower | None:
        """Build the follower."""
        if not base_radius:
            return None
        return FlatFollower(base_radius, self.face_diameter, self.axial_offset, self.crown_radius, self.taper)


class RollerRecord(Record):
    """Translating follower with a roller."""

    type: Literal["roller"]
    radius: Length = Field(description="radius of the roller")
    offset: Position = Field(0.0, description="offset of the follower's axis from the cam's axis")

    def build(self, base_radius: float | None) -> Follower | None:
        """Build the follower."""
        return RollerFollower(base_radius, self.radius, self.offset) if base_radius else None


class SwingingFollowerRecord(Record):
    """Swinging follower, with a roller if `radius` is given, otherwise with a flat face."""

    type: Literal["swing"]
    arm: Length = Field(
        description="distance from the pivot to the roller centre, or to the point at which the lift of a flat face "
        "is measured"
    )
    distance: Length = Field(description="distance from the pivot to the cam's centre")
    radius: Length | None = Field(None, description="radius of the roller")
    angle: PositiveAngle | None = Field(
        None,
        description="angle between arm and line of centres with the follower on the base circle, instead of "
        "base_radius",
    )
    face: Position = Field(0.0, description="distance of the flat face from the pivot, positive away from the cam")
    rotation: Literal["clockwise", "counterclockwise"] = Field(
        "clockwise", description="sense in which the follower turns during the rise"
    )

    def build(self, base_radius: float | None) -> Follower | None:
        """Build the follower."""
        side = 1 if self.rotation == "clockwise" else -1
        if self.angle is not None and self.radius is not None and base_radius is None:
            return SwingRollerFollower.from_angle(self.radius, self.arm, self.distance, self.angle, side)
        if self.angle is not None and self.radius is None:
            why = "the base circle defines the place of a flat face"
            raise refuse("follower.angle", "an angle", "base_radius of the cam instead", why, "give base_radius")
        if self.angle is not None:
            why = "for a roller, either this or base_radius defines the base circle"
            raise refuse("follower.angle", "an angle", "no angle", why, "leave one of them out")
        if base_radius is None:
            return None
        if self.radius is None:
            return SwingFlatFollower(base_radius, self.arm, self.distance, self.face, side)
        return SwingRollerFollower(base_radius, self.radius, self.arm, self.distance, side)


FollowerRecord = Annotated[FlatRecord | RollerRecord | SwingingFollowerRecord, Field(discriminator="type")]


class CamDesignRecord(PartRecord[valvetrain.Cam]):
    """Cam without a shaft: its lift over one revolution, and the follower that determines the profile."""

    at: Name | None = Field(None, description="name of a node of the camshaft")
    follower: FollowerRecord | None = None
    law: LawValue | None = Field(None, description="motion law: a name, { id = ..., ... }, or a law file (.toml)")
    return_law: LawValue | None = Field(
        None, description="law that the return follows in reverse; by default that of the rise"
    )
    lift: Annotated[float, WithJsonSchema({"anyOf": [{"type": "number"}, {"type": "string"}]})] | None = Field(
        None, gt=0.0, description='lift above the ramps; for a swinging follower also an angle such as "10 deg"'
    )
    lift_table: LiftValue | None = Field(None, description="file with the whole lift, instead of a law")
    rise: PositiveAngle | None = Field(None, description="cam angle of the rise")
    dwell: Angle = Field(0.0, description="cam angle of the upper dwell")
    fall: PositiveAngle | None = Field(None, alias="return", description="cam angle of the return")
    phase: SignedAngle = Field(
        0.0, description="cam angle at the beginning of the rise (after the ramp), or at the zero of a lift table"
    )
    centreline: SignedAngle | None = Field(
        None, description="cam angle of the maximum lift (the middle of an upper dwell), instead of phase"
    )
    timing: TimingRecord | None = Field(None, description="instead of phase")
    tdc: SignedAngle | None = Field(
        None,
        description="cam angle at overlap TDC of its cylinder, between exhaust and intake stroke, for the cam card",
    )
    ramps: RampsRecord | None = None
    single_dwell: Literal["high", "low"] | None = Field(
        None,
        description="position of the only dwell, at high or at low lift, for a law that begins with nonzero "
        "acceleration",
    )
    base_radius: Length | None = Field(None, description="radius of the base circle")
    width: Length | None = Field(None, description="width of the cam along its shaft")
    rotation: Literal["clockwise", "counterclockwise"] = Field(
        "counterclockwise",
        description="sense of rotation in the drawing of the profile; `axis` gives the sense in space",
    )

    @field_validator("lift", mode="before")
    @classmethod
    def _convert_unit(cls, value: object, info: ValidationInfo) -> object:
        """Return metres; with a swinging follower an angle is converted to the path at the length of its arm."""
        follower = info.data.get("follower")
        if value is None:
            return None
        if isinstance(follower, SwingingFollowerRecord) and isinstance(value, str):
            try:
                angle = parse(value, "angle")
            except InputError:
                pass  # a length
            else:
                return follower.arm * Unit("angle", above=True).validate(angle)
        return Unit("length", above=True).validate(value)

    @property
    def missing_keys(self) -> list[str]:
        """Missing keys of the lift."""
        pairs = (("law", self.law), ("lift", self.lift), ("rise", self.rise), ("return", self.fall))
        return [key for key, value in pairs if value is None and self.lift_table is None]

    @property
    def start_angle(self) -> float:
        """Cam angle at which the rise begins (or of the table's zero), rad, by phase, centreline or timing."""
        if self.timing is not None:
            return self.timing.phase_of(self._event_at(0.0))
        return self.phase if self.centreline is None else self.centreline - centreline(self._event_at(0.0))

    def _check(self) -> None:
        """Check the cam; missing keys are reported with the references of all tables."""
        places = {"phase": self.phase or None, "centreline": self.centreline, "timing": self.timing}
        keys = [key for key, value in places.items() if value is not None]
        if len(keys) > 1:
            why = "each of them places the cam on its shaft"
            raise refuse(keys[1], " and ".join(keys), f"one of {', '.join(places)}", why, "leave the others out")
        if not self.missing_keys:
            super()._check()
        elif self.follower is not None:
            self.follower.build(self.base_radius)

    def build(self) -> valvetrain.Cam:
        """Build the cam."""
        follower = self.follower.build(self.base_radius) if self.follower else None
        turn, event = 1 if self.rotation == "counterclockwise" else -1, self._event_at(self.start_angle)
        missing = tuple(key for key in ("base_radius", "follower") if getattr(self, key) is None)
        return valvetrain.Cam(self.at or "", event, follower, turn, self.width, missing=missing)

    def _event_at(self, phase: float) -> Event:
        if self.lift_table is not None:
            return DelayedEvent(self.lift_table.event, phase) if phase else self.lift_table.event
        if self.law is None or self.lift is None or self.rise is None or self.fall is None:
            missing, why = ", ".join(self.missing_keys), "a cam without a lift_table needs them"
            remedy = f"add {missing}, or a lift_table"
            raise refuse("lift", f"nothing for {missing}", ", ".join(LAW_KEYS), why, remedy)
        opening, closing = self.ramps.build() if self.ramps else (None, None)
        return LiftEvent(
            self.law.law, self.lift, self.rise, self.fall, self.dwell, phase,
            self.return_law.law if self.return_law else None, opening, closing, self.single_dwell,
        )  # fmt: skip


class CamRecord(CamDesignRecord):
    """A cam on its shaft."""

    at: Name = Field(description="name of a node of the camshaft")  # pyright: ignore[reportIncompatibleVariableOverride, reportGeneralTypeIssues]
    axis: Vector | None = Field(
        None,
        description="axis of rotation, with its sense by the right-hand rule; by default along the shaft towards "
        "positive coordinates",
    )
