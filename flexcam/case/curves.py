"""Curves of a case by name, as a table of parameters, or in a file: motion laws, lifts, loads; matrices in files."""

from __future__ import annotations

import inspect
import math
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cache
from pathlib import Path
from typing import Annotated, Any, Literal, TypeVar, cast

import numpy as np
from pydantic import (
    BaseModel,
    Field,
    GetCoreSchemaHandler,
    GetJsonSchemaHandler,
    ValidationError,
    ValidationInfo,
    create_model,
)
from pydantic_core import CoreSchema, core_schema

from flexcam.cams import LAWS, Event, HarmonicLift, Law, LawKind, LiftReport, kind_names, law_kind, lift_table
from flexcam.case.fault_report import parse_toml
from flexcam.case.schema.base import Record, Unit, convert_error, describe_type_error, value_error
from flexcam.core import FloatArray
from flexcam.core.errors import InputError, format_value, positive, refuse, suggest_name, system_message
from flexcam.core.units import conversion_factor, is_convertible, unit_of
from flexcam.io import NodalMatrix, read_lift, read_matrix, read_text, resolve_file
from flexcam.io.files import ABSCISSAS, find_abscissa
from flexcam.io.number_tables import read_columns
from flexcam.valvetrain import LoadTable

Table = Mapping[str, Any]


@dataclass(frozen=True)
class LawDefinition:
    """Law with its definition in the case."""

    given: str | dict[str, Any]  #: name, or ``id`` with parameters; for a law file, the content of the file
    law: Law = field(compare=False)  #: motion law


@dataclass(frozen=True)
class LiftDefinition:
    """Lift over the whole revolution from a file, with a report of the smoothing."""

    given: str | dict[str, Any]  #: value in the case
    event: Event = field(compare=False)  #: lift event
    report: LiftReport | None = field(compare=False)  #: smoothing report; None for harmonics, which are not smoothed


@dataclass(frozen=True)
class LoadDefinition:
    """Load over the cam angle or over time from a file."""

    given: str | dict[str, Any]  #: value in the case
    over_time: bool = field(compare=False)  #: whether it is given over time
    at: FloatArray = field(compare=False)  #: cam angles, rad, or times, s, shape (m,)
    name: str = field(compare=False)  #: name of the column of the load
    unit: str = field(compare=False)  #: unit of the values
    values: FloatArray = field(compare=False)  #: shape (m,)

    def build(self, unit: str, area: float | None, phase: float | None, repeat: bool | None) -> LoadTable:
        """Build the table of a force (N) or a moment (N m), or of a pressure on an area (m^2)."""
        if area is not None and unit != "N":
            raise refuse("area", f"{area:g} m^2", "no area", "a pressure acts as a force", "give a moment, or a force")
        if self.over_time and phase is not None:
            raise refuse("phase", f"{phase:g} rad", "no phase", "a table over time has no cam angle")
        target, where = unit if area is None else "Pa", f"column {self.name!r} of its table"
        try:
            factor = conversion_factor(self.unit, target, where)
        except InputError:
            given = f"{self.name} [{self.unit}]" if self.unit else f"{self.name}, without a unit"
            allowed, why = unit_of(target), ""
            if area:
                allowed = "a unit of pressure such as bar"
                why = "the load gives 'area', so its table must be a pressure"
            remedy = "check that this is the right file and column"
            if not self.unit:
                remedy = f"write its unit in the header line, such as {self.name} [{'bar' if area else 'N'}]"
            if is_convertible(self.unit, "N" if area else "Pa"):
                remedy = "leave area out to apply a force" if area else "give the load an area to apply a pressure"
            raise refuse(where, given, allowed, why, remedy) from None
        repeats = not self.over_time if repeat is None else repeat
        period = self._period(where, explicit=repeat is not None) if repeats else None
        at, size = self.at + (phase or 0.0), self.values * factor * (area or 1.0)
        if period is not None and at[-1] - at[0] > period * (1.0 - _SAME_PLACE):
            if abs(size[-1] - size[0]) > _SAME_END * np.abs(size).max():
                given = f"{self.values[0]:g} and {self.values[-1]:g} {self.unit}"
                why, remedy = "the table repeats, and its ends are the same instant", "correct the last row"
                raise refuse(where, given, "the same value in the first and the last row", why, remedy)
            at, size = at[:-1], size[:-1]
        return LoadTable(at, size, self.over_time, period)

    def _period(self, where: str, *, explicit: bool) -> float:
        """Return the period: a revolution of the camshaft, or the length in time.

        Unless the repetition is given, a table over an angle that ends early, such as one of an open valve, is refused.
        """
        length = float(self.at[-1] - self.at[0])
        if self.over_time:
            return length
        degrees, period = f"{math.degrees(length):g}", 2.0 * math.pi
        if length > period * (1.0 + _SAME_PLACE):
            why, given = "the table repeats with each revolution of the camshaft", f"{degrees} deg of cam angle"
            raise refuse(where, given, "up to 360 deg", why, "give one revolution, or repeat = false")
        if not explicit and period - length > max(_MAX_GAP * period, float(np.diff(self.at).max())):
            why, remedy = "a straight line would join the last row to the first", "add rows, or repeat = true"
            allowed = "a whole revolution of the camshaft"
            raise refuse(where, f"{degrees} of 360 deg of cam angle", allowed, why, remedy)
        return period


@dataclass(frozen=True)
class MatrixDefinition:
    """Matrix of a superelement from a file."""

    given: str | dict[str, Any]  #: value in the case
    matrix: NodalMatrix = field(compare=False)  #: rows and values, in the units of the file


_SAME_PLACE = 1e-6  # relative tolerance of the length of a table against its period
_SAME_END = 1e-3  # tolerance of the ends of a table that repeats, relative to its largest value
_MAX_GAP = 0.1  # gap between the ends of a table over an angle, by its period, above which `repeat` must be given


@dataclass(frozen=True)
class _Files:
    """Files in the folder of a case, which are read once; a result has the texts of those of its case."""

    case: Path  #: file of the case
    texts: dict[str, str]  #: texts read so far, by file name in the case

    @classmethod
    def of(cls, info: ValidationInfo) -> _Files:
        """Return the files of the case that is being validated."""
        context = cast("Mapping[str, Any]", info.context or {})
        return cls(context.get("case", Path()), context.get("texts", {}))

    def read(self, name: str, where: str, read: Callable[[Path, str | None], Read]) -> Read:
        """Read a file, or its known text, and keep the text."""
        known = self.texts.get(name)
        path = resolve_file(self.case, name, where) if known is None else Path(name)
        content = read(path, known)
        if known is None:
            self.texts[name] = read_text(path)
        return content


Read = TypeVar("Read")
FileRecord = TypeVar("FileRecord", bound=BaseModel)


class _LiftFile(Record):
    """Lift table file with the units that its header lacks."""

    file: str = Field(description="table of angle and lift, or TOML with harmonics; relative to the case file")
    column: str | None = Field(None, description="name of the column of the lift, or of the lobe, if there are several")
    angle: Literal["cam", "crank"] | None = Field(None, description="of which shaft the angles are")
    unit: Literal["um", "mm", "cm", "m", "in", "thou"] | None = Field(None, description="of the lift")
    tolerance: Annotated[float, Unit("length")] | None = Field(
        None, description="allowed rms change by smoothing, 0 for none; that of the noise by default"
    )


class _LoadFile(Record):
    """Load table file and the column of the load."""

    file: str = Field(description="CSV with an angle or a time, and the load; relative to the case file")
    column: str | None = Field(None, description="name of the column of the load, if there are several")


class _MatrixFile(Record):
    """Matrix file and the name of its matrix."""

    file: str = Field(description="matrix file; relative to the case file")
    matrix: str | None = Field(None, description="name of the matrix in a Nastran punch file, if there are several")


@dataclass(frozen=True)
class _FromFile:
    """Annotation of a value that may name a file in the folder of the case; it is serialized as given."""

    make: Callable[[object, _Files], object]
    properties: Callable[[], dict[str, Any]]  #: JSON schemas of the keys of its table, which requires the first one

    def __get_pydantic_core_schema__(self, source: Any, handler: GetCoreSchemaHandler) -> CoreSchema:  # noqa: ANN401
        serializer = core_schema.plain_serializer_function_ser_schema(lambda definition: definition.given)
        return core_schema.with_info_plain_validator_function(self.validate, serialization=serializer)

    def __get_pydantic_json_schema__(self, schema: CoreSchema, handler: GetJsonSchemaHandler) -> dict[str, Any]:
        keys = self.properties()
        table = {"type": "object", "properties": keys, "required": [next(iter(keys))]}
        return {"anyOf": [{"type": "string"}, table]}

    def validate(self, value: object, info: ValidationInfo) -> object:
        """Return the content of a file or of a table; raise its faults in the form of pydantic."""
        try:
            return self.make(value, _Files.of(info))
        except InputError as refusal:
            # A fault of the value itself has no path inside it.
            fault = refusal.faults[0]
            if fault.where == "table":
                raise value_error(fault.allowed, fault.why, fault.remedy, given=fault.given) from None
            raise convert_error(refusal, inside=fault.where not in ("law", "lift_table")) from None


def read_force_table(value: object, info: ValidationInfo) -> object:
    """Return the rows of travel and force of a file in the folder of the case, SI; other values unchanged."""
    if not isinstance(value, str):
        return value
    try:
        columns = _Files.of(info).read(value, "table", lambda path, text: read_columns(path, "table", text))
        known, units = {name.lower(): column for name, column in columns.items()}, {"travel": "m", "force": "N"}
        if missing := [name for name in units if name not in known]:
            given, allowed = f"{Path(value).name}, without {' and '.join(missing)}", "a table with the columns"
            raise refuse("table", given, f"{allowed} travel and force", f"it has {', '.join(columns)}")
        scaled = [known[name][1] * conversion_factor(known[name][0], units[name], f"column {name!r}") for name in units]
    except InputError as refusal:
        fault = refusal.faults[0]
        raise value_error(fault.allowed, fault.why, fault.remedy, given=fault.given) from None
    return np.column_stack(scaled).tolist()


def _parse_law_value(value: object, files: _Files) -> LawDefinition:
    if isinstance(value, str) and value.endswith(".toml"):
        return files.read(value, "law", read_law)
    if isinstance(value, (str, dict)):
        return parse_law(cast("str | dict[str, Any]", value))
    raise refuse("law", format_value(value), "the name of a law, a table { id = ..., ... } or a law file")


def parse_law(value: str | Table) -> LawDefinition:
    """Return the law of a name or of a table of parameters."""
    table = {"id": value} if isinstance(value, str) else dict(value)
    name = table.pop("id", None)
    if not isinstance(name, str):
        raise refuse("id", format_value(name), ", ".join(kind_names()), "the kind of law is required")
    given = value if isinstance(value, str) else dict(value)
    if name in LAWS and not table:
        return LawDefinition(given, LAWS[name])
    return LawDefinition(given, _make_law(name, table))


def _make_law(name: str, parameters: Table) -> Law:
    kind = law_kind(name)
    if kind is None:
        known = list(dict.fromkeys([*LAWS, *kind_names()]))
        if name in LAWS:
            given = ", ".join(f"{key}={value}" for key, value in parameters.items())
            raise refuse(f"law {name}", given, "no parameters", "it has none", "leave them out")
        raise refuse("law", repr(name), ", ".join(known), "", suggest_name(name, known))
    record = _parameter_record(kind)
    for key, value in parameters.items():
        if not _is_numeric(value):
            known, why = ", ".join(record.model_fields), _PAIRS if _takes_pairs(record, key) else ""
            raise refuse(key, format_value(value), f"numbers; the parameters of {name} are {known}", why)
    missing = [key for key, field in record.model_fields.items() if field.is_required() and key not in parameters]
    if missing:
        unknown = [key for key in parameters if key not in record.model_fields]
        why = f"the law {name} requires {', '.join(missing)}"
        why += f" and has no parameter {', '.join(unknown)}" if unknown else ""
        known = [key for key in record.model_fields if key in missing or key in parameters]
        values = {key: format_value(parameters[key]) if key in parameters else "..." for key in known}
        table = f'{{ id = "{name}", {", ".join(f"{key} = {value}" for key, value in values.items())} }}'
        options = " ".join(f"--with {key}={value}" for key, value in values.items())
        remedy = f"write law = {table} in a case, or add {options} to flexcam law"
        raise refuse(missing[0], "nothing", "a value", why, remedy)
    parameters = _validate(record, parameters, f"a parameter of {name}", "law")
    return kind(**parameters)


_PAIRS = "it is a list of pairs, a whole number and a number each: [[1, 0.9], [3, 0.1]]"


def _takes_pairs(record: type[BaseModel], key: str) -> bool:
    info = record.model_fields.get(key.partition(".")[0])
    return info is not None and info.annotation == tuple[tuple[int, float], ...]


def _is_numeric(value: object) -> bool:
    if isinstance(value, (list, tuple)):
        return all(_is_numeric(item) for item in cast("list[object]", value))
    return isinstance(value, (int, float)) and not isinstance(value, bool)


def _file(record: type[FileRecord], value: object, example: str) -> FileRecord:
    table = {"file": value} if isinstance(value, str) else value
    return record(**_validate(record, table, "a file name, or a table of", example))


def _validate(record: type[BaseModel], table: object, what: str, example: str) -> dict[str, Any]:
    """Validate a table and return its values; raise the first fault."""
    try:
        checked = record.model_validate(table)
    except ValidationError as refusal:
        error = refusal.errors(include_url=False)[0]
        if error["type"] == "flexcam":
            fault = error.get("ctx", {})
            given = fault["given"] or format_value(error["input"])
            raise refuse(str(error["loc"][0]), given, fault["allowed"], fault["why"], fault["remedy"]) from None
        key = ".".join(map(str, error["loc"])) or example
        allowed = f"{what}: {', '.join(record.model_fields)}"
        if error["type"] == "missing":
            raise refuse(key, "nothing", allowed, "the key is required", f"add {key} to the table") from None
        if error["type"] == "literal_error":
            known = re.findall(r"'([^']*)'", str(error.get("ctx", {})["expected"]))
            near = suggest_name(str(error["input"]), known)
            raise refuse(key, format_value(error["input"]), ", ".join(map(repr, known)), "", near) from None
        info = record.model_fields.get(key.partition(".")[0])
        why = f"{describe_type_error(error)} is needed there"
        if error["type"] == "extra_forbidden":
            why = "there is no such key"
        elif _takes_pairs(record, key):
            why = _PAIRS
        hint = suggest_name(key, record.model_fields) if info is None else ""
        raise refuse(key, format_value(error["input"]), allowed, why, hint) from None
    return {key: getattr(checked, key) for key in record.model_fields}


@cache
def _parameter_record(kind: LawKind) -> type[BaseModel]:
    """Return a record for the parameters of a law, built from its signature."""
    fields: dict[str, Any] = {}
    for name, parameter in inspect.signature(kind, eval_str=True).parameters.items():
        default = ... if parameter.default is inspect.Parameter.empty else parameter.default
        fields[name] = (parameter.annotation, default)
    return create_model("Parameters", __base__=Record, **fields)


def read_law(path: Path, text: str | None = None) -> LawDefinition:
    """Read a law file, or its known text: TOML with a table ``[law]``."""
    return _read_toml_table(path, "law", text, parse_law)


def _read_toml_table(path: Path, name: str, text: str | None, make: Callable[[Table], Read]) -> Read:
    """Return the part that `make` builds from a table of a file; faults name the file."""
    try:
        content = parse_toml(read_text(path) if text is None else text)
    except FileNotFoundError:
        near = suggest_name(path.name, [p.name for p in path.parent.glob("*.toml")] if path.parent.is_dir() else [])
        allowed = f"an existing file with a table [{name}]"
        raise refuse(str(path), "a missing file", allowed, "", near or "correct its path") from None
    except (OSError, ValueError) as fault:
        allowed = f"a readable file with a table [{name}]"
        raise refuse(str(path), "no TOML document", allowed, system_message(fault)) from None
    if content.get("format", 1) != 1:
        raise refuse(f"{path.name}: format", format_value(content["format"]), "1", "a newer flexcam wrote it")
    table = content.get(name)
    if not isinstance(table, dict):
        raise refuse(str(path), ", ".join(content) or "nothing", f"a table [{name}]")
    try:
        return make(cast("Table", table))
    except InputError as refusal:
        fault = refusal.faults[0]
        raise InputError([replace(fault, where=f"{path.name}, [{name}] {fault.where}")]) from None


def _parse_lift_value(value: object, files: _Files) -> LiftDefinition:
    record = _file(_LiftFile, value, "lift_table")
    if Path(record.file).suffix == ".toml":
        if extra := [key for key in ("angle", "unit", "tolerance", "column") if getattr(record, key) is not None]:
            raise refuse(extra[0], str(getattr(record, extra[0])), "no such key", "files of harmonics are in m")
        event = files.read(record.file, "lift_table", read_harmonic_lift)
        return LiftDefinition(cast("str | dict[str, Any]", value), event, None)
    columns = files.read(
        record.file,
        "lift_table",
        lambda path, text: read_lift(path, angle=record.angle, unit=record.unit, column=record.column, text=text),
    )
    try:
        event, report = lift_table(columns.angle, columns.lift, tolerance=record.tolerance)
    except InputError as refusal:
        fault = refusal.faults[0]
        notes = [f"also {_place_with_line(other.where, columns.lines)}: {other.given}" for other in refusal.faults[1:]]
        why = "; ".join(part for part in (fault.why, *notes) if part)
        where = f"{Path(record.file).name}: {_place_with_line(fault.where, columns.lines)}"
        raise refuse(where, fault.given, fault.allowed, why, fault.remedy) from None
    remarks = tuple(_place_with_line(f"{Path(record.file).name}, {remark}", columns.lines) for remark in report.remarks)
    return LiftDefinition(cast("str | dict[str, Any]", value), event, replace(report, remarks=remarks))


def _parse_load_value(value: object, files: _Files) -> LoadDefinition:
    record = _file(_LoadFile, value, "table")
    columns = files.read(record.file, "table", lambda path, text: read_columns(path, "table", text))
    abscissa, at = find_abscissa(columns, "table")
    loads = [name for name in columns if name not in ABSCISSAS]
    if not loads:
        given = f"{Path(record.file).name} with only {', '.join(columns)}"
        raise refuse("table", given, f"{abscissa} and a column of the load", "", "add a force, a moment or a pressure")
    name = record.column or (loads[0] if len(loads) == 1 else "")
    if name not in loads:
        remedy = suggest_name(name, loads) if name else 'name one: table = { file = ..., column = "..." }'
        raise refuse("column", repr(name) if name else "nothing", ", ".join(loads), "", remedy)
    unit, values = columns[name]
    if not np.isfinite(values).all():
        raise refuse("table", f"{name}, with an empty cell", "a number in every row")
    if len(at) < 2 or (np.diff(at) <= 0.0).any():
        raise refuse("table", f"{abscissa} of {len(at)} rows", "two or more rows with increasing values")
    return LoadDefinition(cast("str | dict[str, Any]", value), abscissa == "time", at, name, unit, values)


def _parse_matrix_value(value: object, files: _Files) -> MatrixDefinition:
    record = _file(_MatrixFile, value, "table")
    read = files.read(record.file, "table", lambda path, text: read_matrix(path, "table", text, record.matrix))
    return MatrixDefinition(cast("str | dict[str, Any]", value), read)


def _place_with_line(where: str, lines: Sequence[int]) -> str:
    """Return a position in a table with the line of the file in place of the row."""
    return re.sub(r"\brow (\d+)", lambda match: f"line {lines[int(match[1]) - 1]}", where)


def read_harmonic_lift(path: Path, text: str | None = None) -> HarmonicLift:
    """Read a harmonic lift, or its known text: TOML with a table ``[lift]`` of ``mean``, ``cosine`` and ``sine``."""

    def make(table: Table) -> HarmonicLift:
        lift = HarmonicLift(**_validate(_parameter_record(HarmonicLift), table, "a number or list in m", "lift"))
        positive("lift", lift.height, "m")
        return lift

    return _read_toml_table(path, "lift", text, make)


def _keys(record: type[BaseModel]) -> Callable[[], dict[str, Any]]:
    return lambda: record.model_json_schema()["properties"]


#: A motion law by name, as a table, or in a file.
LawValue = Annotated[LawDefinition, _FromFile(_parse_law_value, lambda: {"id": {"enum": sorted(kind_names())}})]
LiftValue = Annotated[LiftDefinition, _FromFile(_parse_lift_value, _keys(_LiftFile))]  #: A lift table in a file.
LoadValue = Annotated[LoadDefinition, _FromFile(_parse_load_value, _keys(_LoadFile))]  #: A load table in a file.
MatrixValue = Annotated[MatrixDefinition, _FromFile(_parse_matrix_value, _keys(_MatrixFile))]  #: A matrix in a file.
