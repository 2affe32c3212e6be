"""The least time of some repeats: on a machine shared with others every time is too long, never too short."""

from __future__ import annotations

import time
from collections.abc import Callable


def least(work: Callable[[], object], repeats: int = 5) -> float:
    """Return the least time of a work, s."""
    took = []
    for _ in range(repeats):
        began = time.perf_counter()
        work()
        took.append(time.perf_counter() - began)
    return min(took)
