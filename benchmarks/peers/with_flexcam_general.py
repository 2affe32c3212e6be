"""flexcam's direct engine, which takes every system: cost of a run that no other engine fits."""

from __future__ import annotations

from benchmarks.peers import with_flexcam
from benchmarks.peers.work import Result, Work


def run(work: Work) -> Result:
    """Integrate at all speeds."""
    return with_flexcam.run(work, "direct")
