"""The least time of some repeats: on a machine shared with others every time is too long, never too short."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence


def least(work: Callable[[], object], repeats: int = 5) -> float:
    """Return the least time of a work, s."""
    took = []
    for _ in range(repeats):
        began = time.perf_counter()
        work()
        took.append(time.perf_counter() - began)
    return min(took)


def least_processor_times(works: Sequence[Callable[[], object]], repeats: int = 5) -> list[float]:
    """Return the least processor time of each of some works, s, in repeats that alternate between them."""
    took = [[0.0] * len(works) for _ in range(repeats)]
    for row in took:
        for i, work in enumerate(works):
            began = time.process_time()
            work()
            row[i] = time.process_time() - began
    return [min(each) for each in zip(*took, strict=True)]
