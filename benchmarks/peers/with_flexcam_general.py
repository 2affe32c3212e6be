"""flexcam by the loop that takes every system, contact or not: what a run costs that no fast path fits."""

from __future__ import annotations

from benchmarks.peers import with_flexcam
from benchmarks.peers.work import Result, Work


def run(work: Work) -> Result:
    """Integrate at all speeds."""
    return with_flexcam.run(work, "direct")
