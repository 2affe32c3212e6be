"""The twenty lowest modes of shafts."""

from __future__ import annotations

from benchmarks.peers.shaft import Shaft
from benchmarks.peers.shaft_flexcam import shaft_system
from benchmarks.timing import minimum_time
from flexcam.dynamics import modes

SHAFTS = (Shaft(), Shaft(spans=17), Shaft(spans=172), Shaft(spans=99, elements=168), Shaft(spans=1724))
COUNT, REPEATS = 20, 3


def measure_table() -> list[dict[str, float]]:
    """Return the time of the eigenvalue solver, by shaft."""
    rows = []
    for shaft in SHAFTS:
        system = shaft_system(shaft)
        seconds = minimum_time(lambda system=system: modes(system.mass, system.stiffness, COUNT), REPEATS)
        rows.append({"unknowns": system.size, "bearings": shaft.spans + 1, "seconds": seconds})
    return rows


def find_modes(shaft: Shaft) -> None:
    """Find the lowest modes of a shaft."""
    system = shaft_system(shaft)
    modes(system.mass, system.stiffness, COUNT)
