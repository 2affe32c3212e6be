"""Checked records of the case file in SI units: every key, its type and its default.

`flexcam schema` passes the field descriptions to editors. Every key has an effect.
"""

from __future__ import annotations

from typing import Annotated, Literal, Self

from pydantic import Field, model_validator

from flexcam.case.schema.base import (
    CamshaftSpeed,
    Component,
    CrankshaftSpeed,
    Length,
    Name,
    Point,
    PositiveStiffness,
    Record,
    value_error,
)
from flexcam.case.schema.cams import CamDesignRecord, CamRecord
from flexcam.case.schema.contacts import ContactRecord
from flexcam.case.schema.parts import (
    BearingRecord,
    LoadRecord,
    MassRecord,
    MaterialRecord,
    MemberRecord,
    RockerRecord,
    SectionRecord,
    SpringRecord,
)
from flexcam.case.schema.run import FidelityRecord, OutputRecord, RunRecord

_Format = Annotated[int, Field(ge=1, le=1, strict=True, description="version of the case format: 1")]


class SettingRecord(Record):
    """Speed and valve spring for `flexcam settings`; missing values are those of the case."""

    speed: CamshaftSpeed = None
    crank_speed: CrankshaftSpeed = None
    stiffness: PositiveStiffness | None = Field(None, description="of the spring")
    installed_compression: Length | None = Field(None, description="of the spring")

    @model_validator(mode="after")
    def _check_speed(self) -> Self:
        if self.speed is not None and self.crank_speed is not None:
            raise value_error("either speed or crank_speed", "one follows from the other")
        return self

    @property
    def camshaft_speed(self) -> float | None:
        """Camshaft speed, rad/s; None for the speed of the case."""
        return self.speed if self.crank_speed is None else 0.5 * self.crank_speed


class SweepRecord(Record):
    """Variants of the case for `flexcam sweep`; keys on the command line override it."""

    set_: dict[str, Annotated[str, Field(min_length=1)]] = Field(
        default={},
        alias="set",
        description='key to its values: "run.speed" = "1000:4000:50rpm", a list "30,40 kN/m", an interval to sample',
    )
    sample: str | None = Field(
        None, description="lhs:N or sobol:N instead of every combination", examples=["sobol:512"]
    )
    seed: int = Field(0, ge=0, strict=True, description="of the samples: the same seed gives the same points")
    scalars: list[str] = Field(default=[], description="which to keep, by name or beginning of a name; all by default")


class CaseRecord(Record):
    """Case file."""

    format: _Format
    title: str = ""
    paper: Literal["tayeb-sliman"] | None = Field(None, description="published system whose claims `compare` checks")
    mesh: str | None = Field(None, description="Gmsh file, relative to the case file")
    nodes: dict[Name, Point] = Field(default={}, description="named nodes, instead of a mesh file")
    materials: dict[Name, MaterialRecord] = Field(default={})
    sections: dict[Name, SectionRecord] = Field(default={})
    members: dict[Name, MemberRecord] = Field(default={}, description="beams; a lumped train has none")
    supports: dict[Name, list[Component]] = Field(default={}, description="components held at a point")
    masses: dict[Name, MassRecord] = Field(default={})
    springs: dict[Name, SpringRecord] = Field(default={})
    bearings: dict[Name, BearingRecord] = Field(default={})
    loads: dict[Name, LoadRecord] = Field(default={})
    rockers: dict[Name, RockerRecord] = Field(default={})
    cams: dict[Name, CamRecord] = Field(default={})
    contacts: dict[Name, ContactRecord] = Field(default={})
    settings: dict[Name, SettingRecord] = Field(
        default={}, description="speeds and springs that `settings` tells beside the case's own"
    )
    run: RunRecord
    fidelity: FidelityRecord = Field(default_factory=lambda: FidelityRecord.model_validate({}))
    sweep: SweepRecord | None = Field(None, description="variants that `sweep` runs")
    output: OutputRecord = Field(default_factory=lambda: OutputRecord.model_validate({}))


class CamsRecord(Record):
    """File that contains only cams, for cam design without a mechanism."""

    format: _Format
    title: str = ""
    cams: dict[Name, CamDesignRecord]
    speed: CamshaftSpeed = None


class SweepFileRecord(Record):
    """Case of which only the table ``[sweep]`` is read."""

    sweep: SweepRecord
