"""The plain way: Newmark's method as in a textbook, `scipy.sparse.linalg.splu` once, a loop in Python."""

from __future__ import annotations

import time

import numpy as np
from scipy.sparse import csc_array
from scipy.sparse.linalg import splu

from benchmarks.peers.work import FloatArray, Result, Work, matrices


def run(work: Work) -> Result:
    """Integrate at all speeds."""
    started = time.perf_counter()
    M, K, watched = matrices(work)
    begun = time.perf_counter()
    moved = np.array([_integrated(csc_array(M), csc_array(K), watched, work, f) for f in work.frequencies])
    ended = time.perf_counter()
    return Result(moved, ended - begun, ended - started)


def _integrated(M: csc_array, K: csc_array, watched: FloatArray, work: Work, frequency: float) -> FloatArray:
    dt, loads = work.step(frequency), work.loads(frequency)
    solve = splu((M + 0.25 * dt**2 * K).tocsc()).solve
    d, v, a, load = (np.zeros(M.shape[0]) for _ in range(4))  # no load at first, so no acceleration
    moved = np.zeros((work.steps + 1, 2))
    for i in range(1, work.steps + 1):
        load[watched] = loads[i]
        d += dt * v + 0.25 * dt**2 * a
        v += 0.5 * dt * a
        a = solve(load - K @ d)
        d += 0.25 * dt**2 * a
        v += 0.5 * dt * a
        moved[i] = d[watched]
    return moved
