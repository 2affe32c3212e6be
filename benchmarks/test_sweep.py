"""Many speeds of one case."""

from __future__ import annotations

from benchmarks.measure.sweep import measured


def test_speeds(benchmark):
    found = benchmark(measured, 3)
    assert found["row_ms"] > found["motion_ms"] > 0.0
