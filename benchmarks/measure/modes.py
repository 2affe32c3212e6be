"""The twenty lowest modes of shafts."""

from __future__ import annotations

from benchmarks.peers.with_flexcam import shaft
from benchmarks.peers.work import Work
from benchmarks.timing import least
from flexcam.dynamics import modes

SHAFTS = (Work(), Work(spans=17), Work(spans=172), Work(spans=99, elements=168), Work(spans=1724))
COUNT, REPEATS = 20, 3


def measured() -> list[dict[str, float]]:
    """Return the time of the search, by shaft."""
    rows = []
    for work in SHAFTS:
        system = shaft(work)
        took = least(lambda one=system: modes(one.mass, one.stiffness, COUNT), REPEATS)
        rows.append({"unknowns": system.size, "bearings": work.spans + 1, "seconds": took})
    return rows


def lowest(work: Work) -> None:
    """Find the modes of a shaft."""
    system = shaft(work)
    modes(system.mass, system.stiffness, COUNT)
