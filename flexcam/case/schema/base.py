"""Types of values in a case file (quantities with units, components, directions) and base classes of its tables."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Annotated, Any, ClassVar, Generic, Self, TypeVar, get_args

from pydantic import (
    BaseModel,
    ConfigDict,
    Field,
    GetCoreSchemaHandler,
    GetJsonSchemaHandler,
    PlainValidator,
    ValidationInfo,
    WithJsonSchema,
    model_validator,
)
from pydantic.fields import FieldInfo
from pydantic_core import CoreSchema, ErrorDetails, PydanticCustomError, core_schema

from flexcam.core.errors import NAME, InputError
from flexcam.core.units import DIMENSIONS, parse
from flexcam.fem.dofs import COMPONENTS, component, direction

_BARE = re.compile(r"[+-]?(\d+(\.\d*)?|\.\d+)([eE][+-]?\d+)?")  # number without a unit

_TYPE_NAMES = {  # of pydantic, in messages
    "string_type": "a string in quotes", "bool_type": "true or false", "bool_parsing": "true or false",
    "list_type": "a list in brackets", "tuple_type": "a list in brackets", "dict_type": "a table",
    "float_type": "a number", "float_parsing": "a number",
    "int_type": "a whole number", "int_parsing": "a whole number", "int_from_float": "a whole number",
}  # fmt: skip


def describe_type_error(error: ErrorDetails) -> str:
    """Return a description of the allowed values."""
    context = error.get("ctx", {})
    limits = {
        "greater_than_equal": f"{context.get('ge')} or more", "less_than_equal": f"{context.get('le')} or less",
        "string_too_short": "a string that is not empty", "finite_number": "a finite number",
    }  # fmt: skip
    if error["type"] in {"list_type", "tuple_type"} and str(error["input"]).startswith("["):
        return "a list in brackets, with quotes around each string"
    return {**_TYPE_NAMES, **limits}.get(error["type"]) or error["msg"].replace("Input should be ", "")


def value_error(
    allowed: str, why: str = "", remedy: str = "", *, inside: str = "", given: str = ""
) -> PydanticCustomError:
    """Return an error in the form that pydantic collects."""
    facts = {"allowed": allowed, "why": why, "remedy": remedy, "inside": inside, "given": given}
    return PydanticCustomError("flexcam", "{allowed}", facts)


def convert_error(refusal: InputError, *, inside: bool = False) -> PydanticCustomError:
    """Convert an `InputError` to the form that pydantic collects."""
    fault = refusal.faults[0]
    place = {"inside": fault.where, "given": fault.given} if inside else {}
    return value_error(fault.allowed, fault.why, fault.remedy, **place)


@dataclass(frozen=True)
class Unit:
    """Annotation of a float that is given as a quantity and stored in SI."""

    dimension: str  #: a key of `flexcam.core.units.DIMENSIONS`
    above: bool = False  #: require a positive value
    signed: bool = False  #: allow negative values
    most: float | None = None  #: upper limit, SI; None for no limit
    axis: str = ""  #: dimension if the direction of the table, an earlier key, is about an axis; empty for the same
    #: treat numbers too small for their kind as zero, which always applies if negative values are allowed
    noise: bool = False

    def validate(self, value: Any, info: ValidationInfo | None = None) -> float:  # noqa: ANN401 - any TOML value
        """Return the number in SI."""
        if self.axis and info is not None and not direction(info.data.get("direction") or "uy")[:3].any():
            return replace(self, dimension=self.axis, axis="").validate(value)
        kind = DIMENSIONS[self.dimension]
        if isinstance(value, str) and kind.si and _BARE.fullmatch(value.strip()) and float(value) != 0.0:
            units = dict.fromkeys((kind.example.split(" ", 1)[1], kind.si))
            raise value_error(self.description, "the text has no unit", f"add a unit, such as {' or '.join(units)}")
        try:
            number = parse(value, self.dimension, noise=self.signed or self.noise)
        except InputError as refusal:
            raise convert_error(refusal) from None
        if number < 0.0 and not self.signed:
            raise value_error(f"{self.description} {'above zero' if self.above else 'of zero or more'}")
        if number == 0.0 and self.above:
            raise value_error(f"{self.description} above zero")
        if self.most is not None and number > self.most:
            raise value_error(f"{self.description} up to {self.most:g}")
        return number

    @property
    def description(self) -> str:
        """Kind of quantity with an example, for messages."""
        kind = DIMENSIONS[self.dimension]
        return f"{kind.indefinite} (such as {kind.example!r})"

    def __get_pydantic_core_schema__(self, source: Any, handler: GetCoreSchemaHandler) -> CoreSchema:  # noqa: ANN401
        return core_schema.with_info_plain_validator_function(self.validate)

    def __get_pydantic_json_schema__(self, schema: CoreSchema, handler: GetJsonSchemaHandler) -> dict[str, Any]:
        if self.axis:
            return {"anyOf": [{"type": "number"}, {"type": "string"}]}
        kind, number = DIMENSIONS[self.dimension], dict[str, Any](type="number")
        if not self.signed:
            number["exclusiveMinimum" if self.above else "minimum"] = 0
        if self.most is not None:
            number["maximum"] = self.most
        words = f"{kind.name}, SI number ({kind.si or '-'}) or string with a unit"
        return {"anyOf": [number, {"type": "string"}], "description": words, "examples": [kind.example]}


def _component(value: Any) -> str:  # noqa: ANN401 - any TOML value
    if isinstance(value, list):
        remedy = "use a stiff spring with this direction"
        raise value_error("ux, uy, uz, rx, ry, rz", "a support acts in global axes", remedy)
    try:
        component(str(value))
    except InputError as refusal:
        raise convert_error(refusal) from None
    return str(value)


def _direction(value: Any) -> Any:  # noqa: ANN401
    try:
        direction(value)
    except InputError as refusal:
        raise convert_error(refusal) from None
    return value


def _line(value: Any) -> Any:  # noqa: ANN401
    if direction(_direction(value))[3:].any():
        allowed, why = "a component such as 'uy' or '-uy', or three numbers", "it is a motion along a line, in m"
        raise value_error(allowed, why, "give the direction of the motion")
    return value


def _direction_schema(kind: str, maximum: int) -> WithJsonSchema:
    array = {"type": "array", "items": {"type": "number"}, "minItems": 3, "maxItems": maximum}
    return WithJsonSchema({"anyOf": [{"type": "string", "pattern": f"^[+-]?{kind}[xyz]$"}, array]})


Component = Annotated[str, PlainValidator(_component), WithJsonSchema({"enum": list(COMPONENTS)})]
# Component with an optional sign, or three (or six) numbers in global axes.
DirectionValue = Annotated[Any, PlainValidator(_direction), _direction_schema("[ur]", 6)]
DIRECTION = "a component such as uy or -uy, or three numbers (six with rotations)"
# Direction without rotations, for motions and forces in contacts and rockers.
LineValue = Annotated[Any, PlainValidator(_line), _direction_schema("u", 3)]

Length = Annotated[float, Unit("length", above=True)]
Position = Annotated[float, Unit("length", signed=True)]
MassValue = Annotated[float, Unit("mass")]
Inertia = Annotated[float, Unit("inertia")]
Density = Annotated[float, Unit("density", above=True)]
Viscosity = Annotated[float, Unit("viscosity", above=True)]
Stress = Annotated[float, Unit("stress", above=True)]
Pressure = Annotated[float, Unit("pressure", above=True)]
Stiffness = Annotated[float, Unit("stiffness")]
PositiveStiffness = Annotated[float, Unit("stiffness", above=True)]
SecondMoment = Annotated[float, Unit("second moment", above=True)]
DampingValue = Annotated[float, Unit("damping")]
PositiveDamping = Annotated[float, Unit("damping", above=True)]
AxisDamping = Annotated[float, Unit("damping", axis="rotational damping")]
Force = Annotated[float, Unit("force")]
Angle = Annotated[float, Unit("angle")]
PositiveAngle = Annotated[float, Unit("angle", above=True)]
SignedAngle = Annotated[float, Unit("angle", signed=True)]
Speed = Annotated[float, Unit("speed", above=True)]
Velocity = Annotated[float, Unit("velocity", above=True)]
Time = Annotated[float, Unit("time", above=True)]
Ratio = Annotated[float, Unit("number")]
Tolerance = Annotated[float, Unit("number", noise=True)]
PositiveNumber = Annotated[float, Unit("number", above=True)]
SignedNumber = Annotated[float, Unit("number", signed=True)]

CamshaftSpeed = Annotated[Speed | None, Field(description="camshaft speed")]
CrankshaftSpeed = Annotated[Speed | None, Field(description="crankshaft speed, twice the camshaft's")]

Flag = Annotated[bool, Field(strict=True)]
Count = Annotated[int, Field(ge=1, strict=True)]

Part = TypeVar("Part")
_MARKED_NAME = r"^[A-Za-z0-9_{][A-Za-z0-9_{} -]*$"
"""Pattern of a name in a file, where it may contain marks such as ``{cylinder}``."""

Name = Annotated[str, Field(pattern=NAME), WithJsonSchema({"type": "string", "pattern": _MARKED_NAME})]
Vector = tuple[SignedNumber, SignedNumber, SignedNumber]
Point = tuple[Position, Position, Position]
_Acceleration = Annotated[float, Unit("acceleration", signed=True)]
Gravity = tuple[_Acceleration, _Acceleration, _Acceleration]


class Record(BaseModel):
    """Base class of all tables: unknown keys are rejected, and values cannot be changed."""

    # defer_build: the validator of a table is built once, together with the enclosing table
    model_config = ConfigDict(extra="forbid", frozen=True, defer_build=True)

    def _check(self) -> None:
        """Raise an error if keys do not fit together."""

    @model_validator(mode="after")
    def _check_keys(self) -> Self:
        try:
            self._check()
        except InputError as refusal:
            raise convert_error(refusal, inside=True) from None
        return self


class PartRecord(Record, Generic[Part]):
    """Base class of tables that describe one part of the model: validation builds it and reports its faults."""

    kind: ClassVar[Any]  #: class or function of the part, whose arguments are the keys of the table but for ``method``

    def build(self) -> Part:
        """Build the part, SI."""
        return type(self).kind(**{key: getattr(self, key) for key in type(self).model_fields if key != "method"})

    @cached_property
    def part(self) -> Part:
        """Part of the model, SI, built once."""
        return self.build()

    def model_copy(self, *, update: Mapping[str, Any] | None = None, deep: bool = False) -> Self:
        """Return a copy with other values, which describes another part."""
        copy = super().model_copy(update=update, deep=deep)
        vars(copy).pop("part", None)
        return copy

    def _check(self) -> None:
        _ = self.part


def records_at(path: tuple[str, ...], root: type[BaseModel]) -> list[type[BaseModel]]:
    """Return the tables allowed at a key path: several for a table with variants."""
    records = [root]
    for step in path:
        matches = [
            inner
            for record in records
            for name, field in record.model_fields.items()
            if (field.alias or name) == step
            for inner in records_in(field.annotation)
        ]
        # A step that is not a field is a user-defined name in a table of names.
        records = matches or records
    return records


def records_in(annotation: object) -> list[type[BaseModel]]:
    """Return the tables contained in a type: in unions, tables of names and annotated types."""
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        return [annotation]
    parts: list[object] = [*get_args(annotation)]
    return [record for part in parts for record in records_in(part)]


def fields_at(path: tuple[str, ...], root: type[BaseModel]) -> Iterator[tuple[str, FieldInfo]]:
    """Yield the keys of the tables at a path with their fields."""
    for record in records_at(path, root):
        yield from keys_of(record)


def keys_of(record: type[BaseModel]) -> Iterator[tuple[str, FieldInfo]]:
    """Yield the keys of a table with their fields."""
    for name, field in record.model_fields.items():
        yield field.alias or name, field


def units_in(annotation: object) -> list[Unit]:
    """Return the units contained in a type or a field, without those of its tables."""
    if isinstance(annotation, Unit):
        return [annotation]
    of_field = isinstance(annotation, FieldInfo)
    parts: list[object] = [*annotation.metadata, annotation.annotation] if of_field else [*get_args(annotation)]
    return [unit for part in parts for unit in units_in(part)]
