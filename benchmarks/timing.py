"""Minimum times of repeated calls: on a shared machine, other processes make measured times longer, never shorter."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence

MAX_REPEATS = 20


def minimum_time(function: Callable[[], object], repeats: int = 5) -> float:
    """Return the minimum time of a function, s."""
    times = []
    for _ in range(repeats):
        start = time.perf_counter()
        function()
        times.append(time.perf_counter() - start)
    return min(times)


def minimum_cpu_times(functions: Sequence[Callable[[], object]], repeats: int = 5) -> list[float]:
    """Return the minimum processor time of each function, s, in repeats that alternate between them."""
    rounds = [[cpu_time(function) for function in functions] for _ in range(repeats)]
    return [min(times) for times in zip(*rounds, strict=True)]


def repeated_cpu_time(function: Callable[[], object], seconds: float) -> float:
    """Return the minimum processor time of a function, s, called until the calls have taken `seconds`."""
    times = [cpu_time(function)]
    while sum(times) < seconds and len(times) < MAX_REPEATS:
        times.append(cpu_time(function))
    return min(times)


def cpu_time(function: Callable[[], object]) -> float:
    """Return the processor time of a function, s, of all threads of the process.

    Other processes affect it less than the wall-clock time.
    """
    start = time.process_time()
    function()
    return time.process_time() - start
