"""Sweep over speeds of one case."""

from __future__ import annotations

from benchmarks.measure.sweep import measure_table


def test_speeds(benchmark):
    found = benchmark(measure_table, 3)
    assert min(found["row_ms"], found["motion_ms"], found["probes_ms"], found["command_s"]) > 0.0
