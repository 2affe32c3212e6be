"""What every table of the case file has in common."""

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
    """A table of the case file: no unknown keys, no changes after reading."""

    model_config = ConfigDict(extra="forbid", frozen=True, defer_build=True)  # built once, with the table around it


class PartRecord(Record, Generic[Part]):
    """A table that describes one part: reading it makes the part, so that its faults join the one report."""

    def made(self) -> Part:
        """Return the part, SI."""
        raise NotImplementedError

    def _check(self) -> None:
        """Refuse a part that cannot be."""
        self.made()

    @model_validator(mode="after")
    def _is_possible(self) -> Self:
        try:
            self._check()
        except InputError as refusal:
            raise q.passed_on(refusal, inside=True) from None
        return self
