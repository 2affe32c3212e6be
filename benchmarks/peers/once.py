"""One solver, one work, in a process of its own: ``python -m benchmarks.peers.once with_scipy B1 OUT.npz``."""

from __future__ import annotations

import importlib
import sys
from dataclasses import replace

import numpy as np

from benchmarks.peers import work as works


def main(solver: str, name: str, speeds: str, out: str) -> None:
    """Run and write displacements and seconds; the first so many speeds, evenly spread."""
    work: works.Work = getattr(works, name)
    picked = np.linspace(0, len(work.frequencies) - 1, int(speeds)).round().astype(int)
    work = replace(work, frequencies=tuple(work.frequencies[i] for i in picked))
    result = importlib.import_module(f"benchmarks.peers.{solver}").run(work)
    np.savez(out, displacement=result.displacement, loop=result.loop_seconds, whole=result.whole_seconds)


if __name__ == "__main__":
    main(*sys.argv[1:])
