"""One solver, one work, in a process of its own: ``python -m benchmarks.peers.once with_scipy B1 1 OUT.npz``."""

from __future__ import annotations

import importlib
import sys
from dataclasses import replace

import numpy as np

from benchmarks.peers import work as works
from benchmarks.peers.train import C1, measure


def main(solver: str, name: str, amount: str, out: str) -> None:
    """Run and write motion and seconds: so many speeds, evenly spread, or all settings of C1 for so many seconds."""
    if name == "C1":
        settings = importlib.import_module(f"benchmarks.peers.{solver}").settings(C1)
        np.savez(out, **vars(measure(settings, C1, enough=float(amount))))
        return
    work: works.Work = getattr(works, name)
    picked = np.linspace(0, len(work.frequencies) - 1, int(amount)).round().astype(int)
    work = replace(work, frequencies=tuple(work.frequencies[i] for i in picked))
    result = importlib.import_module(f"benchmarks.peers.{solver}").run(work)
    np.savez(out, displacement=result.displacement, loop=result.loop_seconds, whole=result.whole_seconds)


if __name__ == "__main__":
    main(*sys.argv[1:])
