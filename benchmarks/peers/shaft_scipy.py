"""B1 and B5 by scipy: Newmark's method as in a textbook, one factorization by `splu`, and a loop in Python."""

from __future__ import annotations

import time

import numpy as np
from scipy.sparse import csc_array
from scipy.sparse.linalg import splu

from benchmarks.peers.shaft import FloatArray, Shaft, ShaftResult, matrices


def run(shaft: Shaft) -> ShaftResult:
    """Integrate at all speeds."""
    start = time.perf_counter()
    M, K, observed = matrices(shaft)
    loop_start = time.perf_counter()
    displacements = np.array([_integrate(csc_array(M), csc_array(K), observed, shaft, f) for f in shaft.frequencies])
    end = time.perf_counter()
    return ShaftResult(displacements, end - loop_start, end - start)


def _integrate(M: csc_array, K: csc_array, observed: FloatArray, shaft: Shaft, frequency: float) -> FloatArray:
    dt, loads = shaft.step(frequency), shaft.loads(frequency)
    solve = splu((M + 0.25 * dt**2 * K).tocsc()).solve
    d, v, a, load = (np.zeros(M.shape[0]) for _ in range(4))  # no initial load, so no initial acceleration
    displacements = np.zeros((shaft.steps + 1, 2))
    for i in range(1, shaft.steps + 1):
        load[observed] = loads[i]
        d += dt * v + 0.25 * dt**2 * a
        v += 0.5 * dt * a
        a = solve(load - K @ d)
        d += 0.25 * dt**2 * a
        v += 0.5 * dt * a
        displacements[i] = d[observed]
    return displacements
