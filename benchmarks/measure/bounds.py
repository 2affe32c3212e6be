"""What the machine could do at best: floating-point operations and bytes per second of one thread."""

from __future__ import annotations

import numpy as np

from benchmarks.timing import least

ORDER = 1500
LENGTH = 50_000_000
"""Numbers of an array: 0.4 GB, of no use to any cache."""


def measured() -> dict[str, float]:
    """Return the speed of BLAS's matrix product, GFlop/s, and of ``a = b + c`` on long arrays, GB/s."""
    A = np.random.default_rng(0).standard_normal((ORDER, ORDER))
    product = least(lambda: A @ A)
    b, c = np.ones(LENGTH), np.ones(LENGTH)
    a = np.empty(LENGTH)
    a[:] = 0.0  # its pages are given out here, not in the time
    sums = least(lambda: np.add(b, c, out=a))
    return {"GFlop/s": 2.0 * ORDER**3 / product / 1e9, "GB/s": 3.0 * 8.0 * LENGTH / sums / 1e9}
