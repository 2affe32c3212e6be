"""Table of a sweep: which keys take on which values."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field

from flexcam.case.tables.base import Record


class SweepRecord(Record):
    """Variants of the case that `flexcam sweep` runs; the command line lays its own keys over them."""

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


class SweepOnly(Record):
    """A case of which the sweep alone is looked at."""

    sweep: SweepRecord
