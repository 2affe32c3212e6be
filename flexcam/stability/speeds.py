"""What endangers a case over a range of speeds."""

from __future__ import annotations

from collections.abc import Iterable

from flexcam.case import Case
from flexcam.response import Advance, counted
from flexcam.stability.verdict import Stability, stability


def over_speeds(case: Case, speeds: Iterable[float], *, advance: Advance | None = None) -> list[Stability]:
    """Return what endangers a case at several speeds: growth rates as a map, causes beside them."""
    return [stability(case.at_speed(speed)) for speed in counted(speeds, advance)]
