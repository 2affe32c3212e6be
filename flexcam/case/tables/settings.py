"""Tables of settings of a valve spring that are compared with the case's own."""

from __future__ import annotations

from typing import Annotated, Self

from pydantic import Field, model_validator

from flexcam.case import quantity as q
from flexcam.case.tables.base import Record


class SettingRecord(Record):
    """A speed and a valve spring, for `flexcam settings`; what is not given is the case's own."""

    speed: q.Speed | None = Field(None, description="camshaft speed")
    crank_speed: q.Speed | None = Field(None, description="crankshaft speed, twice the camshaft's")
    stiffness: Annotated[float, q.Unit("stiffness", above=True)] | None = Field(None, description="of the spring")
    installed_compression: q.Length | None = Field(None, description="of the spring")

    @model_validator(mode="after")
    def _one_speed(self) -> Self:
        if self.speed is not None and self.crank_speed is not None:
            raise q.refused("either speed or crank_speed", "one follows from the other")
        return self

    @property
    def camshaft_speed(self) -> float | None:
        """Camshaft speed, rad/s; None for the case's."""
        return self.speed if self.crank_speed is None else 0.5 * self.crank_speed
