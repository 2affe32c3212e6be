"""Table of sweeps."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field

from flexcam.case.schema.base import Record


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
