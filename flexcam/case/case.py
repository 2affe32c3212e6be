"""Checked case: its records in SI units, with every key, its type and its default, and its variants.

`flexcam schema` passes the field descriptions to editors. Every key has an effect.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated, Any, cast

from pydantic import BaseModel, Field, ValidationError

from flexcam.case.fault_report import KeyLocations, value_at
from flexcam.case.fault_report import Path as KeyPath
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
from flexcam.case.schema.run import FidelityRecord, NewmarkRecord, OutputRecord, PhaserRecord, RunRecord
from flexcam.case.schema.springs import SpringRecord
from flexcam.core.errors import InputError, refuse
from flexcam.core.units import DIMENSIONS, shaft_speed
from flexcam.fem.mesh import Mesh

_Format = Annotated[int, Field(ge=1, le=1, strict=True, description="version of the case format: 1")]


class SweepRecord(Record):
    """Variants of the case for `flexcam sweep`; options on the command line override these keys."""

    set_: dict[str, Annotated[str, Field(min_length=1)]] = Field(
        default={},
        alias="set",
        description='values of each key: a range ("run.speed" = "1000:4000:50rpm"), a list ("30,40 kN/m") or an '
        "interval to sample",
    )
    sample: str | None = Field(
        None, description="N samples, lhs:N or sobol:N, instead of every combination", examples=["sobol:512"]
    )
    seed: int = Field(0, ge=0, strict=True, description="seed of the samples; the same seed gives the same points")
    scalars: list[str] = Field(
        default=[], description="results to save, by names or beginnings of names; all by default"
    )


class CaseRecord(Record):
    """Case file."""

    format: _Format
    title: str = ""
    mesh: str | None = Field(None, description="Gmsh file, relative to the case file")
    nodes: dict[Name, Point] = Field(default={}, description="named nodes, instead of a mesh file")
    materials: dict[Name, MaterialRecord] = Field(default={})
    sections: dict[Name, SectionRecord] = Field(default={})
    members: dict[Name, MemberRecord] = Field(default={}, description="beams; a lumped train has none")
    superelements: dict[Name, SuperelementRecord] = Field(default={})
    rigid_links: dict[Name, RigidLinkRecord] = Field(default={}, description="massless rigid connections and joints")
    supports: dict[Name, list[Component]] = Field(default={}, description="components fixed at a point")
    masses: dict[Name, MassRecord] = Field(default={})
    springs: dict[Name, SpringRecord] = Field(default={})
    bearings: dict[Name, BearingRecord] = Field(default={})
    loads: dict[Name, LoadRecord] = Field(default={})
    rockers: dict[Name, RockerRecord] = Field(default={})
    cams: dict[Name, CamRecord] = Field(default={})
    phasers: dict[Name, PhaserRecord] = Field(default={})
    contacts: dict[Name, ContactRecord] = Field(default={})
    friction: dict[Name, FrictionRecord] = Field(
        default={}, description="friction of guides, seals, pivots and nested springs"
    )
    repeat: dict[Name, RepeatRecord] = Field(default={}, description="copies of parts, such as those of each cylinder")
    run: RunRecord
    fidelity: FidelityRecord = Field(default_factory=lambda: FidelityRecord.model_validate({}))
    sweep: SweepRecord | None = None
    output: OutputRecord = Field(default_factory=lambda: OutputRecord.model_validate({}))


class CamsRecord(Record):
    """File that contains only cams, for cam design without a mechanism."""

    format: _Format
    title: str = ""
    cams: dict[Name, CamDesignRecord]
    speed: CamshaftSpeed = None


class PartialRecord(Record):
    """Case of which only these tables are read: before copies of parts exist, and for the options of a sweep."""

    repeat: dict[Name, RepeatRecord] = Field(default={})
    sweep: SweepRecord | None = None


def si_unit(path: tuple[str, ...]) -> str | None:
    """Return the SI unit of a key; None if it has none, or if it depends on other keys or on the position in a list."""
    units = {DIMENSIONS[unit.dimension].si for first in _units_at(path)[:1] for unit in first if not unit.axis}
    return units.pop() if len(units) == 1 else None


def _units_at(path: tuple[str, ...]) -> list[list[Unit]]:
    """Return the units of a key in each of the tables that may contain it."""
    while path and path[-1].isdigit():
        path = path[:-1]
    fields = [field for name, field in fields_at(path[:-1], CaseRecord) if name == path[-1]]
    if not fields and len(path) > 1:  # a name in a table of names, such as nodes
        fields = [field for name, field in fields_at(path[:-2], CaseRecord) if name == path[-2]]
    return [units_in(field) for field in fields]


def resolve_record(record: CaseRecord) -> dict[str, Any]:
    """Return a case with all defaults as tables that can be read again."""
    exclude = {"nodes"} if record.mesh is not None else None
    return record.model_dump(mode="json", by_alias=True, exclude_none=True, exclude=exclude)


def find_unit(record: CaseRecord, path: Sequence[str]) -> str | None:
    """Return the SI unit of a number of a case.

    Some units depend on other keys of the table: a spring stiffness is N/m along a line and N m/rad about an axis. The
    table is then validated with the number in each possible unit: it accepts only the right one.
    """
    si = si_unit(tuple(path))
    if si is not None and not any(unit.axis for units in _units_at(tuple(path)) for unit in units):
        return si
    table, rest = _enclosing_table(record, path)
    tables = table.model_dump(mode="json", by_alias=True)
    holder, number = value_at(tables, rest[:-1]), value_at(tables, rest)
    if number is None:
        return None
    key: Any = int(rest[-1]) if isinstance(holder, list) else rest[-1]
    # Moments may omit the radian, so rotational stiffness is tried first.
    kinds = sorted(DIMENSIONS.values(), key=lambda kind: path[-1] not in kind.name)
    units = [*(kind.si for kind in kinds if kind.si), ""]
    for unit in units:
        cast("dict[str, object]", holder)[key] = f"{number!r} {unit}" if unit else number
        with suppress(ValidationError, InputError):
            if type(table).model_validate(tables) == table:
                return unit
    return None


def _enclosing_table(record: BaseModel, path: Sequence[str]) -> tuple[BaseModel, Sequence[str]]:
    """Return the innermost table of a key and the remaining path."""
    innermost, value = (record, path), cast("object", record)
    for i, step in enumerate(path):
        if isinstance(value, BaseModel):
            innermost = value, path[i:]
            names = {field.alias or name: name for name, field in type(value).model_fields.items()}
            value = getattr(value, names.get(step, step), None)
        elif isinstance(value, dict):
            value = cast("dict[str, object]", value).get(step)
    return innermost


@dataclass(frozen=True, eq=False)
class Case:
    """Checked case.

    Parameters
    ----------
    path
        File of the case.
    text
        Text of the file.
    overrides
        Overrides of the case, as ``key=value``.
    record
        Checked values in SI units.
    mesh
        Mesh of the mesh file; None for a case with its own nodes.
    places
        Source of every key: line or override.
    files
        Texts of the law and lift files, by name in the case.
    reread
        Function that reads a case again with other values by table and key.
    result_name
        Name of its results; that of its file by default.

    Examples
    --------
    ``read_case("cases/tayeb/model-3-shm.toml").record.cams["intake"].lift`` is 0.006.
    """

    path: Path
    text: str
    overrides: tuple[str, ...]
    record: CaseRecord
    mesh: Mesh | None
    places: KeyLocations
    files: Mapping[str, str]
    reread: Callable[[Case, Mapping[str, object]], Case]
    result_name: str = ""

    def __repr__(self) -> str:
        return f"<Case {self.title!r}, {self.path}>"

    @property
    def name(self) -> str:
        """Name of results: that of the file without suffix by default."""
        return self.result_name or self.path.stem

    @property
    def title(self) -> str:
        """Title of the case, or the name of its file."""
        return self.record.title or self.name

    @property
    def speed(self) -> float:
        """Camshaft speed, rad/s."""
        run = self.record.run
        return run.speed if run.speed is not None else 0.5 * (run.crank_speed or 0.0)

    @property
    def turns(self) -> float:
        """Revolutions of the shaft whose speed the case gives, per camshaft revolution: 2 for the crankshaft."""
        return 2.0 if self.record.run.speed is None else 1.0

    @property
    def speed_text(self) -> str:
        """Speed with unit and shaft, for messages."""
        return shaft_speed(self.speed, self.turns)

    def at_speed(self, speed: float, revolutions: float | None = None) -> Case:
        """Return the same case at another speed.

        Parameters
        ----------
        speed
            Camshaft speed, rad/s.
        revolutions
            Camshaft revolutions; those of the case by default.

        Returns
        -------
        Case
            Case with unchanged text and overrides; its speed refers to the same shaft.
        """
        changed: dict[str, object] = {"speed": speed, "crank_speed": None}
        if self.turns == 2.0:
            changed = {"speed": None, "crank_speed": 2.0 * speed}
        if revolutions is not None:
            changed["revolutions"] = revolutions
        return self.with_run(changed)

    def replace(self, values: Mapping[str, object]) -> Case:
        """Return the same case with other values, as `read_case` from its file with these overrides.

        Parameters
        ----------
        values
            Values by dotted key or by table and key: texts with unit, or numbers in SI. A table changes only the keys
            that it has; a new name adds a part.

        Returns
        -------
        Case
            Checked case; its overrides have the changes. Changes by `at_speed` remain.

        Raises
        ------
        InputError
            If a value or the case is invalid.

        Examples
        --------
        ``case.replace({"springs.valve.stiffness": "60 kN/m"})``, or ``case.replace({"springs": {"valve": {"stiffness":
        6e4}}})``
        """
        return self.reread(self, values)

    def with_stable_method(self) -> Case:
        """Return the same case if its method is stable at any time step, otherwise with the average acceleration."""
        integrator = self.record.run.integrator
        limited = integrator is not None and integrator.part.stability_limit() < math.inf
        return self.with_newmark() if limited else self

    def with_newmark(self) -> Case:
        """Return the same case with Newmark's method, whose steps are those of derivatives along a run."""
        return self.with_run({"integrator": NewmarkRecord()})

    def with_run(self, changed: Mapping[str, object]) -> Case:
        """Return the same case with changed keys of ``[run]``.

        Parameters
        ----------
        changed
            Checked values by key.

        Returns
        -------
        Case
            Case with unchanged text and overrides.
        """
        return self._with({"run": self.record.run.model_copy(update=dict(changed))})

    def with_fidelity(self, changed: Mapping[str, object]) -> Case:
        """Return the same case with changed keys of ``[fidelity]``.

        Parameters
        ----------
        changed
            Checked values by key.

        Returns
        -------
        Case
            Case with unchanged text and overrides.
        """
        return self._with({"fidelity": self.record.fidelity.model_copy(update=dict(changed))})

    def _with(self, tables: Mapping[str, object]) -> Case:
        return replace(self, record=self.record.model_copy(update=tables))

    def place(self, path: KeyPath) -> str:
        """Return a key path with its line or override.

        Parameters
        ----------
        path
            Keys and indices from the root of the file.

        Returns
        -------
        str
            Such as ``run.speed (line 62)``.
        """
        return self.places.place(path)


def require_case(case: object) -> None:
    """Raise an error if an argument of the public interface is no case, such as the path of its file."""
    if not isinstance(case, Case):
        given = repr(str(case)) if isinstance(case, str | Path) else type(case).__name__
        remedy = f"read it first: flexcam.read_case({given if isinstance(case, str | Path) else 'path'})"
        raise refuse("case", given, "a Case", "", remedy)
