"""Checked records of the case file in SI units: every key, its type and its default.

`flexcam schema` passes the field descriptions to editors. Every key has an effect.
"""

from __future__ import annotations

from typing import Literal

from pydantic import Field

from flexcam.case import quantities as q
from flexcam.case.schema.base import Name, Point, Record
from flexcam.case.schema.cams import CamDesignRecord, CamRecord
from flexcam.case.schema.contacts import ContactRecord
from flexcam.case.schema.members import MaterialRecord, MemberRecord, SectionRecord
from flexcam.case.schema.parts import BearingRecord, LoadRecord, MassRecord, RockerRecord, SpringRecord
from flexcam.case.schema.run import FidelityRecord, OutputRecord, RunRecord
from flexcam.case.schema.studies import SweepRecord


class CaseRecord(Record):
    """Case file."""

    format: int = Field(ge=1, le=1, strict=True, description="version of the case format: 1")
    title: str = ""
    paper: Literal["tayeb-sliman"] | None = Field(None, description="published system whose claims `compare` checks")
    mesh: str | None = Field(None, description="Gmsh file, relative to the case file")
    nodes: dict[Name, Point] = Field(default={}, description="named nodes, instead of a mesh file")
    materials: dict[Name, MaterialRecord] = Field(default={})
    sections: dict[Name, SectionRecord] = Field(default={})
    members: dict[Name, MemberRecord] = Field(default={}, description="beams; a lumped train has none")
    supports: dict[Name, list[q.Component]] = Field(default={}, description="components held at a point")
    masses: dict[Name, MassRecord] = Field(default={})
    springs: dict[Name, SpringRecord] = Field(default={})
    bearings: dict[Name, BearingRecord] = Field(default={})
    loads: dict[Name, LoadRecord] = Field(default={})
    rockers: dict[Name, RockerRecord] = Field(default={})
    cams: dict[Name, CamRecord] = Field(default={})
    contacts: dict[Name, ContactRecord] = Field(default={})
    run: RunRecord
    fidelity: FidelityRecord = Field(default_factory=lambda: FidelityRecord.model_validate({}))
    sweep: SweepRecord | None = Field(None, description="variants that `sweep` runs")
    output: OutputRecord = Field(default_factory=lambda: OutputRecord.model_validate({}))


class CamsRecord(Record):
    """File that contains only cams, for cam design without a mechanism."""

    format: int = Field(ge=1, le=1, strict=True, description="version of the case format: 1")
    title: str = ""
    cams: dict[Name, CamDesignRecord]
    speed: q.Speed | None = Field(None, description="camshaft speed")
