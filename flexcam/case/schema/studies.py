"""Tables of studies: valve spring settings and sweeps."""

from __future__ import annotations

from typing import Annotated, Self

from pydantic import Field, model_validator

from flexcam.case import quantities as q
from flexcam.case.schema.base import Record


class SettingRecord(Record):
    """Speed and valve spring for `flexcam settings`; missing values are those of the case."""

    speed: q.Speed | None = Field(None, description="camshaft speed")
    crank_speed: q.Speed | None = Field(None, description="crankshaft speed, twice the camshaft's")
    stiffness: Annotated[float, q.Unit("stiffness", above=True)] | None = Field(None, description="of the spring")
    installed_compression: q.Length | None = Field(None, description="of the spring")

    @model_validator(mode="after")
    def _check_speed(self) -> Self:
        if self.speed is not None and self.crank_speed is not None:
            raise q.value_error("either speed or crank_speed", "one follows from the other")
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


class SweepFileRecord(Record):
    """Case of which only the table ``[sweep]`` is read."""

    sweep: SweepRecord
