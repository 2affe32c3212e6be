"""flexcam's kernel engine, which a linear run without coupled damping takes only where it is asked for."""

from __future__ import annotations

from benchmarks.peers import with_flexcam
from benchmarks.peers.work import Result, Work


def run(work: Work) -> Result:
    """Integrate at all speeds."""
    return with_flexcam.run(work, "kernel")
