"""Tables of contacts: cam and follower, seats, plays."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field

from flexcam.case import quantity as q
from flexcam.case.tables.base import Name, Record


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
    restitution: q.Ratio | None = Field(
        None, le=1.0, description="rate of parting per rate of approach, at the moment they meet"
    )
    friction: q.Ratio = Field(0.0, le=2.0, description="Coulomb's coefficient along a flat face")
    friction_speed: q.Velocity = Field(0.01, description="velocity of sliding over which friction turns over, m/s")


CamContactRecord = PublishedLoadRecord | BilateralRecord | UnilateralRecord


class SeatRecord(Record):
    """A stop, such as a valve seat."""

    model: Literal["seat"]
    at: Name
    direction: q.DirectionValue | None = Field(None, description="the way off it; a rocker's point has its own")
    stiffness: Annotated[float, q.Unit("stiffness", above=True)]
    damping: q.DampingValue = 0.0
    restitution: q.Ratio | None = Field(
        None, le=1.0, description="rate of parting per rate of approach, at the moment they meet"
    )


class LashRecord(Record):
    """Play between a rocker and the point it drives."""

    model: Literal["lash"]
    at: Name = Field(description="name of a rocker")
    gap: Annotated[float, q.Unit("length")] = Field(description="at the rocker's point")
    stiffness: Annotated[float, q.Unit("stiffness", above=True)] = Field(description="of rocker and tip, at the point")
    damping: q.DampingValue = 0.0


ContactRecord = Annotated[CamContactRecord | SeatRecord | LashRecord, Field(discriminator="model")]
