"""flexcam in machine code, which long runs and many runs take by themselves."""

from __future__ import annotations

from benchmarks.peers import with_flexcam
from benchmarks.peers.work import Result, Work


def run(work: Work) -> Result:
    """Integrate at all speeds."""
    return with_flexcam.run(work, "compiled")
