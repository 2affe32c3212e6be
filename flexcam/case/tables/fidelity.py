"""Table of how true a run is to be, and what it may leave out."""

from __future__ import annotations

from typing import Literal, Self

from pydantic import Field, model_validator

from flexcam.case import quantity as q
from flexcam.case.tables.base import Record


class ToleranceRecord(Record):
    """Error by quantity in the norm, as a part of its largest value; what is not named may err as it likes."""

    lift: q.Tolerance | None = None
    velocity: q.Tolerance | None = None
    acceleration: q.Tolerance | None = None
    force: q.Tolerance | None = Field(None, description="of every contact")

    @model_validator(mode="after")
    def _asks_for_something(self) -> Self:
        if not self.by_quantity():
            raise q.refused("at least one of lift, velocity, acceleration, force", "it asks for nothing")
        return self

    def by_quantity(self) -> dict[str, float]:
        """Return the tolerances that are given."""
        every = {name: getattr(self, name) for name in type(self).model_fields}
        return {name: float(value) for name, value in every.items() if value is not None}


class FidelityRecord(Record):
    """Which model of the case is run, and what of it is integrated."""

    model: Literal["beams", "rigid", "sdof", "chain"] = Field(
        "beams", description="flexible members, rigid ones, one mass for the train, or a chain of masses"
    )
    masses: int = Field(3, ge=1, le=1000, strict=True, description="of a chain, at nodes along its train")
    tolerance: q.Tolerance | ToleranceRecord | None = Field(
        None,
        description='run the cheapest model whose lift is within it, such as "1 %", or a table by quantity',
        union_mode="left_to_right",
    )
    norm: Literal["max", "rms"] | None = Field(
        None,
        description="of the errors of `tolerance` and `trade`: the largest or the root mean square; by default the "
        "largest of forces and the root mean square of motions",
    )
    estimate: bool = Field(
        False, strict=True, description="also run with other steps and elements, and say how far the numbers may be off"
    )
    prune: bool = Field(
        True,
        strict=True,
        description="leave out of the integration what nothing can move; it changes no result, only the time it takes",
    )
    modes: int | None = Field(
        None,
        ge=1,
        strict=True,
        description="integrate so many modes with the static answers they miss; every unknown by default",
    )
    reduction: Literal["modes", "craig-bampton"] = Field(
        "modes", description="modes of the whole train, or of each part between what is pushed, watched or touched"
    )

    @model_validator(mode="after")
    def _one_choice(self) -> Self:
        if self.tolerance is not None and self.model != "beams":
            raise q.refused("either model or tolerance", "a tolerance chooses the model")
        if self.reduction != "modes" and self.modes is None:
            raise q.refused("modes with a reduction", "it says how many")
        if self.modes is not None and self.model != "beams":
            raise q.refused("modes with model = beams", "they are modes of the beams")
        return self

    @property
    def tolerances(self) -> dict[str, float]:
        """Tolerance by quantity; empty where none is asked for."""
        if self.tolerance is None:
            return {}
        return self.tolerance.by_quantity() if isinstance(self.tolerance, ToleranceRecord) else {"lift": self.tolerance}
