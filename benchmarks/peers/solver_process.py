"""One solver on one benchmark in a new process: ``python -m benchmarks.peers.solver_process shaft_scipy B1 1 OUT.npz``.

A solver is a module of `benchmarks.peers`, for the shaft with a variant after a colon: ``shaft_flexcam:kernel``.
"""

from __future__ import annotations

import importlib
import sys
from dataclasses import replace

import numpy as np

from benchmarks.peers.shaft import B1, B5
from benchmarks.peers.train import C1, measure


def main(solver: str, name: str, amount: str, out: str) -> None:
    """Run and write motion and times.

    `amount` is the number of speeds, evenly distributed, or the seconds of repeats of each setting of C1.
    """
    file, _, variant = solver.partition(":")
    module = importlib.import_module(f"benchmarks.peers.{file}")
    if name == "C1":
        np.savez(out, **vars(measure(module.settings(C1), C1, seconds=float(amount))))
        return
    shaft = {"B1": B1, "B5": B5}[name]
    selected = np.linspace(0, len(shaft.frequencies) - 1, int(amount)).round().astype(int)
    shaft = replace(shaft, frequencies=tuple(shaft.frequencies[i] for i in selected))
    np.savez(out, **vars(module.run(shaft, variant) if variant else module.run(shaft)))


if __name__ == "__main__":
    main(*sys.argv[1:])
