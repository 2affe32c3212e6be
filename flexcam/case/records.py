"""Checked records of the case file in SI units: every key, its type and its default.

`flexcam schema` passes the field descriptions to editors. Every key has an effect.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Annotated, Any, Literal, cast

from pydantic import BaseModel, Field, ValidationError

from flexcam.case.schema.base import CamshaftSpeed, Component, Name, Point, Record, Unit, fields_at, units_in
from flexcam.case.schema.cams import CamDesignRecord, CamRecord
from flexcam.case.schema.contacts import ContactRecord
from flexcam.case.schema.parts import (
    BearingRecord,
    FrictionRecord,
    LoadRecord,
    MassRecord,
    MaterialRecord,
    MemberRecord,
    RepeatRecord,
    RigidLinkRecord,
    RockerRecord,
    SectionRecord,
    SuperelementRecord,
)
from flexcam.case.schema.run import FidelityRecord, OutputRecord, PhaserRecord, RunRecord
from flexcam.case.schema.springs import SpringRecord
from flexcam.core.errors import InputError
from flexcam.core.units import DIMENSIONS

_Format = Annotated[int, Field(ge=1, le=1, strict=True, description="the version of the case format, 1")]


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
    scalars: list[str] = Field(default=[], description="saved scalars, by name or beginning of a name; all by default")


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
    superelements: dict[Name, SuperelementRecord] = Field(default={}, description="elastic bodies by their matrices")
    rigid_links: dict[Name, RigidLinkRecord] = Field(default={}, description="massless rigid connections and joints")
    supports: dict[Name, list[Component]] = Field(default={}, description="components fixed at a point")
    masses: dict[Name, MassRecord] = Field(default={})
    springs: dict[Name, SpringRecord] = Field(default={})
    bearings: dict[Name, BearingRecord] = Field(default={})
    loads: dict[Name, LoadRecord] = Field(default={})
    rockers: dict[Name, RockerRecord] = Field(default={})
    cams: dict[Name, CamRecord] = Field(default={})
    phasers: dict[Name, PhaserRecord] = Field(default={}, description="of camshafts")
    contacts: dict[Name, ContactRecord] = Field(default={})
    friction: dict[Name, FrictionRecord] = Field(default={}, description="of guides, seals and pivots")
    repeat: dict[Name, RepeatRecord] = Field(default={}, description="copies of parts, such as those of each cylinder")
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


class RepeatFileRecord(Record):
    """Case of which only the table ``[repeat]`` is read, before its copies exist."""

    repeat: dict[Name, RepeatRecord]


def si_unit(path: tuple[str, ...]) -> str | None:
    """Return the SI unit of a key; None if it has none, or if it depends on other keys or on the position in a list."""
    units = {DIMENSIONS[unit.dimension].si for first in _units_at(path)[:1] for unit in first if not unit.axis}
    return units.pop() if len(units) == 1 else None


def example_value(path: tuple[str, ...]) -> str | None:
    """Return an example of a quantity, such as ``25 mm``; None for other keys."""
    return next((DIMENSIONS[unit.dimension].example for units in _units_at(path) for unit in units), None)


def _units_at(path: tuple[str, ...]) -> list[list[Unit]]:
    """Return the units of a key in each of the tables that may contain it."""
    while path and path[-1].isdigit():
        path = path[:-1]
    fields = [field for name, field in fields_at(path[:-1], CaseRecord) if name == path[-1]]
    if not fields and len(path) > 1:  # a name in a table of names, such as nodes
        fields = [field for name, field in fields_at(path[:-2], CaseRecord) if name == path[-2]]
    return [[unit for part in (*field.metadata, field.annotation) for unit in units_in(part)] for field in fields]


def resolve_record(record: CaseRecord) -> dict[str, Any]:
    """Return a case with all defaults as tables that can be read again."""
    exclude = {"nodes"} if record.mesh is not None else None
    return record.model_dump(mode="json", by_alias=True, exclude_none=True, exclude=exclude)


def find_unit(record: CaseRecord, path: Sequence[str]) -> str | None:
    """Return the SI unit of a number of a case.

    Some units depend on other keys of the table: a spring stiffness is N/m along a line and N m/rad about an axis. The
    table is then validated with the number in each possible unit: it accepts only the right one.
    """
    known = si_unit(tuple(path))
    if known is not None and not any(unit.axis for units in _units_at(tuple(path)) for unit in units):
        return known
    table, rest = _enclosing_table(record, path)
    # Moments may omit the radian, so rotational stiffness is tried first.
    kinds = sorted(DIMENSIONS.values(), key=lambda kind: path[-1] not in kind.name)
    units = [*(kind.si for kind in kinds if kind.si), ""]
    return next((unit for unit in units if _accepts_unit(table, rest, unit)), None)


def _enclosing_table(record: BaseModel, path: Sequence[str]) -> tuple[BaseModel, Sequence[str]]:
    """Return the innermost table of a key and the remaining path."""
    found, value = (record, path), cast("object", record)
    for i, step in enumerate(path):
        if isinstance(value, BaseModel):
            found = value, path[i:]
            names = {field.alias or name: name for name, field in type(value).model_fields.items()}
            value = getattr(value, names.get(step, step), None)
        elif isinstance(value, dict):
            value = cast("dict[str, object]", value).get(step)
    return found


def _accepts_unit(table: BaseModel, path: Sequence[str], unit: str) -> bool:
    """Return whether a table keeps its values with a number in a given unit."""
    try:
        given = _set_unit(table.model_dump(mode="json", by_alias=True), path, unit)
        return type(table).model_validate(given) == table
    except (ValidationError, InputError, KeyError, IndexError):
        return False


def _set_unit(value: object, path: Sequence[str], unit: str) -> object:
    """Return the raw value with a unit appended to the number at a path."""
    if not path:
        return f"{value!r} {unit}" if unit else value
    step, *rest = path
    if isinstance(value, list):
        row = [*cast("list[object]", value)]
        row[int(step)] = _set_unit(row[int(step)], rest, unit)
        return row
    named = cast("dict[str, object]", value)
    return {**named, step: _set_unit(named[step], rest, unit)}
