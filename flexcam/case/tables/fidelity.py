"""Table of what a run may leave out."""

from __future__ import annotations

from pydantic import Field

from flexcam.case.tables.base import Record


class FidelityRecord(Record):
    """What of the model is integrated."""

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
