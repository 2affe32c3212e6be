"""Base classes of the tables of a case file."""

from __future__ import annotations

from typing import Annotated, Generic, Self, TypeVar

from pydantic import BaseModel, ConfigDict, Field, model_validator

from flexcam.case import quantities as q
from flexcam.core.errors import NAME, InputError

Part = TypeVar("Part")
Name = Annotated[str, Field(min_length=1, pattern=NAME)]
Vector = tuple[q.SignedNumber, q.SignedNumber, q.SignedNumber]
Point = tuple[q.Position, q.Position, q.Position]
_Acceleration = Annotated[float, q.Unit("acceleration", signed=True)]
Gravity = tuple[_Acceleration, _Acceleration, _Acceleration]


class Record(BaseModel):
    """Base class of all tables: unknown keys are rejected, and values cannot be changed."""

    model_config = ConfigDict(
        extra="forbid", frozen=True, defer_build=True
    )  # built once, together with the enclosing table


class PartRecord(Record, Generic[Part]):
    """Base class of tables that describe one part; validation builds the part, so that its faults are reported too."""

    def build(self) -> Part:
        """Build the part, SI."""
        raise NotImplementedError

    def _check(self) -> None:
        """Check that the part can be built."""
        self.build()

    @model_validator(mode="after")
    def _check_part(self) -> Self:
        try:
            self._check()
        except InputError as refusal:
            raise q.convert_error(refusal, inside=True) from None
        return self
