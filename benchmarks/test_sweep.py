"""Sweep over speeds of one case."""

from __future__ import annotations

from benchmarks.measure.sweep import measure_table


def test_speeds(benchmark):
    found = benchmark(measure_table, 3)
    assert found["row_ms"] > found["motion_ms"] > 0.0
