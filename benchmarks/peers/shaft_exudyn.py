"""B1 and B5 by Exudyn: `default` (dense, modified Newton), `full` (Newton) and `tuned` (sparse, modified Newton).

`tuned` also uses the build without range checks. `full` factorizes in every iteration, as a mechanism with variable
matrices would.
"""

from __future__ import annotations

import sys

from benchmarks.peers.shaft import Shaft, ShaftResult


def run(shaft: Shaft, variant: str = "default") -> ShaftResult:
    """Integrate at all speeds."""
    if variant == "tuned":
        sys.exudynFast = True  # has to be set before the import of exudyn
    from benchmarks.peers.exudyn_model import run_speeds

    return run_speeds(shaft, variant)
